#include "app/bench/accuracy.h"

#include "app/bench/cone_cases.h"
#include "app/bench/contour_cases.h"
#include "app/bench/edl_cases.h"
#include "app/bench/normal_cases.h"
#include "app/bench/point_surface_cases.h"
#include "app/bench/ssao_cases.h"
#include "app/bench/ssao_forms.h"
#include "app/bench/splat_cases.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr std::optional<BenchSection> (*kComparisons[])(BenchScene&, const BenchSettings&) = {run_splat_cases, run_edl_cases, run_ssao_cases, run_ssao_forms,
                                                                                                       run_normal_cases, run_cone_cases, run_contour_cases, run_point_surface_cases};

}  // namespace

BenchReport run_accuracy(BenchScene& scene, const BenchSettings& settings) {
    BenchReport report{"accuracy", "Accuracy", machine_words(settings) + "\n" + scene_words(settings), {}};
    for (const auto comparison : kComparisons)
        if (auto section = comparison(scene, settings)) report.sections.push_back(std::move(*section));
    if (report.sections.empty()) throw Error(ErrorKind::usage, "--only: no case's name contains '" + settings.only + "'");
    return report;
}

}  // namespace strata
