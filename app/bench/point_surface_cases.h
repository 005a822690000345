#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Smooth surfaces of points against the true surface: shapes x noise x numbers of points, names points/SHAPE/NOISE/POINTS.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_point_surface_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
