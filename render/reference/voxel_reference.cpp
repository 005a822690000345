#include "render/reference/voxel_reference.h"

#include <algorithm>
#include <limits>

namespace strata {

std::optional<double> first_in_boxes(std::span<const Box3d> boxes, const VoxelRay& ray, double least_t, double grow) {
    std::optional<double> first;
    for (const Box3d& box : boxes) {
        double in = least_t, out = std::numeric_limits<double>::infinity();
        for (int axis = 0; axis < 3; ++axis) {
            const double low = box.min[axis] - grow - ray.origin[axis], high = box.max[axis] + grow - ray.origin[axis], step = ray.direction[axis];
            if (step == 0.0) {
                if (low > 0.0 || high < 0.0) out = -1.0;
                continue;
            }
            in = std::max(in, (step > 0.0 ? low : high) / step);
            out = std::min(out, (step > 0.0 ? high : low) / step);
        }
        if (in <= out && (!first || in < *first)) first = in;
    }
    return first;
}

}  // namespace strata
