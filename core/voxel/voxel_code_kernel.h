#pragma once

#include <cstdint>
#include <span>

#include "core/math/quantization.h"
#include "core/math/vec.h"
#include "core/simd_level.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

/// Which voxel a point of a cloud lies in: on each axis floor(quanta * scale + offset), and none where that is not in 0 ... side - 1.
/// A point that only the rounding of doubles keeps below a face of its voxel is on it, and belongs to the voxel above.
struct VoxelFromQuanta {
    Vec3d scale, offset;  // voxels per quantum; of quantum 0
    double side;          // of the frame

    VoxelFromQuanta(const VoxelFrame& frame, const Quantization& quantization);
};

inline constexpr uint64_t kNoVoxel = ~uint64_t{0};

/// The octant codes of points' voxels, kNoVoxel for those outside of the frame.
/// x, y, z  [n] quanta
/// codes    [n]
void find_voxel_codes(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, std::span<uint64_t> codes,
                      SimdLevel level = best_simd_level());

}  // namespace strata
