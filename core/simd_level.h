#pragma once

#include <string_view>
#include <vector>

namespace strata {

/// Instruction sets that kernels come compiled for. Every one gives the same bits: the choice never shows in a result.
enum class SimdLevel { baseline, avx2, avx512 };

/// The best that this processor and its operating system run.
SimdLevel best_simd_level();

/// All that run here, baseline first: for tests and benches.
std::vector<SimdLevel> simd_levels();

std::string_view name_of(SimdLevel level);

}  // namespace strata
