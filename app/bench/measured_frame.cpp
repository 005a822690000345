#include "app/bench/measured_frame.h"

#include <algorithm>
#include <limits>

#include "core/error.h"

namespace strata {

double MeasuredFrame::pass_ms(std::string_view name) const {
    for (const auto& [row, ms] : report.pass_ms)
        if (row == name) return ms;
    return 0.0;
}

MeasuredFrame measure_frame(LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings, int runs) {
    MeasuredFrame frame{Image(settings.width, settings.height), std::vector<float>(size_t(settings.width) * settings.height), {}};
    Renderer renderer;
    std::vector<RenderReport> reports;
    for (int run = 0; run <= runs; ++run) {
        RenderReport report = renderer.render_frame(cloud, camera, settings, [&](const RenderedRows& rows) {
            const auto first = std::ptrdiff_t(rows.first_row) * settings.width;
            std::copy(rows.colors.begin(), rows.colors.end(), frame.image.pixels.begin() + first);
            std::copy(rows.depths.begin(), rows.depths.end(), frame.depths.begin() + first);
        });
        if (report.failures.count > 0) throw Error(ErrorKind::malformed, report.failures.first);
        if (run > 0) reports.push_back(std::move(report));
    }
    const auto median_of = [&](const auto& ms_of) {
        std::vector<double> values;
        for (const RenderReport& report : reports) values.push_back(ms_of(report));
        return median(std::move(values));
    };
    frame.report = reports.back();
    frame.report.frame_ms = median_of([](const RenderReport& report) { return report.frame_ms; });
    for (size_t pass = 0; pass < frame.report.pass_ms.size(); ++pass)
        frame.report.pass_ms[pass].second = median_of([&](const RenderReport& report) { return report.pass_ms.at(pass).second; });
    return frame;
}

RenderSettings bench_frame_settings(const BenchSettings& bench, const LayeredCloud& cloud) {
    RenderSettings settings;
    settings.width = bench.width;
    settings.height = bench.height;
    settings.color = find_color_channel(cloud.info(), "rgb");
    settings.edl.strength = 0.0f;
    settings.selection.point_budget = bench.points;
    settings.threads = bench.threads;
    settings.memory_bytes = bench.memory_bytes;
    return settings;
}

double psnr_of(const ImageDifference& difference) {
    return difference.psnr_db == kEqualPsnr ? std::numeric_limits<double>::infinity() : difference.psnr_db;
}

}  // namespace strata
