#include "io/vdb/vdb_slices.h"

#include <algorithm>

namespace strata {

VdbSlices::VdbSlices(VdbField& field) : field_(field), placement_(field.placement()) {
    if (field.bricks() > 0) {
        least_ = field.least_index() - Vec3i::Ones();
        for (int axis = 0; axis < 3; ++axis) size_[size_t(axis)] = uint32_t(int64_t{field.greatest_index()[axis]} - least_[axis] + 2);
    }
    placement_.origin = placement_.world_from_index(least_.cast<double>());
    has_layer_ = field_.next_layer(layer_);
}

void VdbSlices::read(uint32_t count, double reference, std::span<float> out) {
    const size_t slice = size_t{size_[0]} * size_[1];
    for (uint32_t i = 0; i < count; ++i) read_slice(least_.z() + int32_t(next_++), reference, out.subspan(i * slice, slice));
}

void VdbSlices::read_slice(int32_t k, double reference, std::span<float> out) {
    while (has_layer_ && layer_.k + kFieldBrickSide <= k) has_layer_ = field_.next_layer(layer_);
    const int32_t first = k & ~(kFieldBrickSide - 1);
    const bool is_there = has_layer_ && layer_.k == first;
    size_t brick = 0;
    const auto end_x = int64_t{least_.x()} + size_[0];
    for (int64_t j = least_.y() & ~7; j < int64_t{least_.y()} + size_[1]; j += 8)
        for (int64_t i = least_.x() & ~7; i < end_x; i += 8) {
            // Corners ascend as these do.
            const bool given = is_there && brick < layer_.corners.size() && layer_.corners[brick] == std::array{int32_t(i), int32_t(j)};
            const float* const values = given ? layer_.values.data() + brick++ * kFieldBrickSamples + (k - first) * 64 : nullptr;
            const float absent = given ? 0.0f : field_.absent_value({int32_t(i), int32_t(j), first});
            for (int64_t y = std::max<int64_t>(j, least_.y()); y < std::min<int64_t>(j + 8, int64_t{least_.y()} + size_[1]); ++y)
                for (int64_t x = std::max<int64_t>(i, least_.x()); x < std::min<int64_t>(i + 8, end_x); ++x) {
                    const float value = given ? values[(y - j) * 8 + (x - i)] : absent;
                    out[size_t(y - least_.y()) * size_[0] + size_t(x - least_.x())] = float(double(value) - reference);
                }
        }
}

}  // namespace strata
