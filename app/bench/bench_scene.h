#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/camera.h"
#include "core/octree/layered_cloud.h"
#include "core/simulate/scene.h"
#include "io/temporary_path.h"

namespace strata {

/// How a bench runs, as the user asked.
struct BenchSettings {
    uint64_t points = 2'000'000;
    uint32_t width = 640, height = 360;
    int runs = 5;  // of each timed step; the median counts
    int threads = 1;
    uint64_t memory_bytes = uint64_t{2} << 30;
    std::string only;                             // cases whose name contains it
    std::function<void(const std::string&)> log;  // gets a line for each case that is done

    bool wants(std::string_view name) const { return name.find(only) != std::string_view::npos; }
};

/// The simulated village, scanned from the air and the ground with 1 cm of noise, seed 1, as a LAS file and as
/// Potree folders without and with normals. All vanish with it.
class BenchScene {
public:
    /// folder  where the temporary files go
    BenchScene(const std::string& folder, const BenchSettings& settings);

    const VillageScene& village() const { return village_; }
    std::string las_path() const { return temporary_.path() + "/village.las"; }
    /// With normals, so that every splat kind can be drawn.
    LayeredCloud& cloud() { return *cloud_; }
    /// As users convert it, without normals.
    std::unique_ptr<LayeredCloud> reopen() const;

    /// Builds the Potree folder without normals from the LAS file again.
    void convert(const BenchSettings& settings) const { convert(settings, plain_path(), false); }

private:
    void convert(const BenchSettings& settings, const std::string& path, bool normals) const;
    std::string plain_path() const { return temporary_.path() + "/village"; }
    std::string normals_path() const { return temporary_.path() + "/village_normals"; }

    TemporaryPath temporary_;
    VillageScene village_;
    std::unique_ptr<LayeredCloud> cloud_;
};

/// A camera of the benches: it looks north-west and down at the church from so far.
struct BenchView {
    std::string_view name;
    double distance;  // metres
};
inline constexpr std::array<BenchView, 3> kBenchViews = {{{"far", 260.0}, {"middle", 90.0}, {"near", 30.0}}};

Camera camera_of(const BenchView& view, const LayeredCloud& cloud);

/// Markdown that says which machine this is: processor, threads, memory, system, GL renderer.
std::string machine_words(const BenchSettings& settings);
/// Markdown that says which scene it was.
std::string scene_words(const BenchSettings& settings);

double median(std::vector<double> values);

}  // namespace strata
