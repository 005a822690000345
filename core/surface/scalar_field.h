#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// Where the samples of a grid lie: sample (i, j, k) at origin + axes * (i, j, k). What is made of samples is made in index space and
/// placed last.
struct GridPlacement {
    Vec3d origin = Vec3d::Zero();    // world: of sample (0, 0, 0)
    Mat3d axes = Mat3d::Identity();  // columns: a step along i, j, k; world units. Not singular; they may lean, and be left-handed

    Vec3d world_from_index(const Vec3d& p_index) const { return origin + axes * p_index; }
    bool is_mirrored() const { return axes.determinant() < 0.0; }  // counterclockwise in index space is clockwise in the world
};

/// Scalars on a grid in memory.
struct ScalarGrid {
    GridPlacement placement;
    std::array<uint32_t, 3> size = {0, 0, 0};  // samples an axis
    std::vector<float> values;                 // [size] i runs fastest, then j. NaN: no value

    uint64_t samples() const { return uint64_t{size[0]} * size[1] * size[2]; }
};

/// Scalars on a grid that may be larger than memory, read from k = 0 upwards.
class SliceSource {
public:
    virtual ~SliceSource() = default;
    virtual const GridPlacement& placement() const = 0;
    virtual std::array<uint32_t, 3> size() const = 0;  // samples an axis
    /// Reads the next slices of constant k.
    /// count      slices; no more than are left
    /// reference  subtracted before values are rounded to float, so that small steps near an isovalue survive in large numbers
    /// out        [count * size[1] * size[0]] i runs fastest, then j. NaN: no value
    /// throws     Error, naming the file and the place
    virtual void read(uint32_t count, double reference, std::span<float> out) = 0;
};

inline constexpr int kFieldBrickSide = 8;  // samples an axis
inline constexpr int kFieldBrickSamples = 512;

/// Bricks of 8^3 samples whose least k is the same.
struct FieldBrickLayer {
    int32_t k = 0;                                // of their least samples; a multiple of 8, as i and j
    std::vector<std::array<int32_t, 2>> corners;  // (i, j) of the least sample of each brick, ascending by j, then i
    std::vector<float> values;                    // [corners * 512] i runs fastest, then j. NaN: no value
};

/// Scalars on an endless grid of which only some bricks are stored, layer after layer from the least k upwards. A brick that is not given is
/// constant, of the background's value or of that of a constant region, such as the inside of a level set; or NaN: there is no value. Of two bricks that touch, if
/// only at a corner, and have different values that are not NaN, one is given: a surface passes only through cells with a sample in a brick that is given.
class FieldBrickSource {
public:
    virtual ~FieldBrickSource() = default;
    virtual const GridPlacement& placement() const = 0;
    virtual float background() const = 0;
    /// The value of a brick that is not given, and lies next to one that is.
    /// corner  i, j and k of its least sample; multiples of 8
    virtual float absent_value(const std::array<int32_t, 3>& corner) const {
        (void)corner;
        return background();
    }
    /// The next layer that has bricks; false: there is none.
    /// throws  Error, naming the file and the place
    virtual bool next_layer(FieldBrickLayer& out) = 0;
};

}  // namespace strata
