#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/surface/brick_cells.h"
#include "core/surface/contour_cell.h"

namespace strata {

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

}  // namespace strata
