#include "app/bench/point_surface_cases.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "app/bench/vertex_distances.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "core/surface/point_surface.h"

namespace strata {
namespace {

using std::numbers::pi;

constexpr double kRadius = 0.41, kRing = 0.29, kTube = 0.13;
constexpr size_t kPoints[] = {10'000, 40'000, 160'000};
constexpr double kNoise[] = {0.0, 0.002};  // standard deviation along the normal
constexpr double kReach = 3.0;             // of the radius, in what lies between points

struct Shape {
    const char* name;
    double area;
    Vec3d (*point)(Random& random, Vec3d& normal);
    double (*distance)(const Vec3d& p);
};

Vec3d point_of_sphere(Random& random, Vec3d& normal) {
    normal = Vec3d(random.normal(), random.normal(), random.normal()).normalized();
    return kRadius * normal;
}
double sphere(const Vec3d& p) { return p.norm() - kRadius; }
Vec3d point_of_torus(Random& random, Vec3d& normal) {
    double a = 0.0, b = 0.0;
    do {  // evenly over the area
        a = random.uniform(0.0, 2.0 * pi);
        b = random.uniform(0.0, 2.0 * pi);
    } while (random.uniform() * (kRing + kTube) > kRing + kTube * std::cos(b));
    normal = Vec3d(std::cos(b) * std::cos(a), std::cos(b) * std::sin(a), std::sin(b));
    return Vec3d(kRing * std::cos(a), kRing * std::sin(a), 0.0) + kTube * normal;
}
double torus(const Vec3d& p) { return std::hypot(std::hypot(p.x(), p.y()) - kRing, p.z()) - kTube; }

const Shape kShapes[] = {{"sphere", 4.0 * pi * kRadius * kRadius, point_of_sphere, sphere}, {"torus", 4.0 * pi * pi * kRing * kTube, point_of_torus, torus}};

/// Points without attributes.
class PlainPoints : public PointSource {
public:
    explicit PlainPoints(const std::vector<Vec3d>& places) {
        info_.format = "memory";
        info_.points = places.size();
        info_.quantization.scale = Vec3d::Constant(1e-8);
        for (const Vec3d& p : places) {
            points_.push_back((p / 1e-8).array().round().matrix().cast<int>());
            info_.bounds.extend(info_.quantization.world_from_quanta(points_.back()));
        }
    }
    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (points_.size() + kBatch - 1) / kBatch; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t begin = size_t(index) * kBatch, size = std::min(kBatch, points_.size() - begin);
        resize_batch(out, size, info_.attributes, wanted);
        for (size_t i = 0; i < size; ++i) {
            out.x[i] = points_[begin + i].x();
            out.y[i] = points_[begin + i].y();
            out.z[i] = points_[begin + i].z();
        }
    }

private:
    static constexpr size_t kBatch = 10'000;
    std::vector<Vec3i> points_;
    CloudInfo info_;
};

struct Measured {
    double ms = 0.0;
    uint64_t triangles = 0;
    VertexDistances off;
};

Measured measure(const Shape& shape, size_t count, double noise, double apart, const BenchSettings& bench) {
    Random random(17);
    std::vector<Vec3d> places(count);
    for (Vec3d& place : places) {
        Vec3d normal;
        place = shape.point(random, normal);
        place += noise * random.normal() * normal;
    }
    const PlainPoints points(places);
    Measured measured;
    ContourMesh mesh;
    std::vector<double> times;
    for (int run = 0; run < bench.runs; ++run) {
        const auto start = std::chrono::steady_clock::now();
        PointSurface field(points, points.info().bounds, {.spacing = apart, .radius = kReach * apart, .threads = bench.threads});
        ContourSettings settings;
        settings.inside = ContourInside::below;
        settings.open_at_nan = true;
        settings.threads = bench.threads;
        measured.triangles = contour_bricks(field, settings, mesh).triangles;
        times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    measured.ms = median(times);
    measured.off = distances_of_vertices(mesh, shape.distance);
    return measured;
}

}  // namespace

std::optional<BenchSection> run_point_surface_cases(BenchScene&, const BenchSettings& bench) {
    BenchSection section{.name = "points", .title = "Smooth surfaces of points: time against error", .words = {}, .table = {}, .plots = {}};
    section.words =
        "How far the vertices of smooth surfaces lie from the true one, a sphere of radius 0.41 and a torus of radii 0.29 and 0.13, of points that lie there by "
        "chance, with noise along the normal and without. Normals are fitted, and their sides chosen. The radius is three times what lies between points, samples "
        "are a third of it apart.";
    section.table.columns = {{"case", "case"},          {"radius", "radius", 5},       {"surface_ms", "surface, ms", 1}, {"triangles", "triangles", 0},
                             {"largest", "largest distance", 7}, {"rms", "root mean square", 7}, {"of_noise", "of the noise", 3}};
    Plot plot{"Distance of vertices from the surface: lower and further left is better", {"time, ms", true}, {"root mean square distance", true}, {}};
    for (const Shape& shape : kShapes)
        for (const double noise : kNoise) {
            PlotSeries series{.name = std::string(shape.name) + (noise > 0.0 ? ", noise" : ""), .points = {}};
            for (const size_t count : kPoints) {
                char name[64];
                std::snprintf(name, sizeof name, "points/%s/%g/%zu", shape.name, noise, count);
                if (!bench.wants(name)) continue;
                const double apart = std::sqrt(shape.area / double(count));
                const Measured measured = measure(shape, count, noise, apart, bench);
                const double of_noise = noise > 0.0 ? measured.off.rms / noise : std::numeric_limits<double>::quiet_NaN();
                section.table.rows.push_back({std::string(name), kReach * apart, measured.ms, double(measured.triangles), measured.off.largest, measured.off.rms, of_noise});
                series.points.emplace_back(measured.ms, measured.off.rms);
                bench.log(name);
            }
            if (!series.points.empty()) plot.series.push_back(std::move(series));
        }
    if (section.table.rows.empty()) return std::nullopt;
    section.plots.push_back({"error", std::move(plot)});
    return section;
}

}  // namespace strata
