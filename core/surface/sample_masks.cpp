#include "core/surface/sample_masks.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "core/simd_target.h"

namespace strata {
namespace {

constexpr size_t kWord = 64, kLanes = 16;
constexpr size_t kAhead = 512;  // samples; what lies beyond the last is asked for in vain

using Floats = float __attribute__((vector_size(64)));
using Counts = int32_t __attribute__((vector_size(64)));

inline void add_statistics(const float* samples, size_t n, SampleStatistics& statistics) {
    Floats least, greatest;
    Counts nan = {};  // of fewer than 2^31 samples
    for (size_t lane = 0; lane < kLanes; ++lane) {
        least[lane] = statistics.least;
        greatest[lane] = statistics.greatest;
    }
    const size_t whole = n / kLanes * kLanes;
    for (size_t i = 0; i < whole; i += kLanes) {
        Floats v;
        std::memcpy(&v, samples + i, sizeof v);
        __builtin_prefetch(samples + i + kAhead);  // across the pages' ends, before which the processor's own stops
        least = v < least ? v : least;
        greatest = v > greatest ? v : greatest;
        nan -= v != v;
    }
    for (size_t lane = 0; lane < kLanes; ++lane)
        statistics.add({.nan = uint64_t(nan[lane]), .least = least[lane], .greatest = greatest[lane]});
    for (size_t i = whole; i < n; ++i) statistics.add({.nan = samples[i] != samples[i], .least = samples[i], .greatest = samples[i]});
}

uint64_t plain_word(const float* samples, size_t n, float level, bool below) {
    uint64_t word = 0;
    for (size_t i = 0; i < n; ++i) word |= uint64_t(below ? samples[i] <= level : samples[i] >= level) << i;
    return word;
}

// Comparisons that make masks are instructions for which plain code has no word.
#if defined(__x86_64__)

void find_words_baseline(const float* samples, size_t words, float level, bool below, uint64_t* mask) {
    const __m128 bound = _mm_set1_ps(level);
    for (size_t w = 0; w < words; ++w) {
        uint64_t word = 0;
        for (size_t i = 0; i < kWord; i += 4) {
            const __m128 v = _mm_loadu_ps(samples + w * kWord + i);
            word |= uint64_t(_mm_movemask_ps(below ? _mm_cmple_ps(v, bound) : _mm_cmpge_ps(v, bound))) << i;
        }
        mask[w] = word;
    }
}
__attribute__((target("avx2"))) void find_words_avx2(const float* samples, size_t words, float level, bool below, uint64_t* mask) {
    const __m256 bound = _mm256_set1_ps(level);
    for (size_t w = 0; w < words; ++w) {
        uint64_t word = 0;
        for (size_t i = 0; i < kWord; i += 8) {
            const __m256 v = _mm256_loadu_ps(samples + w * kWord + i);
            const __m256 inside = below ? _mm256_cmp_ps(v, bound, _CMP_LE_OQ) : _mm256_cmp_ps(v, bound, _CMP_GE_OQ);
            word |= uint64_t(uint32_t(_mm256_movemask_ps(inside))) << i;
        }
        mask[w] = word;
    }
}
__attribute__((target("avx512f"))) void find_words_avx512(const float* samples, size_t words, float level, bool below, uint64_t* mask) {
    const __m512 bound = _mm512_set1_ps(level);
    for (size_t w = 0; w < words; ++w) {
        uint64_t word = 0;
        for (size_t i = 0; i < kWord; i += 16) {
            const __m512 v = _mm512_loadu_ps(samples + w * kWord + i);
            word |= uint64_t(below ? _mm512_cmp_ps_mask(v, bound, _CMP_LE_OQ) : _mm512_cmp_ps_mask(v, bound, _CMP_GE_OQ)) << i;
        }
        mask[w] = word;
    }
}

#else

void find_words_baseline(const float* samples, size_t words, float level, bool below, uint64_t* mask) {
    for (size_t w = 0; w < words; ++w) mask[w] = plain_word(samples + w * kWord, kWord, level, below);
}
constexpr auto find_words_avx2 = find_words_baseline, find_words_avx512 = find_words_baseline;

#endif

STRATA_KERNEL_BASELINE void add_statistics_baseline(const float* samples, size_t n, SampleStatistics& statistics) {
    add_statistics(samples, n, statistics);
}
STRATA_KERNEL_AVX2 void add_statistics_avx2(const float* samples, size_t n, SampleStatistics& statistics) {
    add_statistics(samples, n, statistics);
}
STRATA_KERNEL_AVX512 void add_statistics_avx512(const float* samples, size_t n, SampleStatistics& statistics) {
    add_statistics(samples, n, statistics);
}

}  // namespace

float level_of(double isovalue, bool below) {
    if (below) return -level_of(-isovalue, false);
    constexpr double kMost = double(std::numeric_limits<float>::max());
    if (isovalue > kMost) return std::numeric_limits<float>::infinity();
    if (isovalue < -kMost) return -std::numeric_limits<float>::max();
    const float nearest = float(isovalue);
    return double(nearest) >= isovalue ? nearest : std::nextafter(nearest, std::numeric_limits<float>::infinity());
}

void find_inside(std::span<const float> samples, std::span<const float> levels, bool below, uint64_t* const* masks,
                 SampleStatistics& statistics, SimdLevel level) {
    const auto add = level == SimdLevel::avx512 ? add_statistics_avx512
                     : level == SimdLevel::avx2 ? add_statistics_avx2
                                                : add_statistics_baseline;
    const auto find = level == SimdLevel::avx512 ? find_words_avx512 : level == SimdLevel::avx2 ? find_words_avx2 : find_words_baseline;
    add(samples.data(), samples.size(), statistics);
    const size_t words = samples.size() / kWord, rest = samples.size() % kWord;
    for (size_t s = 0; s < levels.size(); ++s) {
        find(samples.data(), words, levels[s], below, masks[s]);
        if (rest > 0) masks[s][words] = plain_word(samples.data() + words * kWord, rest, levels[s], below);
    }
}

}  // namespace strata
