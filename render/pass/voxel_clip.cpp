#include "render/pass/voxel_clip.h"

#include <algorithm>
#include <limits>

namespace strata {
namespace {

// Between where a ray comes into a box and where it leaves it; from > to where it misses.
struct Crossing {
    double from, to;
    CellFace enters, leaves;  // of what lies behind, as the ray sees it
};

Crossing cross(const Box3d& box, const VoxelRay& ray) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    Crossing crossing = {-kInfinity, kInfinity, CellFace::inside, CellFace::inside};
    for (int axis = 0; axis < 3; ++axis) {
        const double origin = ray.origin[axis], step = ray.direction[axis];
        if (step == 0.0) {
            if (origin < box.min[axis] || origin > box.max[axis]) return {kInfinity, -kInfinity, CellFace::inside, CellFace::inside};
            continue;
        }
        const double in = ((step > 0.0 ? box.min : box.max)[axis] - origin) / step, out = ((step > 0.0 ? box.max : box.min)[axis] - origin) / step;
        const CellFace face = CellFace(2 * axis + (step > 0.0 ? 0 : 1));
        if (in > crossing.from) crossing.from = in, crossing.enters = face;
        if (out < crossing.to) crossing.to = out, crossing.leaves = face;
    }
    return crossing;
}

}  // namespace

VoxelClip::VoxelClip(std::span<const ClipBox> boxes, const VoxelFrame& frame) {
    for (const ClipBox& clip : boxes)
        (clip.action == ClipBox::Action::keep ? keeping_ : removing_)
            .push_back({.min = frame.voxel_from_world(clip.box.min), .max = frame.voxel_from_world(clip.box.max)});
}

void VoxelClip::spans(const VoxelRay& ray, double least_t, double most_t, std::vector<RaySpan>& out) const {
    out.clear();
    if (keeping_.empty()) out.push_back({least_t, most_t, CellFace::inside});
    for (const Box3d& box : keeping_) {
        const Crossing crossing = cross(box, ray);
        RaySpan span = {std::max(crossing.from, least_t), std::min(crossing.to, most_t), crossing.from > least_t ? crossing.enters : CellFace::inside};
        if (span.from < span.to) out.push_back(span);
    }
    std::sort(out.begin(), out.end(), [](const RaySpan& a, const RaySpan& b) { return a.from < b.from; });
    size_t last = 0;
    for (size_t i = 1; i < out.size(); ++i) {
        if (out[i].from <= out[last].to)
            out[last].to = std::max(out[last].to, out[i].to);
        else
            out[++last] = out[i];
    }
    out.resize(std::min(out.size(), last + 1));
    for (const Box3d& box : removing_) {
        const Crossing hole = cross(box, ray);
        if (!(hole.from < hole.to)) continue;
        for (size_t i = out.size(); i-- > 0;) {
            const RaySpan span = out[i];
            if (hole.to <= span.from || hole.from >= span.to) continue;
            const RaySpan behind = {hole.to, span.to, hole.leaves};
            out[i].to = hole.from;
            if (behind.from < behind.to) out.insert(out.begin() + ptrdiff_t(i) + 1, behind);
            if (!(out[i].from < out[i].to)) out.erase(out.begin() + ptrdiff_t(i));
        }
    }
    for (RaySpan& span : out) {
        if (span.face != CellFace::inside) span.from += 0x1p-40 * std::abs(span.from);
        if (span.to < most_t) span.to -= 0x1p-40 * std::abs(span.to);
    }
}

}  // namespace strata
