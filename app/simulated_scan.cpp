#include "app/simulated_scan.h"

#include "core/simulate/scan_cloud.h"
#include "core/simulate/scan_stream.h"
#include "io/las/las_writer.h"

namespace strata {

uint64_t write_simulated_scan(const std::string& path, const VillageScene& scene, const SurveySettings& settings, int threads,
                              bool overwrite, Durability durability, const std::function<void(uint64_t points)>& on_progress) {
    LasWriter writer(path, {.quantization = scan_quantization(), .crs_wkt = std::string(scan_crs()), .attributes = scan_attributes(),
                            .system_identifier = "strata scan simulator", .generating_software = "strata sample",
                            .creation_day = 1, .creation_year = 2026, .overwrite = overwrite},
                     settings.points);
    const Survey survey(scene, settings);
    PointBatch batch;
    stream_scan(scene, survey, threads, [&](std::span<const ScanPoint> points) {
        fill_scan_batch(points, batch);
        writer.write(batch);
        if (on_progress) on_progress(writer.points());
    });
    const uint64_t bytes = writer.size_bytes();
    writer.finish(durability);
    return bytes;
}

}  // namespace strata
