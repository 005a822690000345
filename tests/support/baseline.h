#pragma once

#include <string>
#include <vector>

namespace strata::test {

/// Runs `strata render` and expects the picture to be the one that is kept in tests/baselines, up to the two steps of 255 that a GPU's lighting
/// may differ by. One that is not, and its difference picture, are left beside the test program for whoever looks into it.
/// name   of the picture, without folder and ending
/// words  what to draw, and how; in 320 x 200 pixels unless they say otherwise
void expect_baseline(const std::string& name, std::vector<std::string> words);

}  // namespace strata::test
