#pragma once

#include <vector>

#include "app/bench/bench_scene.h"
#include "render/image_compare.h"
#include "render/renderer.h"

namespace strata {

/// A frame, whole, and what it took.
struct MeasuredFrame {
    Image image;
    std::vector<float> depths;
    RenderReport report;  // of the last run, but frame_ms and pass_ms are medians

    double pass_ms(std::string_view name) const;  // 0 where there is no such pass
};

/// Draws a frame once to warm up and then settings.runs times.
/// throws  Error{malformed}: a node could not be read
MeasuredFrame measure_frame(LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings, int runs);

/// Settings that benches start from: the scanned colors, no lighting, all points within the memory cap.
RenderSettings bench_frame_settings(const BenchSettings& bench, const LayeredCloud& cloud);

/// PSNR as a table shows it: infinite for equal pictures.
double psnr_of(const ImageDifference& difference);

}  // namespace strata
