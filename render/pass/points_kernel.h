#pragma once

#include <cstddef>
#include <cstdint>

#include "core/simd_level.h"
#include "render/pass/band_locks.h"
#include "render/pass/points_pass.h"

namespace strata {

/// Rows of words that points are drawn into.
struct WordRows {
    /// Words behind each row that kernels may read and write back.
    static constexpr uint32_t kPadding = 4;

    uint64_t* words;
    uint32_t stride;  // words from row to row: width + kPadding
    uint32_t width, first_row, rows;
    const BandLocks& locks;  // of rows counted from first_row
};

/// Draws points [begin, end) of a node. Safe from several threads at once.
using DrawPoints = void (*)(const WordRows& target, const PointNode& node, size_t begin, size_t end,
                            const PointProjection& projection, const SplatStyle& style);

/// The kernel compiled for an instruction set, which the processor must have. All draw the same words.
DrawPoints points_kernel(SimdLevel level);

}  // namespace strata
