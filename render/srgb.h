#pragma once

#include <array>
#include <cstdint>

#include "core/math/vec.h"

namespace strata {

/// The sRGB curve, IEC 61966-2-1: encoded value to linear light and back, both in [0, 1].
double linear_from_srgb(double encoded);
double srgb_from_linear(double linear);

/// The 256 linear values of 8-bit sRGB.
const std::array<float, 256>& linear_from_srgb8();
/// The nearest 8-bit sRGB code, exactly as rounding srgb_from_linear would give it; below 0 and NaN give 0, above 1 gives 255.
uint8_t srgb8_from_linear(float linear);

/// OKLab: lightness and two opponent axes in which equal distances look about equal. Source: B. Ottosson, "A perceptual
/// color space for image processing", 2020.
Vec3d oklab_from_linear(const Vec3d& rgb);
Vec3d linear_from_oklab(const Vec3d& lab);

}  // namespace strata
