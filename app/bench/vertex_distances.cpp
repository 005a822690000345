#include "app/bench/vertex_distances.h"

#include <algorithm>
#include <cmath>

namespace strata {

VertexDistances distances_of_vertices(const ContourMesh& mesh, double (*distance)(const Vec3d& place)) {
    VertexDistances found;
    double squares = 0.0;
    for (const Vec3f& p : mesh.positions) {
        const double off = std::abs(distance(mesh.origin + p.cast<double>()));
        found.largest = std::max(found.largest, off);
        squares += off * off;
    }
    found.rms = std::sqrt(squares / double(std::max<size_t>(mesh.positions.size(), 1)));
    return found;
}

}  // namespace strata
