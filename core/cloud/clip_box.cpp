#include "core/cloud/clip_box.h"

#include <algorithm>
#include <cassert>
#include <limits>

namespace strata {
namespace {

constexpr double kLeast = std::numeric_limits<int32_t>::min(), kMost = std::numeric_limits<int32_t>::max();

}  // namespace

ClipRegion::QuantaBox ClipRegion::quanta_box(const Box3d& box, const Quantization& quantization, double margin_quanta) {
    QuantaBox quanta;
    for (int axis = 0; axis < 3; ++axis) {
        const double scale = quantization.scale[axis], offset = quantization.offset[axis];
        const double low = first_quantum_from(box.min[axis], scale, offset) - margin_quanta;
        const double high = last_quantum_to(box.max[axis], scale, offset) + margin_quanta;
        if (!(low <= kMost && high >= kLeast && low <= high)) return {.low = Vec3i::Constant(1), .high = Vec3i::Zero()};
        quanta.low[axis] = int32_t(std::max(low, kLeast));
        quanta.high[axis] = int32_t(std::min(high, kMost));
    }
    return quanta;
}

ClipRegion::ClipRegion(std::span<const ClipBox> boxes, const Quantization& quantization) : quantization_(quantization) {
    for (const ClipBox& clip : boxes)
        (clip.action == ClipBox::Action::keep ? keeping_ : removing_).push_back(quanta_box(clip.box, quantization, 0.0));
}

void ClipRegion::test(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z,
                      std::span<uint8_t> left) const {
    assert(x.size() == left.size() && y.size() == left.size() && z.size() == left.size());
    const auto holds = [&](const QuantaBox& box, size_t i) {
        return uint8_t((x[i] >= box.low.x()) & (x[i] <= box.high.x()) & (y[i] >= box.low.y()) & (y[i] <= box.high.y()) &
                       (z[i] >= box.low.z()) & (z[i] <= box.high.z()));
    };
    std::fill(left.begin(), left.end(), keeping_.empty() ? 1 : 0);
    for (const QuantaBox& box : keeping_)
        for (size_t i = 0; i < left.size(); ++i) left[i] |= holds(box, i);
    for (const QuantaBox& box : removing_)
        for (size_t i = 0; i < left.size(); ++i) left[i] &= uint8_t(1 ^ holds(box, i));
}

Coverage ClipRegion::coverage(const Vec3i& low, const Vec3i& high) const {
    const auto meets = [&](const QuantaBox& box) {
        return (box.low.array() <= box.high.array()).all() && (box.low.array() <= high.array()).all() &&
               (box.high.array() >= low.array()).all();
    };
    const auto holds = [&](const QuantaBox& box) {
        return (box.low.array() <= low.array()).all() && (box.high.array() >= high.array()).all();
    };
    if (std::any_of(removing_.begin(), removing_.end(), holds)) return Coverage::none;
    if (!keeping_.empty() && std::none_of(keeping_.begin(), keeping_.end(), meets)) return Coverage::none;
    const bool kept = keeping_.empty() || std::any_of(keeping_.begin(), keeping_.end(), holds);
    return kept && std::none_of(removing_.begin(), removing_.end(), meets) ? Coverage::whole : Coverage::part;
}

Coverage ClipRegion::coverage(const Box3d& bounds) const {
    if (everything()) return Coverage::whole;
    const QuantaBox box = quanta_box(bounds, quantization_, 1.0);
    // Where no quanta of the cloud are, it has no points; that is for whoever reads them to find.
    return (box.low.array() <= box.high.array()).all() ? coverage(box.low, box.high) : Coverage::part;
}

}  // namespace strata
