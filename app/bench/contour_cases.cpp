#include "app/bench/contour_cases.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "app/bench/vertex_distances.h"
#include "core/parallel.h"
#include "core/surface/contour.h"

namespace strata {
namespace {

constexpr std::array<uint32_t, 5> kSamples = {17, 33, 65, 129, 257};  // an axis, over the unit cube
constexpr double kRadius = 0.41, kRing = 0.29, kTube = 0.13;
const Vec3d kCenter(0.503, 0.497, 0.511);
constexpr double kGyroidScale = 4.0 * std::numbers::pi;  // two periods

struct Shape {
    const char* name;
    double (*field)(const Vec3d&);
    double (*distance)(const Vec3d&);  // from the surface, of places near it
};

double sphere(const Vec3d& p) { return (p - kCenter).norm() - kRadius; }
double torus(const Vec3d& p) {
    const Vec3d q = p - kCenter;
    return std::hypot(std::hypot(q.x(), q.y()) - kRing, q.z()) - kTube;
}
double gyroid(const Vec3d& p) {
    const Vec3d q = kGyroidScale * p;
    return std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) + std::sin(q.z()) * std::cos(q.x());
}
Vec3d gyroid_slope(const Vec3d& p) {
    const Vec3d q = kGyroidScale * p;
    return kGyroidScale * Vec3d(std::cos(q.x()) * std::cos(q.y()) - std::sin(q.z()) * std::sin(q.x()),
                                std::cos(q.y()) * std::cos(q.z()) - std::sin(q.x()) * std::sin(q.y()),
                                std::cos(q.z()) * std::cos(q.x()) - std::sin(q.y()) * std::sin(q.z()));
}
// Newton along the slope; the way is the distance but for its square times a curvature.
double gyroid_distance(const Vec3d& p) {
    Vec3d foot = p;
    for (int step = 0; step < 6; ++step) {
        const Vec3d slope = gyroid_slope(foot);
        foot -= gyroid(foot) / slope.squaredNorm() * slope;
    }
    return (p - foot).norm();
}

constexpr Shape kShapes[] = {{"sphere", sphere, sphere}, {"torus", torus, torus}, {"gyroid", gyroid, gyroid_distance}};

struct Measured {
    double ms = 0.0;
    uint64_t triangles = 0;
    VertexDistances off;
};

Measured measure(const Shape& shape, uint32_t samples, const BenchSettings& bench) {
    const double cell = 1.0 / (samples - 1);
    ScalarGrid grid{
        .placement = {.origin = Vec3d::Zero(), .axes = cell * Mat3d::Identity()}, .size = {samples, samples, samples}, .values = {}};
    grid.values.resize(size_t(grid.samples()));
    parallel_blocks(bench.threads, samples, 1, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end; ++k)
            for (uint32_t j = 0; j < samples; ++j)
                for (uint32_t i = 0; i < samples; ++i)
                    grid.values[(k * samples + j) * samples + i] =
                        float(shape.field(grid.placement.world_from_index({double(i), double(j), double(k)})));
    });
    Measured measured;
    ContourMesh mesh;
    std::vector<double> times;
    for (int run = 0; run < bench.runs; ++run) {
        const auto start = std::chrono::steady_clock::now();
        measured.triangles = contour_grid(grid.placement, grid.size, grid.values,
                                          {.isovalues = {0.0}, .inside = ContourInside::below, .threads = bench.threads}, mesh)
                                 .triangles;
        times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    measured.ms = median(times);
    measured.off = distances_of_vertices(mesh, shape.distance);
    return measured;
}

}  // namespace

std::optional<BenchSection> run_contour_cases(BenchScene&, const BenchSettings& bench) {
    BenchSection section{.name = "contour", .title = "Isosurfaces: time against error", .words = {}, .table = {}, .plots = {}};
    section.words =
        "How far the vertices of marching cubes lie from the true surface, in units of the cube that holds it: of a sphere and a torus by "
        "exact distances, "
        "of a gyroid, whose field is no distance, by Newton's steps. The order says by which power of the cell the root mean square falls "
        "from one resolution "
        "to the next. Vertices on exact distances to a sphere of radius R lie within h²/8(R − h) of it, for cells of side h.";
    section.table.columns = {{"case", "case"},
                             {"cell", "cell", 5},
                             {"contour_ms", "contour, ms", 2},
                             {"triangles", "triangles", 0},
                             {"largest", "largest distance", 8},
                             {"bound", "bound", 8},
                             {"rms", "root mean square", 8},
                             {"order", "order", 2}};
    Plot plot{"Distance of vertices from the surface: lower and further left is better",
              {"time, ms", true},
              {"root mean square distance", true},
              {}};
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    for (const Shape& shape : kShapes) {
        PlotSeries series{.name = shape.name, .points = {}};
        double rms_before = kNone, cell_before = kNone;
        for (const uint32_t samples : kSamples) {
            char name[48];
            std::snprintf(name, sizeof name, "contour/%s/%u", shape.name, samples);
            if (!bench.wants(name)) continue;
            const Measured measured = measure(shape, samples, bench);
            const double cell = 1.0 / (samples - 1);
            const double bound = shape.field == sphere ? cell * cell / (8.0 * (kRadius - cell)) : kNone;
            const double order = std::log(rms_before / measured.off.rms) / std::log(cell_before / cell);
            section.table.rows.push_back(
                {std::string(name), cell, measured.ms, double(measured.triangles), measured.off.largest, bound, measured.off.rms, order});
            series.points.emplace_back(measured.ms, measured.off.rms);
            rms_before = measured.off.rms;
            cell_before = cell;
            bench.log(name);
        }
        if (!series.points.empty()) plot.series.push_back(std::move(series));
    }
    if (section.table.rows.empty()) return std::nullopt;
    section.plots.push_back({"error", std::move(plot)});
    return section;
}

}  // namespace strata
