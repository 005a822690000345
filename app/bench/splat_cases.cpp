#include "app/bench/splat_cases.h"

#include <chrono>
#include <cstdio>
#include <limits>
#include <optional>

#include "app/bench/measured_frame.h"
#include "app/bench/splat_kinds.h"
#include "app/bench/surface_truth.h"
#include "render/image_compare.h"
#include "render/reference/point_reference.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

constexpr double kErrorTargets[] = {0.5, 1, 2, 4, 8};  // pixels

// Mean distance of two pictures in OKLab, in hundredths: about 2 is just seen on large areas.
double oklab_difference(const Image& a, const Image& b) {
    const auto lab = [](Rgba8 color) {
        const auto& linear = linear_from_srgb8();
        return oklab_from_linear({linear[red_of(color)], linear[green_of(color)], linear[blue_of(color)]});
    };
    double sum = 0.0;
    for (size_t i = 0; i < a.pixels.size(); ++i) sum += (lab(a.pixels[i]) - lab(b.pixels[i])).norm();
    return 100.0 * sum / double(a.pixels.size());
}

// Points against the reference picture and the true surface.
class SplatCases {
public:
    SplatCases(BenchScene& scene, const BenchSettings& bench) : scene_(scene), bench_(bench) {
        section_.name = "splats";
        section_.title = "Points: error target and splat kind";
        section_.words =
            "Every case draws the same views without lighting, at an error target in pixels. `PSNR`, `SSIM` and `ΔE` (mean distance in OKLab, in "
            "hundredths) are taken against the reference picture: every point as a disc of its own radius, 16 samples a pixel in linear light, "
            "without levels of detail, in double precision (`render/reference/point_reference.h`); all three on 8-bit sRGB. `holes` and `bleed` compare "
            "depth with the scanned surface along each pixel's ray: pixels that show something behind it, or in front of it, by more than 0.5 m and "
            "the radius of a splat. `depth` is the distance from what a pixel shows to the nearest true surface. Leaves, wires and what no beam "
            "met do not count. The first row of a view is the reference itself.";
        section_.table.columns = {{"case", "case"}, {"view", "view"}, {"kind", "splat"}, {"target_px", "target, px", 1}, {"frame_ms", "frame, ms", 1},
                                  {"points_ms", "points, ms", 1}, {"points_drawn", "points drawn", 0}, {"psnr_db", "PSNR, dB", 2}, {"ssim", "SSIM", 4},
                                  {"delta_e", "ΔE", 2}, {"holes_percent", "holes, %", 3}, {"bleed_percent", "bleed, %", 3},
                                  {"depth_median_m", "depth 50 %, m", 4}, {"depth_p99_m", "depth 99 %, m", 3}};
    }

    std::optional<BenchSection> run() {
        for (const BenchView& view : kBenchViews) run_view(view);
        if (section_.table.rows.empty()) return std::nullopt;
        return std::move(section_);
    }

private:
    static std::string case_name(const BenchView& view, std::string_view kind, double target) {
        char text[16];
        std::snprintf(text, sizeof text, "%g", target);
        return "splats/" + std::string(view.name) + "/" + std::string(kind) + "/" + text;
    }

    void run_view(const BenchView& view) {
        bool wanted = false;
        for (const SplatKind& kind : kSplatKinds)
            for (const double target : kErrorTargets) wanted |= bench_.wants(case_name(view, kind.name, target));
        if (!wanted) return;
        const RenderSettings base = bench_frame_settings(bench_, scene_.cloud());
        const Camera camera = camera_of(view, scene_.cloud());
        if (!reference_) {
            const PointColorizer colors(scene_.cloud().info(), base.color, derive_range(scene_.cloud(), base.color));
            reference_.emplace(scene_.cloud(), colors, bench_.threads);
        }
        const auto start = std::chrono::steady_clock::now();
        const ReferencePicture best = reference_->draw(camera, bench_.width, bench_.height, base.background, bench_.threads);
        const double reference_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        const SurfaceTruth truth(scene_.village(), camera, bench_.width, bench_.height, [&](const Vec3d& p) { return reference_->reaches(p); },
                                 bench_.threads);
        add_row({.name = "splats/" + std::string(view.name) + "/reference", .view = view, .kind = "reference", .target = 0.0, .frame_ms = reference_ms,
                 .points_ms = kNothing, .points_drawn = double(reference_->size()), .image = best.image, .depths = best.depths}, best, truth);

        Plot plot{"View " + std::string(view.name) + ": up and left is better", {"frame, ms", true}, {"PSNR against the reference, dB"}, {}};
        for (const SplatKind& kind : kSplatKinds) {
            PlotSeries series{std::string(kind.name), {}};
            for (const double target : kErrorTargets) {
                const std::string name = case_name(view, kind.name, target);
                if (!bench_.wants(name)) continue;
                RenderSettings settings = base;
                settings.selection.error_px = target;
                kind.apply(settings);
                const MeasuredFrame frame = measure_frame(scene_.cloud(), camera, settings, bench_.runs);
                const double psnr = add_row({.name = name, .view = view, .kind = kind.name, .target = target, .frame_ms = frame.report.frame_ms,
                                             .points_ms = frame.pass_ms("points"), .points_drawn = double(frame.report.points_drawn),
                                             .image = frame.image, .depths = frame.depths}, best, truth);
                series.points.emplace_back(frame.report.frame_ms, psnr);
            }
            if (!series.points.empty()) plot.series.push_back(series);
        }
        section_.plots.push_back({std::string(view.name), plot});
    }

    struct Case {
        std::string name;
        const BenchView& view;
        std::string_view kind;
        double target, frame_ms, points_ms, points_drawn;
        const Image& image;
        const std::vector<float>& depths;
    };

    double add_row(const Case& c, const ReferencePicture& best, const SurfaceTruth& truth) {
        const ImageDifference difference = compare_images(c.image, best.image, bench_.threads);
        // A splat's radius is the distance of its points, which the target is; the view's middle stands for all its depths.
        const double pixel = 1.0 / pixels_per_unit(camera_of(c.view, scene_.cloud()), c.view.distance, bench_.height);
        const SurfaceError surface = truth.measure(c.depths, 0.5 + c.target * pixel, bench_.threads);
        section_.table.rows.push_back({c.name, std::string(c.view.name), std::string(c.kind), c.target, c.frame_ms, c.points_ms, c.points_drawn,
                                       psnr_of(difference), difference.ssim, oklab_difference(c.image, best.image), 100.0 * surface.hole_share,
                                       100.0 * surface.bleed_share, surface.depth_median, surface.depth_p99});
        char text[160];
        std::snprintf(text, sizeof text, "%-32s %8.1f ms %7.2f dB, holes %.3f %%, bleed %.3f %%", c.name.c_str(), c.frame_ms, psnr_of(difference),
                      100.0 * surface.hole_share, 100.0 * surface.bleed_share);
        bench_.log(text);
        return psnr_of(difference);
    }

    BenchScene& scene_;
    const BenchSettings& bench_;
    BenchSection section_;
    std::optional<PointReference> reference_;  // made when a case needs it
};

}  // namespace

std::optional<BenchSection> run_splat_cases(BenchScene& scene, const BenchSettings& settings) { return SplatCases(scene, settings).run(); }

}  // namespace strata
