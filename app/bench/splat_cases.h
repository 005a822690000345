#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Points against the reference picture and the true surface: views x splat kinds x error targets, names splats/VIEW/KIND/TARGET.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_splat_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
