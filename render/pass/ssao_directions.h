#pragma once

#include <array>

namespace strata {

/// A place of the half surface that ambient occlusion looks at, as seen from a pixel.
struct SsaoOffset {
    int x, y;
    float length_px;  // in pixels of the whole picture
};

struct SsaoDirection {
    static constexpr int kSteps = 10;

    float x, y;  // length 1
    std::array<SsaoOffset, kSteps> offsets;
};

/// Two slices at right angles, each looked along both ways: +0, -0, +1, -1.
using SsaoDirections = std::array<SsaoDirection, 4>;

inline constexpr int kSsaoPhases = 4;  // rows of the half surface after which directions repeat

/// Directions and distances, which turn with the row: [row % kSsaoPhases].
std::array<SsaoDirections, kSsaoPhases> ssao_directions();

}  // namespace strata
