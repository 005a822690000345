#include "app/bench/ssao_cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "app/bench/measured_frame.h"
#include "core/math/random.h"
#include "core/parallel.h"
#include "core/simulate/scan_cloud.h"
#include "render/reference/ssao_reference.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr std::array kRadii = {0.5, 1.0, 2.0, 4.0};  // metres
constexpr uint32_t kStride = 14;                     // pixels, both ways, between those that are compared
constexpr int kRaysSide = 12;                        // of a square of rays over the hemisphere
constexpr double kFarthest = 100.0;                  // metres; what occludes the sky is nearer
constexpr double kSameSurface = 0.2;                 // metres between what is shown and what is there
constexpr double kLeafShare = 0.575;                 // of a beam, that a leaf takes in the mean
constexpr int kSlices = 24;                          // of the twin

std::string case_name(const BenchView& view, double radius) {
    char text[48];
    std::snprintf(text, sizeof text, "ssao/%s/%g", std::string(view.name).c_str(), radius);
    return text;
}

// How much an occluder at that distance counts: as in the pass.
double falloff(double distance, double radius) {
    const double share = distance / radius;
    return std::clamp((1.0 - share * share) / (1.0 - 0.36), 0.0, 1.0);
}

// What a place sees of a white sky, weighted by the cosine.
struct Visibility {
    std::array<double, kRadii.size()> within = {};  // past what lies within each radius
    double sky = 0.0;                               // past all there is
};

// By rays that are strewn evenly over squares of equal weight.
Visibility cast_visibility(SceneProbe& probe, const Vec3d& place, const Vec3d& normal, Random& random) {
    Visibility sum;
    BeamPath path;
    const Vec3d side = normal.unitOrthogonal(), other = normal.cross(side);
    for (int i = 0; i < kRaysSide * kRaysSide; ++i) {
        const double u = (i % kRaysSide + random.uniform()) / kRaysSide, v = (i / kRaysSide + random.uniform()) / kRaysSide;
        const double from_axis = std::sqrt(u), angle = 2.0 * std::numbers::pi * v;
        const Ray ray{place + 1e-3 * normal, from_axis * (std::cos(angle) * side + std::sin(angle) * other) + std::sqrt(1.0 - u) * normal};
        probe.trace(ray, kFarthest, 0.0, path);
        std::array<double, kRadii.size()> open;
        open.fill(1.0);
        double sky = 1.0;
        const auto occlude = [&](double distance, double share) {
            for (size_t r = 0; r < kRadii.size(); ++r) open[r] *= 1.0 - share * falloff(distance, kRadii[r]);
            sky *= 1.0 - share;
        };
        if (path.hard.found()) occlude(path.hard.distance, 1.0);
        for (size_t l = 0; l < path.leaf_count; ++l) {
            const LeafSpan& span = path.leaves[l];
            for (double t = span.enter;;) {  // Woodcock's tracking, as beams meet leaves
                t -= std::log(1.0 - random.uniform()) / Crown::kDensest;
                if (t >= span.leave) break;
                if (span.crown->leaves_at(ray.at(t), random.uniform())) occlude(t, kLeafShare);
            }
        }
        for (size_t r = 0; r < kRadii.size(); ++r) sum.within[r] += open[r];
        sum.sky += sky;
    }
    for (double& within : sum.within) within /= kRaysSide * kRaysSide;
    sum.sky /= kRaysSide * kRaysSide;
    return sum;
}

// A pixel that shows the surface it should, and what that surface sees in truth.
struct TruePixel {
    uint32_t x, y;
    Visibility visibility;
};

std::vector<TruePixel> cast_pixels(const VillageScene& village, const Camera& camera, const MeasuredFrame& frame, int threads) {
    const uint32_t width = frame.image.width, height = frame.image.height;
    std::vector<std::vector<TruePixel>> rows(height / kStride);
    parallel_blocks(threads, rows.size(), 1, [&](size_t begin, size_t end) {
        SceneProbe probe(village);
        BeamPath path;
        const double unit = 1.0 / pixels_per_unit(camera, 1.0, height);
        for (size_t row = begin; row < end; ++row)
            for (uint32_t x = kStride / 2; x < width; x += kStride) {
                const uint32_t y = uint32_t(row) * kStride + kStride / 2;
                const Vec3d in_view((x + 0.5 - 0.5 * width) * unit, (0.5 * height - y - 0.5) * unit, -1.0);
                const Ray ray{camera.eye - scan_origin(), (camera.view_from_world.transpose() * in_view).normalized()};
                probe.trace(ray, 1e5, 0.0, path);
                if (path.leaf_count > 0 || path.wire_count > 0 || !path.hard.found()) continue;
                const double depth = path.hard.distance / in_view.norm();
                const double facing = std::abs(path.hard.normal.dot(ray.direction));
                if (!(std::abs(double(frame.depths[size_t(y) * width + x]) - depth) * facing < kSameSurface)) continue;
                Random random(mix_bits(uint64_t{y} * width + x));
                const Vec3d place = ray.at(path.hard.distance), normal = path.hard.normal;
                rows[row].push_back({x, y, cast_visibility(probe, place, normal, random)});
            }
    });
    std::vector<TruePixel> pixels;
    for (const auto& row : rows) pixels.insert(pixels.end(), row.begin(), row.end());
    return pixels;
}

// Every point is white, so that a lit picture is visibility.
RenderSettings white_settings(const BenchSettings& bench, const LayeredCloud& cloud) {
    RenderSettings settings = bench_frame_settings(bench, cloud);
    settings.color = find_color_channel(cloud.info(), "elevation");
    settings.colormap = "gray";
    settings.range = ColorRange{-2e9, -1e9};
    return settings;
}

}  // namespace

std::optional<BenchSection> run_ssao_cases(BenchScene& scene, const BenchSettings& bench) {
    BenchSection section{.name = "ssao", .title = "Ambient occlusion: radius", .words = {}, .table = {}, .plots = {}};
    section.words =
        "The pass on white points at an error of 1 px, so that a picture is visibility, 0 to 1. `twin` is the same integral in double "
        "precision on the same "
        "depths (`render/reference/ssao_reference.h`): every pixel of 24 lines, and with every bump of the splats, which the pass smooths "
        "away. `truth` is "
        "ambient occlusion by 144 rays from each true surface that a pixel shows, weighted by the cosine, with occluders fading between "
        "0.6 and 1 of the "
        "radius as in the pass; its own error is about 0.02. `no pass` is how far white is from that. `sky` is what those rays see of the "
        "sky past all there "
        "is within 100 m. Mean differences are picture less truth: below 0 is too dark. Every 14th pixel in both directions counts that "
        "shows the true "
        "surface to within 0.2 m and sees it past neither leaves nor wires.";
    section.table.columns = {{"case", "case"},
                             {"view", "view"},
                             {"radius_m", "radius, m", 1},
                             {"ssao_ms", "pass, ms", 2},
                             {"pixels", "pixels", 0},
                             {"twin_mean", "twin, mean |Δ|", 4},
                             {"twin_rms", "twin to truth, rms Δ", 4},
                             {"truth_bias", "truth, mean Δ", 4},
                             {"truth_rms", "truth, rms Δ", 4},
                             {"unlit_rms", "no pass, rms Δ", 4},
                             {"sky_bias", "sky, mean Δ", 4}};
    Plot error{"Ambient occlusion against rays: lower is better", {"radius, m", true}, {"rms difference of visibility"}, {}};
    Plot time{"Ambient occlusion: what a radius costs", {"radius, m", true}, {"pass, ms"}, {}};
    for (const BenchView& view : kBenchViews) {
        std::vector<TruePixel> pixels;
        GBuffer depths;
        PlotSeries errors{.name = std::string(view.name), .points = {}}, times = errors;
        for (size_t r = 0; r < kRadii.size(); ++r) {
            const std::string name = case_name(view, kRadii[r]);
            if (!bench.wants(name)) continue;
            const Camera camera = camera_of(view, scene.cloud());
            RenderSettings settings = white_settings(bench, scene.cloud());
            if (depths.depths.empty()) {
                const MeasuredFrame unlit = measure_frame(scene.cloud(), camera, settings, 1);
                pixels = cast_pixels(scene.village(), camera, unlit, bench.threads);
                depths.width = settings.width;
                depths.rows = settings.height;
                depths.depths = unlit.depths;
            }
            settings.ssao.radius = float(kRadii[r]);
            const MeasuredFrame lit = measure_frame(scene.cloud(), camera, settings, bench.runs);
            std::vector<double> twin(pixels.size());
            parallel_blocks(bench.threads, pixels.size(), 16, [&](size_t begin, size_t end) {
                for (size_t i = begin; i < end; ++i)
                    twin[i] = visibility_reference(depths, camera, settings.height, kRadii[r], int(pixels[i].x), int(pixels[i].y), kSlices);
            });
            double bias = 0.0, squares = 0.0, unlit_squares = 0.0, sky = 0.0, from_twin = 0.0, twin_squares = 0.0;
            for (size_t i = 0; i < pixels.size(); ++i) {
                const double seen = linear_from_srgb(red_of(lit.image.at(pixels[i].x, pixels[i].y)) / 255.0),
                             truth = pixels[i].visibility.within[r];
                bias += seen - truth;
                squares += (seen - truth) * (seen - truth);
                unlit_squares += (1.0 - truth) * (1.0 - truth);
                sky += seen - pixels[i].visibility.sky;
                from_twin += std::abs(seen - twin[i]);
                twin_squares += (twin[i] - truth) * (twin[i] - truth);
            }
            const double count = double(pixels.size()), rms = std::sqrt(squares / count);
            section.table.rows.push_back({name, std::string(view.name), kRadii[r], lit.pass_ms("ssao"), count, from_twin / count,
                                          std::sqrt(twin_squares / count), bias / count, rms, std::sqrt(unlit_squares / count),
                                          sky / count});
            errors.points.emplace_back(kRadii[r], rms);
            times.points.emplace_back(kRadii[r], lit.pass_ms("ssao"));
            char text[128];
            std::snprintf(text, sizeof text, "%-32s %8.2f ms, truth: mean %+.4f, rms %.4f", name.c_str(), lit.pass_ms("ssao"), bias / count,
                          rms);
            bench.log(text);
        }
        if (errors.points.empty()) continue;
        error.series.push_back(std::move(errors));
        time.series.push_back(std::move(times));
    }
    if (section.table.rows.empty()) return std::nullopt;
    section.plots = {{"error", std::move(error)}, {"time", std::move(time)}};
    return section;
}

}  // namespace strata
