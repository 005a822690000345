#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Eye-dome lighting against its twin in double precision: views x strengths, names edl/VIEW/STRENGTH.
/// returns  nothing where settings.only asks for none of them, or where there is no OpenGL
std::optional<BenchSection> run_edl_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
