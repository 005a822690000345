#pragma once

#include <array>
#include <cstdint>

#include "render/image.h"

namespace strata {

/// What each 8-bit sRGB value becomes in 256 steps of linear light: [step][value].
const std::array<std::array<uint8_t, 256>, 256>& dimmed_colors();

/// A color in light from 0 to 1.
Rgba8 lit(Rgba8 color, float light);

}  // namespace strata
