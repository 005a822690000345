#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/math/box.h"
#include "core/math/quantization.h"

namespace strata {

/// A box that keeps the points in it, or removes them. Points on its faces are in it; sides may be infinite.
struct ClipBox {
    enum class Action { keep, remove };

    Box3d box;  // world
    Action action = Action::keep;

    bool operator==(const ClipBox& other) const {
        return box.min == other.box.min && box.max == other.box.max && action == other.action;
    }
};

/// How much of something is left.
enum class Coverage { none, part, whole };

/// What clip boxes leave of a cloud: the points in any of the keeping boxes (all, where there are none) that are in none of
/// the removing ones. Decided in whole quanta: a point on a face is in the box, in every program that asks.
class ClipRegion {
public:
    ClipRegion(std::span<const ClipBox> boxes, const Quantization& quantization);

    bool everything() const { return keeping_.empty() && removing_.empty(); }

    /// Sets left[i] to 1 where point i is left, else to 0.
    void test(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z, std::span<uint8_t> left) const;

    /// What is left of points that lie anywhere from `low` to `high`, quanta, both included. `none` and `whole` are certain.
    Coverage coverage(const Vec3i& low, const Vec3i& high) const;
    /// The same of points in a box of the world, which may lie a quantum beside it for its rounding.
    Coverage coverage(const Box3d& bounds) const;

private:
    struct QuantaBox {
        Vec3i low, high;  // both included; holds nothing where low > high
    };
    static QuantaBox quanta_box(const Box3d& box, const Quantization& quantization, double margin_quanta);

    Quantization quantization_;
    std::vector<QuantaBox> keeping_, removing_;
};

}  // namespace strata
