#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/vec.h"
#include "render/image.h"

namespace strata {

inline constexpr uint32_t kMostSamples = 1024;

/// Where in its pixel a sample of several lies, from the middle, in [-0.5, 0.5). The first lies in the middle. Along either
/// axis the samples are evenly apart, so that an edge across a pixel shows in as many levels as there are samples.
/// source  a rank-1 lattice whose generator is near the golden section, as Fibonacci lattices are
Vec2f sample_offset_px(uint32_t sample, uint32_t samples);

/// Averages pictures in linear light. The sums are integers, so that neither order nor threads show.
class SampleSums {
public:
    /// first  starts anew, for so many pixels
    void add(std::span<const Rgba8> picture, bool first, int threads);
    /// The average of what was added. A picture averaged with itself is itself.
    void average(std::span<Rgba8> out, int threads) const;

private:
    struct Pixel {
        std::array<uint64_t, 3> light;  // linear, weighted by alpha
        uint64_t alpha;
    };
    std::vector<Pixel> pixels_;
    uint32_t samples_ = 0;
};

}  // namespace strata
