#include "core/voxel/voxel_frame.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/error.h"

namespace strata {
namespace {

constexpr double kMargin = 0x1p-9;      // voxels between the box and the faces of its frame
constexpr double kMostVoxels = 0x1p41;  // from the origin of the world: doubles are then 2^-11 voxel apart or less
constexpr uint32_t kMostResolution = uint32_t{1} << 2 * kMostVoxelLevels;

std::string short_text(double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%.10g", number);
    return text;
}

void check_box(const Box3d& box) {
    if (box.empty()) throw Error(ErrorKind::usage, "nothing to make voxels of: the bounds are empty");
    if (!box.min.allFinite() || !box.max.allFinite()) throw Error(ErrorKind::usage, "the bounds are not finite");
}

void check_distance(const Box3d& box, double voxel_size) {
    const double farthest = std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
    if (!(farthest < kMostVoxels * voxel_size))
        throw Error(ErrorKind::limit, "voxels of " + short_text(voxel_size) + " cannot be told apart at coordinates of " + short_text(farthest) +
                                          " with 64-bit floating point; " + short_text(farthest / kMostVoxels * (1.0 + 1e-6)) + " is possible");
}

int levels_of(uint64_t voxels) {
    int levels = 1;
    while (uint64_t{1} << 2 * levels < voxels) ++levels;
    return levels;
}

}  // namespace

VoxelFrame frame_of_resolution(const Box3d& box, uint32_t resolution) {
    check_box(box);
    if (resolution < 1 || resolution > kMostResolution)
        throw Error(ErrorKind::usage, "a resolution is from 1 to " + std::to_string(kMostResolution) + " voxels");
    double longest = box.size().maxCoeff();
    if (!std::isfinite(longest)) throw Error(ErrorKind::limit, "the bounds are too far apart");
    if (!(longest > 0.0)) longest = 1.0;  // one point: a cube of one unit around it
    VoxelFrame frame;
    frame.levels = levels_of(resolution);
    frame.voxel_size = longest / (resolution - 2.0 * kMargin);
    check_distance(box, frame.voxel_size);
    frame.origin = box.min - Vec3d::Constant(kMargin * frame.voxel_size);
    return frame;
}

VoxelFrame frame_of_voxel_size(const Box3d& box, double voxel_size) {
    check_box(box);
    if (!(voxel_size > 0.0) || !std::isfinite(voxel_size)) throw Error(ErrorKind::usage, "a voxel's size is a positive number");
    check_distance(box, voxel_size);
    VoxelFrame frame;
    frame.voxel_size = voxel_size;
    const Vec3d first = (box.min / voxel_size).array().floor() - 1.0, last = (box.max / voxel_size).array().floor() + 1.0;
    const double side = (last - first).maxCoeff() + 1.0;
    if (!(side <= kMostResolution))
        throw Error(ErrorKind::usage, "voxels of " + short_text(voxel_size) + " would be " + std::to_string(uint64_t(std::min(side, 1e18))) +
                                          " along the longest side, and at most " + std::to_string(kMostResolution) + " are possible");
    frame.levels = levels_of(uint64_t(side));
    frame.origin = first * voxel_size;
    return frame;
}

}  // namespace strata
