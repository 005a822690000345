#include "render/pass/mesh_clip.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

constexpr double kSlack = 0x1p-20;  // of the distance that was gone: keys are rounded to 2^-24

}  // namespace

MeshClip::MeshClip(std::span<const ClipBox> boxes, const MeshProjection& view) : view_(view) {
    for (const ClipBox& clip : boxes) (clip.action == ClipBox::Action::keep ? keeping_ : removing_).push_back(clip.box);
}

Coverage MeshClip::coverage(const std::array<Vec3d, 3>& corners) const {
    Box3d around;
    for (const Vec3d& p : corners) around.extend(p);
    const auto holds = [&](const Box3d& box) { return box.contains(around.min) && box.contains(around.max); };
    // A little more than the box, for `keeps`.
    const Vec3d margin = Vec3d::Constant(2.0 * kSlack * std::max((around.min - view_.eye).norm(), (around.max - view_.eye).norm()));
    const auto meets = [&](const Box3d& box) {
        return (box.min.array() <= (around.max + margin).array()).all() && (box.max.array() >= (around.min - margin).array()).all();
    };
    if (std::any_of(removing_.begin(), removing_.end(), holds)) return Coverage::none;
    if (!keeping_.empty() && std::none_of(keeping_.begin(), keeping_.end(), meets)) return Coverage::none;
    const bool kept = keeping_.empty() || std::any_of(keeping_.begin(), keeping_.end(), holds);
    return kept && std::none_of(removing_.begin(), removing_.end(), meets) ? Coverage::whole : Coverage::part;
}

bool MeshClip::keeps(int32_t column, int32_t row, double key) const {
    const MeshProjection::Ray ray = view_.ray(column + 0.5, row + 0.5);
    const double depth = view_.depth_of(key);
    const Vec3d way = ray.origin + depth * ray.direction, p = view_.eye + way;
    const Vec3d slack = Vec3d::Constant(kSlack * way.norm());
    const auto holds = [&](const Box3d& box) {
        return (p.array() >= (box.min - slack).array()).all() && (p.array() <= (box.max + slack).array()).all();
    };
    return (keeping_.empty() || std::any_of(keeping_.begin(), keeping_.end(), holds)) && std::none_of(removing_.begin(), removing_.end(), holds);
}

}  // namespace strata
