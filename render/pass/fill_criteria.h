#pragma once

namespace strata {

/// What makes a gap, for the pass, its twin and fill.frag (which repeats them). "Splats" are diameters in pixels, depths count in what a
/// pixel covers there.
namespace fill_criteria {

struct Line {
    int x, y;
    float length;
};
inline constexpr int kLines = 8;
inline constexpr Line kLine[kLines] = {{1, 0, 1.0f},          {0, 1, 1.0f},           {1, 1, 1.41421356f},  {-1, 1, 1.41421356f},
                                       {2, 1, 2.23606798f},   {-1, 2, 2.23606798f},   {-2, 1, 2.23606798f}, {1, 2, 2.23606798f}};
inline constexpr int kLeastLines = 5;      // a corner of 90 degrees shows both its sides on 4 lines at most

inline constexpr float kSlantedGap = 1.8125f;  // a gap's width along the flattest of the 5 lines that cross it best
inline constexpr float kLeastGap = 2.25f;   // along a line; a pixel of the longest
inline constexpr float kHoleDepth = 3.0f;   // what lies so many splats behind its surroundings is seen through a hole
inline constexpr float kHoleSlope = 2.0f;   // and so much more for each pixel of distance: a ditch is no hole
inline constexpr float kSameDepth = 2.0f;   // splats that two samples of a surface may differ by; and
inline constexpr float kSteepest = 8.0f;    // for each pixel between them
inline constexpr float kSupport = 0.4f;     // splats behind its rim a side must still be there, at most
inline constexpr float kMostSupport = 8.0f; // pixels
inline constexpr float kRimWeight = 0.25f;  // in the plane, of a splat's rim, which may lie behind the surface
inline constexpr float kRough = 0.5f;       // splats that sides may lie off their plane; and
inline constexpr float kRoughSlope = 0.25f; // for each unit of its slope

}  // namespace fill_criteria
}  // namespace strata
