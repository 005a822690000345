#pragma once

#include <Eigen/Geometry>

#include <map>
#include <utility>
#include <vector>

#include "core/surface/surface_sink.h"
#include "core/surface/triangle_mesh.h"

namespace strata {

/// Keeps a surface as it comes, quads beside triangles, and holds it to what SurfaceSink promises.
class SurfaceInMemory : public SurfaceSink {
public:
    void add(const SurfacePiece& piece) override {
        for (const Vec3f& p : piece.positions) positions.push_back(piece.origin + p.cast<double>());
        normals.insert(normals.end(), piece.normals.begin(), piece.normals.end());
        colors.insert(colors.end(), piece.colors.begin(), piece.colors.end());
        scalars.resize(piece.scalars.size());
        for (size_t s = 0; s < scalars.size(); ++s) scalars[s].insert(scalars[s].end(), piece.scalars[s].values.begin(), piece.scalars[s].values.end());
        triangles.insert(triangles.end(), piece.triangles.begin(), piece.triangles.end());
        quads.insert(quads.end(), piece.quads.begin(), piece.quads.end());
        for (const auto& triangle : piece.triangles) check(triangle);
        for (const auto& quad : piece.quads) check(quad);
        ++pieces;
    }

    /// All faces as triangles.
    TriangleMesh mesh() const {
        TriangleMesh mesh{.positions = positions, .triangles = triangles, .normals = normals, .colors = colors};
        for (const auto& q : quads) {
            mesh.triangles.push_back({q[0], q[1], q[2]});
            mesh.triangles.push_back({q[0], q[2], q[3]});
        }
        return mesh;
    }

    std::vector<Vec3d> positions;
    std::vector<Vec3f> normals;
    std::vector<std::array<uint8_t, 4>> colors;
    std::vector<std::vector<float>> scalars;  // an attribute each
    std::vector<std::array<uint32_t, 3>> triangles;
    std::vector<std::array<uint32_t, 4>> quads;
    size_t pieces = 0;
    bool refers_ahead = false;  // a face has a vertex that has not come

private:
    template <class Face>
    void check(const Face& face) {
        for (const uint32_t v : face) refers_ahead = refers_ahead || v >= positions.size();
    }
};

/// Edges that are not used as often one way as the other, by their ends' places. 0: the faces' boundary
/// is empty.
inline size_t open_edges(const TriangleMesh& mesh) {
    using Place = std::array<double, 3>;
    std::map<std::pair<Place, Place>, int> edges;
    const auto place = [&](uint32_t v) { return Place{mesh.positions[v].x(), mesh.positions[v].y(), mesh.positions[v].z()}; };
    for (const auto& t : mesh.triangles)
        for (size_t i = 0; i < 3; ++i) {
            const Place a = place(t[i]), b = place(t[(i + 1) % 3]);
            if (a < b) ++edges[{a, b}];
            else --edges[{b, a}];
        }
    size_t open = 0;
    for (const auto& [edge, count] : edges) open += count != 0;
    return open;
}

/// That the faces enclose.
inline double volume_of(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const auto& t : mesh.triangles)
        sum += (mesh.positions[t[0]] - mesh.positions[0])
                   .dot((mesh.positions[t[1]] - mesh.positions[0]).cross(mesh.positions[t[2]] - mesh.positions[0]));
    return sum / 6.0;
}

inline double area_of(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const auto& t : mesh.triangles)
        sum += (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm();
    return sum / 2.0;
}

}  // namespace strata
