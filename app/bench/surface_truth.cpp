#include "app/bench/surface_truth.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/simulate/scan_cloud.h"
#include "render/gbuffer.h"

namespace strata {
namespace {

constexpr double kFarthest = 1e5;      // metres
constexpr double kWireRadius = 2.0;    // metres
constexpr size_t kDistanceStride = 3;  // pixels, both ways, between those whose distance to the surface is sought: it costs 20 µs

double quantile(std::vector<double>& values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
}

}  // namespace

SurfaceTruth::SurfaceTruth(const VillageScene& village, const Camera& camera, uint32_t width, uint32_t height,
                           const std::function<bool(const Vec3d&)>& scanned, int threads)
    : village_(&village), camera_(camera), width_(width), height_(height), pixels_(size_t(width) * height) {
    parallel_blocks(threads, pixels_.size(), 4096, [&](size_t begin, size_t end) {
        SceneProbe probe(village);
        BeamPath path;
        for (size_t i = begin; i < end; ++i) {
            const Ray ray = ray_of(i);
            probe.trace(ray, kFarthest, kWireRadius, path);
            if (path.leaf_count > 0 || path.wire_count > 0) continue;
            if (!path.hard.found()) {
                pixels_[i].kind = Pixel::Kind::sky;
                continue;
            }
            if (!scanned(ray.at(path.hard.distance) + scan_origin())) continue;
            const double forward = ray.direction.dot(camera.forward());
            pixels_[i] = {Pixel::Kind::surface, path.hard.distance * forward, std::abs(path.hard.normal.dot(ray.direction)) / forward};
        }
    });
}

Ray SurfaceTruth::ray_of(size_t pixel) const {
    const double x = double(pixel % width_) + 0.5 - 0.5 * width_, y = 0.5 * height_ - (double(pixel / width_) + 0.5);
    const Vec3d eye = camera_.eye - scan_origin();
    if (camera_.projection == Projection::orthographic) {
        const double unit = camera_.height / height_;
        return {eye + unit * (x * camera_.right() + y * camera_.up()), camera_.forward()};
    }
    const double unit = 2.0 * std::tan(0.5 * camera_.fov_rad) / height_;
    return {eye, (camera_.forward() + unit * (x * camera_.right() + y * camera_.up())).normalized()};
}

SurfaceError SurfaceTruth::measure(std::span<const float> depths, double tolerance, int threads) const {
    SurfaceError error;
    uint64_t sky = 0, holes = 0, bleeds = 0;
    for (size_t i = 0; i < pixels_.size(); ++i) {
        const Pixel& pixel = pixels_[i];
        const bool shown = depths[i] < kNoDepth;
        if (pixel.kind == Pixel::Kind::sky) {
            ++sky;
            bleeds += shown;
        } else if (pixel.kind == Pixel::Kind::surface) {
            ++error.pixels;
            const double behind = (double(depths[i]) - pixel.depth) * pixel.facing;
            holes += !shown || behind > tolerance;
            bleeds += shown && behind < -tolerance;
        }
    }
    error.hole_share = error.pixels > 0 ? double(holes) / double(error.pixels) : 0.0;
    error.bleed_share = error.pixels + sky > 0 ? double(bleeds) / double(error.pixels + sky) : 0.0;

    std::vector<std::vector<double>> row_distances(height_ / kDistanceStride + 1);
    parallel_blocks(threads, row_distances.size(), 4, [&](size_t begin, size_t end) {
        SceneProbe probe(*village_);
        for (size_t row = begin; row < end; ++row)
            for (size_t column = 0; column < width_ && row * kDistanceStride < height_; column += kDistanceStride) {
                const size_t i = row * kDistanceStride * width_ + column;
                if (pixels_[i].kind != Pixel::Kind::surface || !(depths[i] < kNoDepth)) continue;
                const Ray ray = ray_of(i);
                const Vec3d shown = ray.at(double(depths[i]) / ray.direction.dot(camera_.forward()));
                row_distances[row].push_back(probe.nearest_surface(shown).distance);
            }
    });
    std::vector<double> distances;
    for (const std::vector<double>& row : row_distances) distances.insert(distances.end(), row.begin(), row.end());
    error.depth_median = quantile(distances, 0.5);
    error.depth_p99 = quantile(distances, 0.99);
    return error;
}

}  // namespace strata
