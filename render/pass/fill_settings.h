#pragma once

#include "core/math/camera.h"

namespace strata {

/// Closes gaps between the samples of one surface. A pixel is filled when it shows nothing, or something clearly farther,
/// while on at least 5 of the 8 lines through it both sides hold a surface that is thicker than a sample's rim, the gap
/// between them is narrow, and all of them lie near one plane. So an edge does not move, a corner of 90 degrees keeps its
/// shape, and what is seen through an opening 2.5 times as wide as gap_px stays (of narrower ones corners and ends close).
/// Pixels within reach of the picture's own border see too little around them and stay as they are.
/// source  the idea of P. Rosenthal and L. Linsen, "Image-space point cloud rendering", 2008; the criteria are ours
struct FillSettings {
    float gap_px = 0.0f;        // widest gap that is closed, at most kWidestGap; 0: off
    bool follow_splats = true;  // and no wider than the splats at its two sides

    static constexpr float kWidestGap = 16.0f;
    /// Rows beyond those wanted that decide what is filled.
    int reach_px() const;
};

}  // namespace strata
