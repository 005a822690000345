#include "io/vdb/vdb_at_vertices.h"

#include <limits>
#include <utility>

namespace strata {
namespace {

// Points are numbered by 32 bits; what lies beyond is background.
float value_of(VdbField& field, int64_t i, int64_t j, int64_t k) {
    for (const int64_t part : {i, j, k})
        if (part != int32_t(part)) return field.background();
    return field.value_at({int(i), int(j), int(k)});
}

// So far that a double has no place between points.
bool is_nowhere(const Vec3d& index) { return !(index.cwiseAbs().maxCoeff() < 0x1p52); }

}  // namespace

void VdbAtVertices::look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) {
    for (size_t v = 0; v < positions.size(); ++v) {
        const Vec3d index = places_.index_of(origin, positions[v]);
        out[v] = is_nowhere(index) ? field_->background() : trilinear_at(index, [&](int64_t i, int64_t j, int64_t k) { return value_of(*field_, i, j, k); });
    }
}

VdbColorsAtVertices::VdbColorsAtVertices(std::array<std::unique_ptr<VdbField>, 3> components, std::function<uint8_t(float)> encode)
    : components_(std::move(components)), encode_(std::move(encode)), places_(components_[0]->placement()) {}

void VdbColorsAtVertices::look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<std::array<uint8_t, 4>> out) {
    for (size_t v = 0; v < positions.size(); ++v) {
        out[v] = kNoColor;
        const Vec3d index = places_.index_of(origin, positions[v]);
        if (is_nowhere(index)) continue;
        Vec3d sum = Vec3d::Zero();
        double known = 0.0;
        visit_corners(index, [&](int64_t i, int64_t j, int64_t k, double weight) {
            Vec3d color;
            for (int part = 0; part < 3; ++part) color[part] = double(value_of(*components_[size_t(part)], i, j, k));
            if (!color.allFinite()) return;
            sum += weight * color;
            known += weight;
        });
        if (known == 0.0) continue;
        for (size_t part = 0; part < 3; ++part) out[v][part] = encode_(float(sum[int(part)] / known));
    }
}

}  // namespace strata
