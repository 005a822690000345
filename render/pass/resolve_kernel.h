#pragma once

#include <cstdint>
#include <span>

#include "core/simd_level.h"
#include "render/pass/points_pass.h"

namespace strata {

/// What a row of words is made from: as drawn.
struct ResolveInput {
    static constexpr uint32_t kSlotRanks = 1024;

    std::span<const PointNode> nodes;
    std::span<const uint32_t> slots;  // slot of every kSlotRanks-th rank
    const PointProjection& projection;
    const SplatStyle& style;
    const ResolveOptions& options;
    bool near;  // every node is, as is_near has it
};

/// Turns the words of one row of the picture into the row of the G-buffer that begins at `pixel`, as long as out is wide.
using ResolveRow = void (*)(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel);

/// The kernel compiled for an instruction set, which the processor must have. All give the same bits.
ResolveRow resolve_kernel(SimdLevel level);

}  // namespace strata
