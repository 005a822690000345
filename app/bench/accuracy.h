#pragma once

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Measures how wrong pictures are, and what they cost. A comparison is a function in a list of accuracy.cpp; a way to draw points
/// is a row of splat_kinds.h.
/// throws  Error{usage}: no case's name contains settings.only
BenchReport run_accuracy(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
