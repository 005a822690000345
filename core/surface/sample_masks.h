#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "core/simd_level.h"

namespace strata {

struct SampleStatistics {
    uint64_t nan = 0;
    float least = std::numeric_limits<float>::infinity(), greatest = -std::numeric_limits<float>::infinity();  // of what is not NaN

    void add(const SampleStatistics& other) {
        nan += other.nan;
        if (other.least < least) least = other.least;
        if (other.greatest > greatest) greatest = other.greatest;
    }
};

/// The float with which samples compare as they do with the isovalue: the least that is not below it, or, for `below`, the greatest
/// that is not above it.
float level_of(double isovalue, bool below);

/// Which samples are inside: a bit each, 64 a word, from the lowest bit. NaN never is.
/// levels      a mask each; see level_of
/// masks       [levels] where the words of each begin: (samples + 63) / 64 are written, the last filled with 0
/// statistics  of the samples are added
void find_inside(std::span<const float> samples, std::span<const float> levels, bool below, uint64_t* const* masks,
                 SampleStatistics& statistics, SimdLevel level);

}  // namespace strata
