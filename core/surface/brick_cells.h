#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/surface/brick_layers.h"
#include "core/surface/brick_word.h"

namespace strata {

/// The surface of an isovalue in the cells whose least corner is in a brick's place, and on the edges that begin at its samples.
struct BrickPart {
    std::array<BrickPlanes, 3> crossed;                            // edges along i, j, k that have a vertex: [axis][plane]
    std::array<std::array<uint32_t, kFieldBrickSide>, 3> first;    // the number of the first vertex on those
    uint32_t first_inner = 0, inner = 0;
    uint64_t first_triangle = 0;
    uint32_t triangles = 0;

    /// Vertices on edges along i and j in the least plane of a layer's bricks come with the layer before.
    static bool comes_early(size_t axis, size_t plane) { return axis < 2 && plane == 0; }
};

/// A layer of masks and the next; null: there are no bricks.
using MaskedLayers = std::array<const MaskedLayer*, 2>;
/// Places in lists of what is around a brick; -1: it is not there.
using AroundBrick = std::array<int32_t, 8>;

/// The bricks with cells of one layer: those that hold samples and those just below them along any axes.
struct BrickCells {
    int32_t k = 0;
    std::vector<BrickPlace> corners;
    std::vector<AroundBrick> samples;  // [corners] the bricks at + (n & 1, n >> 1 & 1, n >> 2) in their layers; -1 - n: constants[n]
    std::vector<float> constants;      // of bricks that are not given
    std::vector<BrickPlanes> whole;    // [corners] the cells without a NaN sample; empty: all are taken for such
    std::vector<BrickPart> parts;      // [isovalue * corners + brick]

    size_t bricks() const { return corners.size(); }
    uint64_t whole_cells(size_t brick, size_t plane) const { return whole.empty() ? ~uint64_t{0} : whole[brick][plane]; }
    uint64_t bytes() const {
        return corners.size() * (sizeof corners[0] + sizeof samples[0]) + constants.size() * sizeof constants[0] +
               whole.size() * sizeof whole[0] + parts.size() * sizeof parts[0];
    }

    /// Which samples of plane k, 0 to 8, that the corners of a brick's cells with that k lie in, are inside of a level.
    std::array<uint64_t, 4> corners_of(const MaskedLayers& layers, const BrickLevels& levels, size_t level, size_t brick, int plane) const;
};

inline std::array<uint64_t, 4> BrickCells::corners_of(const MaskedLayers& layers, const BrickLevels& levels, size_t level, size_t brick,
                                                      int plane) const {
    std::array<uint64_t, 4> words;
    for (size_t n = 0; n < 4; ++n) {
        const size_t upper = size_t(plane) / kFieldBrickSide;
        const int32_t there = samples[brick][4 * upper + n];
        words[n] = there < 0 ? levels.mask_of(constants[size_t(-1 - there)], level)
                             : layers[upper]->masks[level * layers[upper]->layer.corners.size() + size_t(there)][size_t(plane) % kFieldBrickSide];
    }
    const uint64_t up = brick_word::along_j(words[0], words[2]), up_next = brick_word::along_j(words[1], words[3]);
    return {words[0], brick_word::along_i(words[0], words[1]), up, brick_word::along_i(up, up_next)};
}

/// A brick some others away.
inline BrickPlace moved(const BrickPlace& corner, int32_t bricks_i, int32_t bricks_j) {
    return {corner[0] + kFieldBrickSide * bricks_i, corner[1] + kFieldBrickSide * bricks_j};
}

/// The places in the lists of a layer and of the next of what is at each corner + (n & 1, n >> 1 & 1, n >> 2) bricks.
/// lists  ascending; or null
/// step   -1: of the layer before, and at each corner - that
void find_around(const std::vector<BrickPlace>& corners, const std::array<const std::vector<BrickPlace>*, 2>& lists, int step, int threads,
                 std::vector<AroundBrick>& found);

}  // namespace strata
