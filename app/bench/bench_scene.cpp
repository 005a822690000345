#include "app/bench/bench_scene.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <numbers>

#include "app/quantity_text.h"
#include "app/simulated_scan.h"
#include "core/error.h"
#include "core/octree/octree_builder.h"
#include "core/simulate/scan_cloud.h"
#include "io/format.h"
#include "io/potree/potree_writer.h"
#include "io/scratch_file.h"
#include "render/gl/egl_context.h"

namespace strata {
namespace {

constexpr uint64_t kSeed = 1;
constexpr double kNoise = 0.01;  // metres

// "model name" of the first processor.
std::string processor_name() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("model name")) return line.substr(std::min(line.find(':') + 2, line.size()));
    return "unknown processor";
}

std::string gl_renderer(int threads) {
    try {
        return EglContext(threads).renderer();
    } catch (const Error&) {
        return "none";
    }
}

}  // namespace

BenchScene::BenchScene(const std::string& folder, const BenchSettings& settings)
    : temporary_(folder + "/bench_scene", TemporaryPath::Kind::folder), village_(kSeed) {
    write_simulated_scan(las_path(), village_, {.points = settings.points, .noise = kNoise, .seed = kSeed, .mode = SurveyMode::both},
                         settings.threads, false, Durability::unsynced, {});
    convert(settings);
    convert(settings, normals_path(), true);
    cloud_ = open_layered(normals_path());
}

std::unique_ptr<LayeredCloud> BenchScene::reopen() const { return open_layered(plain_path()); }

void BenchScene::convert(const BenchSettings& settings, const std::string& path, bool normals) const {
    const std::string las = las_path();
    const std::unique_ptr<PointSource> source = open_points(std::span(&las, 1));
    const auto writer = make_potree_writer(path, {.overwrite = true, .durability = Durability::unsynced});
    const auto scratch = make_scratch_file(temporary_.path());
    BuildSettings building;
    building.threads = settings.threads;
    building.memory_bytes = settings.memory_bytes;
    if (normals) building.surface.emplace();
    build_octree(*source, building, scratch.get(), *writer);
}

Camera camera_of(const BenchView& view, const LayeredCloud& cloud) {
    const Vec3d church = scan_origin() + Vec3d(0.0, 12.0, 6.0);
    const Vec3d forward = Vec3d(-0.62, 0.62, -0.48).normalized();
    Camera camera;
    camera.view_from_world = look_along(forward, Vec3d::UnitZ());
    camera.eye = church - view.distance * forward;
    camera.fov_rad = 45.0 * std::numbers::pi / 180.0;
    fit_depth_range(camera, cloud.info().bounds);
    return camera;
}

std::string machine_words(const BenchSettings& settings) {
    utsname system{};
    ::uname(&system);
    const uint64_t memory = uint64_t(::sysconf(_SC_PHYS_PAGES)) * uint64_t(::sysconf(_SC_PAGESIZE));
    return "Machine: " + processor_name() + ", " + std::to_string(settings.threads) + " threads, " + size_text(memory) + ", " + system.sysname + " " +
           system.release + "; OpenGL: " + gl_renderer(settings.threads) + ".\n";
}

std::string scene_words(const BenchSettings& settings) {
    return "Scene: the simulated village, seed " + std::to_string(kSeed) + ", " + with_commas(settings.points) +
           " points from the air and from the ground, 1 cm of noise, as `strata sample --mode both` makes it. Times are medians of " +
           std::to_string(settings.runs) + " warm runs.";
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace strata
