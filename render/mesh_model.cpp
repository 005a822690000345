#include "render/mesh_model.h"

#include <utility>

#include "core/surface/corner_normals.h"
#include "render/model_serial.h"

namespace strata {

MeshModel::MeshModel(const TriangleMesh& drawn, MeshColors painted, const MeshStyle& drawn_as, int threads)
    : mesh(&drawn), colors(std::move(painted)), style(drawn_as), serial(next_model_serial()) {
    for (const std::array<uint32_t, 3>& triangle : drawn.triangles)
        for (const uint32_t vertex : triangle) bounds.extend(drawn.positions[vertex]);
    if (style.shading == MeshShading::smooth) corners = corner_normals(drawn, threads);
}

MeshModelBytes mesh_model_bytes(const TriangleMesh& mesh, MeshShading shading) {
    const uint64_t vertices = mesh.positions.size(), triangles = mesh.triangles.size();
    const uint64_t kept = mesh.size_bytes() + (shading == MeshShading::smooth ? 12 * triangles : 0);
    return {kept, kept + (shading == MeshShading::smooth ? 36 * triangles + 8 * vertices : 0)};
}

}  // namespace strata
