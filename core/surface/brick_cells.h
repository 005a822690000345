#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/brick_layers.h"
#include "core/surface/contour_cell.h"

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

/// What the cells of a brick's place see: samples of the brick and of the seven around its upper side.
struct BrickView {
    std::array<const float*, 8> values;
    std::array<unsigned, 8> reach;  // of indices: 0 where all samples are one

    BrickView(const BrickCells& cells, const MaskedLayers& layers, size_t brick) {
        for (size_t n = 0; n < 8; ++n) {
            const int32_t there = cells.samples[brick][n];
            values[n] =
                there < 0 ? &cells.constants[size_t(-1 - there)] : layers[n >> 2]->layer.values.data() + size_t(there) * kFieldBrickSamples;
            reach[n] = there < 0 ? 0 : kFieldBrickSamples - 1;
        }
    }
    double at(unsigned i, unsigned j, unsigned k) const {  // each 0 to 8
        const unsigned brick = i >> 3 | j >> 3 << 1 | k >> 3 << 2;
        return double(values[brick][(((k & 7) * kFieldBrickSide + (j & 7)) * kFieldBrickSide + (i & 7)) & reach[brick]]);
    }
    /// Of a cell, less the isovalue; inside is positive or 0.
    CellValues cell(double isovalue, bool below, unsigned i, unsigned j, unsigned k) const {
        CellValues out;
        for (unsigned c = 0; c < 8; ++c) {
            const double v = at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
            out[c] = below ? isovalue - v : v - isovalue;
        }
        return out;
    }
};

/// The places in the lists of a layer and of the next of what is at each corner + (n & 1, n >> 1 & 1, n >> 2) bricks.
/// lists  ascending; or null
/// step   -1: of the layer before, and at each corner - that
void find_around(const std::vector<BrickPlace>& corners, const std::array<const std::vector<BrickPlace>*, 2>& lists, int step, int threads,
                 std::vector<AroundBrick>& found);

/// Finds cells, and counts what the surfaces in them will have.
class BrickCellCounter {
public:
    /// make_room  as BrickLayerWindow's
    BrickCellCounter(const FieldBrickSource& source, const ContourSettings& settings, const BrickLevels& levels,
                     std::function<void(uint64_t bytes, bool must)> make_room)
        : source_(source), settings_(settings), levels_(levels), make_room_(std::move(make_room)) {}

    /// below  the cells of the layer below, if it has any
    std::optional<BrickCells> count(int32_t k, const MaskedLayers& layers, const BrickCells* below);
    /// Takes cells for their memory.
    void give_back(BrickCells cells) { spare_ = std::move(cells); }

    /// Bytes that it keeps for each brick of the last layer.
    uint64_t bytes() const { return before_.size() * sizeof before_[0]; }
    uint64_t ambiguous_cells() const { return ambiguous_; }
    uint64_t tunnel_cells() const { return tunnels_; }
    bool is_open() const { return is_open_; }  // somewhere, at NaN

private:
    void find_whole(BrickCells& cells, const MaskedLayers& layers, const BrickCells* below);
    bool leave_out_unused(BrickCells& cells, const BrickCells* below, size_t isovalue, size_t brick) const;

    const FieldBrickSource& source_;
    const ContourSettings& settings_;
    const BrickLevels& levels_;
    std::function<void(uint64_t, bool)> make_room_;
    const SimdLevel simd_level_ = best_simd_level();
    BrickCells spare_;
    std::vector<AroundBrick> before_;  // of cells with NaN: the bricks below along any axes
    uint64_t ambiguous_ = 0, tunnels_ = 0;
    bool is_open_ = false;
};

// Words of a plane's samples or cells, moved by one along i or j; what comes in is the next brick's.
namespace brick_word {
inline constexpr uint64_t kFirstColumn = 0x0101010101010101, kLastColumn = kFirstColumn << 7, kLastRow = uint64_t{0xff} << 56;
inline uint64_t along_i(uint64_t plane, uint64_t next) { return (plane >> 1 & ~kLastColumn) | (next & kFirstColumn) << 7; }
inline uint64_t along_j(uint64_t plane, uint64_t next) { return plane >> 8 | next << 56; }
inline uint64_t back_along_i(uint64_t plane, uint64_t last) { return (plane & ~kLastColumn) << 1 | (last & kLastColumn) >> 7; }
inline uint64_t back_along_j(uint64_t plane, uint64_t last) { return plane << 8 | last >> 56; }
}  // namespace brick_word

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

/// Of a plane's cells, from the samples of two planes.
inline std::array<uint64_t, 8> corner_words(const std::array<uint64_t, 4>& low, const std::array<uint64_t, 4>& high) {
    return {low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]};
}
inline uint64_t active_cells(const std::array<uint64_t, 8>& corner) {
    uint64_t any = 0, all = ~uint64_t{0};
    for (const uint64_t word : corner) {
        any |= word;
        all &= word;
    }
    return any & ~all;
}
inline unsigned case_of_cell(const std::array<uint64_t, 8>& corner, unsigned bit) {
    unsigned cell_case = 0;
    for (unsigned c = 0; c < 8; ++c) cell_case |= unsigned(corner[c] >> bit & 1) << c;
    return cell_case;
}

}  // namespace strata
