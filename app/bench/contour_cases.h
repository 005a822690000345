#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Vertices of marching cubes against the true surface: shapes x resolutions, names contour/SHAPE/SAMPLES.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_contour_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
