#pragma once

#include <bit>
#include <cstdint>

#include "core/math/random.h"

namespace strata {

// The analytic building blocks of the simulated world. Plain arithmetic instead of the C library's functions, which
// differ in the last bit from processor to processor: a scene is the same on every machine, and loops over waves vectorize.

struct SinCos {
    double sin, cos;
};

/// Sine and cosine of `turns` full turns, within 1e-13, for |turns| < 2^40.
inline SinCos sin_cos_turns(double turns) {
    constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to a whole number
    const double rest = turns - ((turns + kRound) - kRound);
    const double a = rest * 3.14159265358979323846;  // half the angle, |a| <= pi / 2: Taylor's remainder is below 1e-14
    const double q = a * a;
    const double s = a * (1.0 + q * (-1.0 / 6 + q * (1.0 / 120 + q * (-1.0 / 5040 + q * (1.0 / 362880 + q * (-1.0 / 39916800 +
                     q * (1.0 / 6227020800 + q * (-1.0 / 1307674368000 + q * (1.0 / 355687428096000)))))))));
    const double c = 1.0 + q * (-0.5 + q * (1.0 / 24 + q * (-1.0 / 720 + q * (1.0 / 40320 + q * (-1.0 / 3628800 +
                     q * (1.0 / 479001600 + q * (-1.0 / 87178291200 + q * (1.0 / 20922789888000 + q * (-1.0 / 6402373705728000)))))))));
    return {2.0 * s * c, 1.0 - 2.0 * s * s};
}

/// Natural logarithm of a positive normal number, within 1e-13 of it or of its relative size.
inline double natural_log(double value) {
    constexpr uint64_t kHalfRoot = 0x3fe6a09e667f3bcdu;  // the bits of sqrt(1/2)
    const uint64_t bits = std::bit_cast<uint64_t>(value);
    const int64_t exponent = int64_t(bits - kHalfRoot) >> 52;
    const double mantissa = std::bit_cast<double>(bits - (uint64_t(exponent) << 52));  // in [sqrt(1/2), sqrt(2))
    const double s = (mantissa - 1.0) / (mantissa + 1.0), q = s * s;  // log m = 2 atanh s, |s| < 0.1716: the remainder is below 2e-14
    const double tail = q * (1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11 + q * (1.0 / 13 + q * (1.0 / 15)))))));
    return double(exponent) * 0.6931471805599453 + 2.0 * (s + s * tail);
}

/// The greatest whole number that is not above `value`; |value| < 2^62. Without a call, unlike std::floor on plain x86-64.
inline int64_t floor_to_int(double value) {
    const int64_t whole = int64_t(value);
    return whole - (value < double(whole) ? 1 : 0);
}

/// A number in [0, 1) for each lattice point and salt.
inline double lattice_value(int64_t x, int64_t y, int64_t z, uint64_t salt) {
    const uint64_t key = uint64_t(x) * 0x9e3779b97f4a7c15u ^ uint64_t(y) * 0xc2b2ae3d27d4eb4fu ^ uint64_t(z) * 0x165667b19e3779f9u;
    return double(mix_bits(key ^ salt) >> 11) * 0x1p-53;
}

/// Smooth noise in [0, 1) over the plane, with features about one unit wide.
inline double smooth_noise(double x, double y, uint64_t salt) {
    const int64_t ix = floor_to_int(x), iy = floor_to_int(y);
    const double u = x - double(ix), v = y - double(iy);
    const double su = u * u * (3.0 - 2.0 * u), sv = v * v * (3.0 - 2.0 * v);
    const double low = lattice_value(ix, iy, 0, salt) * (1.0 - su) + lattice_value(ix + 1, iy, 0, salt) * su;
    const double high = lattice_value(ix, iy + 1, 0, salt) * (1.0 - su) + lattice_value(ix + 1, iy + 1, 0, salt) * su;
    return low * (1.0 - sv) + high * sv;
}

/// The same in space.
inline double smooth_noise(double x, double y, double z, uint64_t salt) {
    const int64_t iz = floor_to_int(z);
    const double w = z - double(iz), sw = w * w * (3.0 - 2.0 * w);
    return smooth_noise(x, y, mix_bits(salt + uint64_t(iz))) * (1.0 - sw) + smooth_noise(x, y, mix_bits(salt + uint64_t(iz + 1))) * sw;
}

}  // namespace strata
