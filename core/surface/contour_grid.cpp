#include <string>

#include "core/error.h"
#include "core/surface/contour.h"
#include "core/surface/slab_contour.h"

namespace strata {

ContourReport contour_grid(const GridPlacement& placement, const std::array<uint32_t, 3>& size, std::span<const float> values,
                           const ContourSettings& settings, ContourMesh& out) {
    SlabContour slab(placement, size, settings, 0.0, best_simd_level());
    out = {.origin = placement.origin, .positions = {}, .normals = {}, .triangles = {}};
    const int64_t layers = slab.layers();
    const uint64_t slice = uint64_t{size[0]} * size[1];
    if (slice != 0 && (values.size() % slice != 0 || values.size() / slice != size[2]))
        throw Error(ErrorKind::usage, std::to_string(values.size()) + " samples are not " + std::to_string(size[0]) + " x " +
                                          std::to_string(size[1]) + " x " + std::to_string(size[2]));
    if (layers == 0) return slab.report();
    const SlabSamples samples{.values = values.data(), .first_slice = 0};
    slab.plan(samples, 0, layers);
    const auto [vertices, triangles] = slab.part_of(0, layers);
    out.positions = LargeArray<Vec3f>(size_t(vertices));
    if (settings.normals) out.normals = LargeArray<Vec3f>(size_t(vertices));
    out.triangles = LargeArray<std::array<uint32_t, 3>>(size_t(triangles));
    slab.emit(samples, 0, layers, {.positions = out.positions.data(), .normals = out.normals.data(), .triangles = out.triangles.data()});
    return slab.report();
}

}  // namespace strata
