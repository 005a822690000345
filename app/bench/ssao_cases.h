#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Ambient occlusion of pictures against its twin in double precision and against rays cast through the true scene: views x
/// radii, names ssao/VIEW/RADIUS.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_ssao_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
