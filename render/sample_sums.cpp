#include "render/sample_sums.h"

#include <cassert>
#include <cmath>
#include <numeric>

#include "core/parallel.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr size_t kBlock = 1 << 16;    // pixels a thread takes at a time
constexpr double kFullLight = 1 << 24;  // far below the least step between two codes, 1 / (12.92 * 255); sums fit in 42 bits

std::array<uint64_t, 256> light_of_codes() {
    std::array<uint64_t, 256> light;
    for (int code = 0; code < 256; ++code) light[size_t(code)] = uint64_t(std::llround(linear_from_srgb(code / 255.0) * kFullLight));
    return light;
}

}  // namespace

Vec2f sample_offset_px(uint32_t sample, uint32_t samples) {
    uint32_t generator = uint32_t(std::lround(samples * 0.61803398874989485));
    while (std::gcd(generator, samples) != 1) ++generator;
    const auto offset = [&](uint32_t step) {
        const float place = float(step % samples) / float(samples);
        return place < 0.5f ? place : place - 1.0f;
    };
    return {offset(sample), offset(sample * generator)};
}

void SampleSums::add(std::span<const Rgba8> picture, bool first, int threads) {
    if (first) {
        pixels_.assign(picture.size(), Pixel{});
        samples_ = 0;
    }
    assert(picture.size() == pixels_.size());
    ++samples_;
    static const std::array<uint64_t, 256> light = light_of_codes();
    parallel_blocks(threads, pixels_.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Rgba8 color = picture[i];
            const uint64_t alpha = alpha_of(color);
            Pixel& sum = pixels_[i];
            sum.light[0] += light[red_of(color)] * alpha;
            sum.light[1] += light[green_of(color)] * alpha;
            sum.light[2] += light[blue_of(color)] * alpha;
            sum.alpha += alpha;
        }
    });
}

void SampleSums::average(std::span<Rgba8> out, int threads) const {
    assert(out.size() == pixels_.size());
    parallel_blocks(threads, pixels_.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Pixel& sum = pixels_[i];
            if (sum.alpha == 0) {
                out[i] = 0;
                continue;
            }
            const auto code = [&](uint64_t light) { return srgb8_from_linear(float(double(light) / (double(sum.alpha) * kFullLight))); };
            out[i] = make_rgba(code(sum.light[0]), code(sum.light[1]), code(sum.light[2]), uint8_t((sum.alpha + samples_ / 2) / samples_));
        }
    });
}

}  // namespace strata
