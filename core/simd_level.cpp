#include "core/simd_level.h"

namespace strata {

SimdLevel best_simd_level() {
    static const SimdLevel best = [] {
        // avx512: what every such server processor since 2017 has.
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
            __builtin_cpu_supports("avx512vl"))
            return SimdLevel::avx512;
        return __builtin_cpu_supports("avx2") ? SimdLevel::avx2 : SimdLevel::baseline;
    }();
    return best;
}

std::vector<SimdLevel> simd_levels() {
    std::vector<SimdLevel> levels = {SimdLevel::baseline};
    if (best_simd_level() >= SimdLevel::avx2) levels.push_back(SimdLevel::avx2);
    if (best_simd_level() >= SimdLevel::avx512) levels.push_back(SimdLevel::avx512);
    return levels;
}

std::string_view name_of(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return "baseline";
        case SimdLevel::avx2: return "AVX2";
        case SimdLevel::avx512: return "AVX-512";
    }
    return "";
}

}  // namespace strata
