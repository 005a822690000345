#include "app/bench/edl_cases.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/bench/measured_frame.h"
#include "core/error.h"
#include "render/image_compare.h"
#include "render/reference/edl_reference.h"

namespace strata {
namespace {

constexpr float kStrengths[] = {0.7f, 2.0f};

// The unlit frame, lit by the twin. Transparent pixels show where nothing was drawn.
Image light_by_twin(const MeasuredFrame& unlit, const RenderSettings& settings, const Camera& camera) {
    GBuffer buffer;
    buffer.width = settings.width;
    buffer.rows = settings.height;
    buffer.colors = unlit.image.pixels;
    buffer.depths = unlit.depths;
    const double near_size = 1.0 / pixels_per_unit(camera, 1.0, settings.height);
    const Vec2d pixel_world = camera.projection == Projection::perspective ? Vec2d(near_size, 0.0) : Vec2d(0.0, near_size);
    Image lit(settings.width, settings.height);
    for (uint32_t y = 0; y < settings.height; ++y)
        for (uint32_t x = 0; x < settings.width; ++x) {
            const Vec4d shaded = edl_shaded(buffer, settings.edl, pixel_world, settings.height, int(x), int(y));
            const auto code = [&](int channel) { return uint8_t(std::lround(shaded[channel])); };
            lit.at(x, y) = make_rgba(code(0), code(1), code(2), code(3));
        }
    return lit;
}

}  // namespace

std::optional<BenchSection> run_edl_cases(BenchScene& scene, const BenchSettings& bench) {
    BenchSection section{.name = "edl", .title = "Eye-dome lighting against double precision", .words = {}, .table = {}, .plots = {}};
    section.words =
        "The pass as pictures are lit by it, against its twin in double precision (`render/reference/edl_reference.h`) on the same depths, with "
        "neighbors at the three distances of the default radius. Differences are in 8-bit steps; a step is what rounding alone may give.";
    section.table.columns = {{"case", "case"}, {"edl_ms", "pass, ms", 2}, {"max_steps", "largest difference", 0}, {"rms_steps", "root mean square", 4},
                             {"psnr_db", "PSNR, dB", 1}};
    for (const BenchView& view : kBenchViews)
        for (const float strength : kStrengths) {
            char name[48];
            std::snprintf(name, sizeof name, "edl/%s/%g", std::string(view.name).c_str(), double(strength));
            if (!bench.wants(name)) continue;
            const Camera camera = camera_of(view, scene.cloud());
            RenderSettings settings = bench_frame_settings(bench, scene.cloud());
            settings.background = 0;
            settings.edl.follow_splats = false;
            const MeasuredFrame unlit = measure_frame(scene.cloud(), camera, settings, 1);
            settings.edl.strength = strength;
            try {
                const MeasuredFrame lit = measure_frame(scene.cloud(), camera, settings, bench.runs);
                const ImageDifference difference = compare_images(lit.image, light_by_twin(unlit, settings, camera), bench.threads);
                section.table.rows.push_back({std::string(name), lit.pass_ms("edl"), double(difference.max_channel), difference.rms, psnr_of(difference)});
            } catch (const Error& error) {
                if (error.kind != ErrorKind::device) throw;
                bench.log(std::string(name) + ": left out: " + error.what());
                return std::nullopt;
            }
            bench.log(name);
        }
    if (section.table.rows.empty()) return std::nullopt;
    return section;
}

}  // namespace strata
