#pragma once

#include <cstddef>
#include <cstdint>

#include "core/simd_level.h"
#include "render/pass/points_pass.h"
#include "render/pass/splat_cover.h"

namespace strata {

/// Rows of words that points are drawn into.
struct WordRows {
    PixelRows rows;
    uint64_t* words;
};

/// Draws points [begin, end) of a node. Safe from several threads at once.
using DrawPoints = void (*)(const WordRows& target, const PointNode& node, size_t begin, size_t end,
                            const PointProjection& projection, const SplatStyle& style);

/// The kernel compiled for an instruction set, which the processor must have. All draw the same words.
DrawPoints points_kernel(SimdLevel level);

}  // namespace strata
