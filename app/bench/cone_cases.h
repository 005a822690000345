#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Cones through voxels, and few rays, against many rays: names cones/SCENE/TANGENT/METHOD.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_cone_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
