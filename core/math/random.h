#pragma once

#include <cstdint>

namespace strata {

/// A well mixed 64-bit hash of a 64-bit value; a bijection. Source: splitmix64, S. Vigna, public domain.
constexpr uint64_t mix_bits(uint64_t value) {
    value += 0x9e3779b97f4a7c15u;
    value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9u;
    value = (value ^ (value >> 27)) * 0x94d049bb133111ebu;
    return value ^ (value >> 31);
}

/// Seeded stream of random numbers, the same on every machine. Copy it to replay it.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed) {}

    uint64_t bits() { return mix_bits(state_++); }
    /// Uniform in [0, 1), a multiple of 2^-53.
    double uniform() { return double(bits() >> 11) * 0x1p-53; }
    double uniform(double low, double high) { return low + (high - low) * uniform(); }
    /// Standard normal; most often one draw.
    double normal();

private:
    uint64_t state_;
};

}  // namespace strata
