#include "render/pass/blend_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/simd_target.h"
#include "render/pass/point_block.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr int kCodes = 256;

// The code nearest to each light: what is encoded and averaged with its like comes back exactly.
const std::vector<uint8_t>& codes_of_light() {
    static const std::vector<uint8_t> table = [] {
        std::vector<uint8_t> codes(LightSum::kFullLight + 1);
        for (size_t light = 0; light < codes.size(); ++light) codes[light] = srgb8_from_linear(float(light) / float(LightSum::kFullLight));
        return codes;
    }();
    return table;
}

// Of the colors of a block: each times a weight is one step of a sum.
struct Lights {
    alignas(64) std::array<uint32_t, 4> of[kPointBlock];  // red, green, blue and 1

    Lights(const std::array<uint32_t, kCodes>& table, const Rgba8* colors, size_t count) {
        for (size_t i = 0; i < count; ++i) of[i] = {table[red_of(colors[i])], table[green_of(colors[i])], table[blue_of(colors[i])], 1};
    }
};

// e^(-4 square), to 2e-4, times the full weight. square: at most 1
inline uint32_t weight_of(float square) {
    const float y = 0.5f * square;
    const float eighth = 1.0f - y * (1.0f - y * (0.5f - y * (1.0f / 6.0f - y * (1.0f / 24.0f - y * (1.0f / 120.0f)))));
    const float quarter = eighth * eighth, half = quarter * quarter;
    return uint32_t(int32_t(half * half * float(LightSum::kFullWeight) + 0.5f));
}

// The pixels of a block take the light of each splat. A value is the splat's key there, above its weight.
template <bool perspective>
struct SplatLight {
    static constexpr bool kValuesFirst = true;

    const PixelRows& rows;
    const uint64_t* words;
    LightSum* sums;
    const PointProjection& view;
    const PointBlock& block;
    const Lights& lights;
    float inverse_unit = 1.0f / view.pixels_per_unit;

    uint64_t value_at(const PointBlock&, size_t i, float x, float y) const {
        const SplatHit hit = splat_at<SplatShape::paraboloid, perspective>(view, block, i, x, y, inverse_unit);
        const uint64_t value = uint64_t{std::bit_cast<uint32_t>(hit.key)} << 32 | weight_of(std::min(1.0f, hit.square));  // 1 where points that are not seen give NaN
        return hit.covered != 0 ? value : 0;
    }

    // Whether depth(key) <= depth(front) + radius, without a division.
    bool shows(float key, float front, size_t i) const {
        const float angle = 0.5f * block.size_px[i] * inverse_unit;
        if constexpr (perspective) return front * block.key[i] <= key * (block.key[i] + angle * front);
        return front - key <= -view.key_scale * angle;
    }

    void put(size_t pixel, uint64_t value, size_t i) {
        if (value == 0 || !shows(key_of_word(value), key_of_word(words[pixel]), i)) return;
        const uint32_t weight = uint32_t(value);
        const std::array<uint32_t, 4>& light = lights.of[i];
        LightSum& sum = sums[pixel];
        sum.red += weight * light[0];
        sum.green += weight * light[1];
        sum.blue += weight * light[2];
        sum.weight += weight * light[3];
    }
};

inline void blend_any(const BlendRows& target, const PointNode& node, size_t begin, size_t end, const PointProjection& view,
                      const SplatStyle& style, const std::array<uint32_t, kCodes>& table) {
    visit_blocks(node, begin, end, view, style, [&](auto perspective, const PointBlock& block, size_t first, size_t count) {
        const Lights lights(table, &node.points->colors[first], count);
        SplatLight<perspective()> light = {target.rows, target.words, target.sums, view, block, lights};
        visit_splats<SplatShape::paraboloid>(light, block, count);
    });
}

STRATA_KERNEL_BASELINE void blend_baseline(const BlendRows& target, const PointNode& node, size_t begin, size_t end,
                                           const PointProjection& view, const SplatStyle& style) {
    blend_any(target, node, begin, end, view, style, light_of_codes());
}
STRATA_KERNEL_AVX2 void blend_avx2(const BlendRows& target, const PointNode& node, size_t begin, size_t end,
                                   const PointProjection& view, const SplatStyle& style) {
    blend_any(target, node, begin, end, view, style, light_of_codes());
}
STRATA_KERNEL_AVX512 void blend_avx512(const BlendRows& target, const PointNode& node, size_t begin, size_t end,
                                       const PointProjection& view, const SplatStyle& style) {
    blend_any(target, node, begin, end, view, style, light_of_codes());
}

}  // namespace

const std::array<uint32_t, kCodes>& light_of_codes() {
    static const std::array<uint32_t, kCodes> table = [] {
        std::array<uint32_t, kCodes> light;
        for (size_t code = 0; code < kCodes; ++code)
            light[code] = uint32_t(std::lround(linear_from_srgb8()[code] * float(LightSum::kFullLight)));
        return light;
    }();
    return table;
}

BlendPoints blend_kernel(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return blend_baseline;
        case SimdLevel::avx2: return blend_avx2;
        case SimdLevel::avx512: return blend_avx512;
    }
    return blend_baseline;
}

void average_light(const LightSum* sums, const uint64_t* words, std::span<Rgba8> colors) {
    const std::vector<uint8_t>& codes = codes_of_light();
    for (size_t i = 0; i < colors.size(); ++i) {
        if (words[i] == 0 || sums[i].weight == 0) continue;
        const double share = double(sums[i].weight);
        const auto code = [&](uint64_t sum) { return codes[size_t(double(sum) / share + 0.5)]; };
        colors[i] = make_rgba(code(sums[i].red), code(sums[i].green), code(sums[i].blue));
    }
}

}  // namespace strata
