#pragma once

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Times the steps from file to picture, pictures at settings' size. A step is a row of a table in speed.cpp.
/// throws  Error{usage}: no case's name contains settings.only
BenchReport run_speed(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
