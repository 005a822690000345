#include "render/srgb.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

// Codes change where linear light passes the middle between two codes. A table of guesses that are never too high, and
// at most a few steps too low, finds the code without a search.
struct EncodeTable {
    static constexpr int kGuesses = 4096;
    std::array<float, 256> next;            // linear light from which the code is at least index + 1
    std::array<uint8_t, kGuesses + 1> guess;  // code of i / kGuesses

    EncodeTable() {
        for (int code = 0; code < 255; ++code) next[size_t(code)] = float(linear_from_srgb((code + 0.5) / 255.0));
        next[255] = INFINITY;
        for (int i = 0, code = 0; i <= kGuesses; ++i) {
            while (float(i) / float(kGuesses) >= next[size_t(code)]) ++code;
            guess[size_t(i)] = uint8_t(code);
        }
    }
};

}  // namespace

double linear_from_srgb(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

double srgb_from_linear(double linear) {
    return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

const std::array<float, 256>& linear_from_srgb8() {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> values;
        for (int code = 0; code < 256; ++code) values[size_t(code)] = float(linear_from_srgb(code / 255.0));
        return values;
    }();
    return table;
}

uint8_t srgb8_from_linear(float linear) {
    static const EncodeTable table;
    if (!(linear > 0.0f)) return 0;
    if (linear >= 1.0f) return 255;
    uint8_t code = table.guess[size_t(linear * float(EncodeTable::kGuesses))];
    while (linear >= table.next[code]) ++code;
    return code;
}

Vec3d oklab_from_linear(const Vec3d& rgb) {
    const double l = std::cbrt(0.4122214708 * rgb.x() + 0.5363325363 * rgb.y() + 0.0514459929 * rgb.z());
    const double m = std::cbrt(0.2119034982 * rgb.x() + 0.6806995451 * rgb.y() + 0.1073969566 * rgb.z());
    const double s = std::cbrt(0.0883024619 * rgb.x() + 0.2817188376 * rgb.y() + 0.6299787005 * rgb.z());
    return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
            1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
            0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

Vec3d linear_from_oklab(const Vec3d& lab) {
    const auto cube = [](double value) { return value * value * value; };
    const double l = cube(lab.x() + 0.3963377774 * lab.y() + 0.2158037573 * lab.z());
    const double m = cube(lab.x() - 0.1055613458 * lab.y() - 0.0638541728 * lab.z());
    const double s = cube(lab.x() - 0.0894841775 * lab.y() - 1.2914855480 * lab.z());
    return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
            -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
            -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

}  // namespace strata
