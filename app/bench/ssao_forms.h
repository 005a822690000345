#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Ambient occlusion where its value is known in closed form: names ssao_forms/FORM.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_ssao_forms(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
