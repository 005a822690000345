#include "app/bench/ssao_forms.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/parallel.h"
#include "render/pass/ssao_kernel.h"
#include "render/reference/ssao_reference.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 480, kHeight = 360;
constexpr double kPixel = 0.1, kEyeHeight = 50.0;  // world units
constexpr double kRadius = 60.0;                   // more than the picture is wide; the pass looks no farther than 128 pixels, or 12.8
constexpr double kNotCounted = std::numeric_limits<double>::quiet_NaN();
constexpr int kSlices = 24;  // of the twin

// A height field seen from above, in orthographic projection; x and y in world units from the picture's middle.
struct Form {
    std::string_view name, says, formula;
    double (*height)(double x, double y);
    double (*visibility)(double x, double y);  // NaN: does not count
};

constexpr double kWall = 1.0, kDome = 3.0, kBall = 2.0, kBallHeight = 4.0;

constexpr Form kForms[] = {
    {"plane", "open plane that rises by 1 in 2", "1", [](double x, double) { return 0.5 * x; },
     [](double x, double y) { return std::hypot(x, y) < 16.0 ? 1.0 : kNotCounted; }},
    {"wall", "floor beside a long wall of height 1", "(1 + x/√(x² + h²))/2", [](double x, double) { return x > 0.0 ? kWall : 0.0; },
     [](double x, double y) { return x < -0.4 && x > -6.0 && std::abs(y) < 8.0 ? 0.5 * (1.0 - x / std::hypot(x, kWall)) : kNotCounted; }},
    // J. Snyder, "Area light sources for real-time graphics", 1996: a sphere whose center lies on the horizon.
    {"dome", "floor around half a sphere of radius 3", "1 − (atan(1/√(H² − 1)) − √(H² − 1)/H²)/π; H = d/R",
     [](double x, double y) { return std::sqrt(std::max(kDome * kDome - x * x - y * y, 0.0)); },
     [](double x, double y) {
         const double far = std::hypot(x, y) / kDome, root = std::sqrt(far * far - 1.0);
         return far > 1.1 && far < 3.5 ? 1.0 - (std::atan(1.0 / root) - root / (far * far)) / std::numbers::pi : kNotCounted;
     }},
    {"sphere", "floor 4 below a sphere of radius 2", "1 − (R/d)² cos θ",
     [](double x, double y) {
         const double square = kBall * kBall - x * x - y * y;
         return square > 0.0 ? kBallHeight + std::sqrt(square) : 0.0;
     },
     [](double x, double y) {
         const double aside = std::hypot(x, y), d = std::hypot(aside, kBallHeight);
         return aside > 1.1 * kBall && aside < 10.0 ? 1.0 - kBall * kBall / (d * d) * kBallHeight / d : kNotCounted;
     }},
};

struct Difference {
    double sum = 0.0, worst = 0.0;
    void add(double difference) {
        sum += difference;
        worst = std::max(worst, std::abs(difference));
    }
};

void add_row(BenchTable& table, const Form& form, const std::string& name, int threads) {
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = kPixel * kHeight;
    GBuffer gbuffer{.width = kWidth, .rows = kHeight};
    std::vector<double> truth;
    for (uint32_t row = 0; row < kHeight; ++row)
        for (uint32_t column = 0; column < kWidth; ++column) {
            const double x = kPixel * (column + 0.5 - 0.5 * kWidth), y = kPixel * (row + 0.5 - 0.5 * kHeight);
            gbuffer.depths.push_back(float(kEyeHeight - form.height(x, y)));
            truth.push_back(form.visibility(x, y));
        }
    gbuffer.colors.assign(truth.size(), make_rgba(255, 255, 255));
    gbuffer.splat_px.assign(truth.size(), 1);
    GBuffer lit = gbuffer;
    SsaoKernel().shade(lit, {.radius = float(kRadius)}, camera, kHeight, threads);

    std::vector<size_t> places;  // every seventh pixel both ways
    for (uint32_t row = 3; row < kHeight; row += 7)
        for (uint32_t column = 3; column < kWidth; column += 7)
            if (const size_t i = size_t(row) * kWidth + column; std::isfinite(truth[i])) places.push_back(i);
    std::vector<double> twin(places.size());
    parallel_blocks(threads, places.size(), 16, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            twin[i] = visibility_reference(gbuffer, camera, kHeight, kRadius, int(places[i] % kWidth), int(places[i] / kWidth), kSlices);
    });
    double least = 1.0;
    Difference of_pass, of_twin;
    for (size_t i = 0; i < places.size(); ++i) {
        least = std::min(least, truth[places[i]]);
        of_pass.add(linear_from_srgb(red_of(lit.colors[places[i]]) / 255.0) - truth[places[i]]);
        of_twin.add(twin[i] - truth[places[i]]);
    }
    const double count = double(places.size());
    table.rows.push_back({name, std::string(form.says), std::string(form.formula), count, least, of_pass.sum / count, of_pass.worst,
                          of_twin.sum / count, of_twin.worst});
}

}  // namespace

std::optional<BenchSection> run_ssao_forms(BenchScene&, const BenchSettings& bench) {
    BenchSection section{.name = "ssao_forms", .title = "Ambient occlusion: closed forms", .words = {}, .table = {}, .plots = {}};
    section.words =
        "Depths of plain bodies, seen from above in orthographic projection, and visibility that is known. Differences are to the closed "
        "form, the mean and "
        "the largest; below 0 is too dark. What a depth buffer shows is taken as solid away from the eye, so a floor is too dark around a "
        "sphere that hangs "
        "above it: that is the method's, not the pass's, and its twin has it too.";
    section.table.columns = {{"case", "case"},
                             {"body", "body"},
                             {"visibility", "visibility"},
                             {"pixels", "pixels", 0},
                             {"least", "least", 3},
                             {"pass_bias", "pass, mean Δ", 4},
                             {"pass_worst", "pass, worst", 3},
                             {"twin_bias", "twin, mean Δ", 4},
                             {"twin_worst", "twin, worst", 3}};
    for (const Form& form : kForms) {
        const std::string name = "ssao_forms/" + std::string(form.name);
        if (!bench.wants(name)) continue;
        add_row(section.table, form, name, bench.threads);
        bench.log(name);
    }
    if (section.table.rows.empty()) return std::nullopt;
    return section;
}

}  // namespace strata
