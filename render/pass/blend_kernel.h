#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/simd_level.h"
#include "render/image.h"
#include "render/pass/points_pass.h"
#include "render/pass/splat_cover.h"

namespace strata {

/// What the splats that show a pixel's surface add up to: linear light times weight, and weight. Integers, so that the order in
/// which splats come does not show. A weight is at most 2^12 and light at most 2^16 - 1, so that 2^36 splats find room on one
/// pixel; a picture has fewer than 2^32 points.
struct LightSum {
    static constexpr uint32_t kFullWeight = 1 << 12, kFullLight = (1 << 16) - 1;

    uint64_t red, green, blue, weight;
};

/// Light of 8-bit codes, of LightSum::kFullLight.
const std::array<uint32_t, 256>& light_of_codes();

/// Words that are complete, and the sums of their pixels.
struct BlendRows {
    PixelRows rows;
    const uint64_t* words;
    LightSum* sums;
};

/// Adds points [begin, end) of a node to the pixels whose surface they show, as paraboloids: where a splat lies no farther behind what
/// the pixel's word shows than its own radius, both where the pixel's ray meets them. Splats of one plane fall back from it by no more,
/// however steep it is, and where the plane is not known a surface of any tilt is within the radius of a splat's center. The weight is e^(-4 s^2), s the distance of the ray from the
/// splat's center in its radii. Safe from several threads at once.
/// source  M. Botsch, A. Hornung, M. Zwicker, L. Kobbelt, "High-quality surface splatting on today's GPUs", 2005
using BlendPoints = void (*)(const BlendRows& target, const PointNode& node, size_t begin, size_t end, const PointProjection& projection,
                             const SplatStyle& style);

/// The kernel compiled for an instruction set, which the processor must have. All give the same sums.
BlendPoints blend_kernel(SimdLevel level);

/// Gives the pixels that have a word the mean of their light. sums, words: as many as colors
void average_light(const LightSum* sums, const uint64_t* words, std::span<Rgba8> colors);

}  // namespace strata
