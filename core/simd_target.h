#pragma once

// A kernel is written once, as plain code, and compiled for each SimdLevel by a wrapper that carries one of these: all that
// the wrapper calls becomes part of it and is vectorized for that instruction set.
#define STRATA_KERNEL_BASELINE __attribute__((flatten))
#define STRATA_KERNEL_AVX2 __attribute__((flatten, target("avx2")))
#define STRATA_KERNEL_AVX512 __attribute__((flatten, target("avx512f,avx512bw,avx512dq,avx512vl")))
