#include "app/bench/normal_cases.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "core/cloud/surface_estimate.h"
#include "core/parallel.h"
#include "core/simulate/scan_cloud.h"
#include "core/simulate/scan_stream.h"

namespace strata {
namespace {

constexpr std::array kNoises = {0.0, 0.002, 0.005, 0.01, 0.02, 0.05};  // metres
constexpr std::array<uint32_t, 3> kNeighbors = {8, 16, 64};
constexpr uint64_t kMostPoints = 400'000;
constexpr size_t kSamples = 3000;  // points whose normals are compared
constexpr double kFlat = 0.01;     // radians and, of a neighborhood's radius, how far its surface may turn and rise
constexpr double kDegrees = 180.0 / std::numbers::pi;
// The length of a vector of two normal components that half of all are below: sqrt(2 ln 2) standard deviations.
constexpr double kMedianOfTwo = 1.17741;

std::string case_name(double noise, uint32_t k) {
    char text[48];
    std::snprintf(text, sizeof text, "normals/%g/%u", noise, k);
    return text;
}

std::vector<Vec3d> scan(const VillageScene& village, const BenchSettings& bench, double noise, std::vector<Part>* parts) {
    const Survey survey(village, {.points = std::min(bench.points, kMostPoints), .noise = noise, .seed = 1, .mode = SurveyMode::both});
    std::vector<Vec3d> positions;
    stream_scan(village, survey, bench.threads, [&](std::span<const ScanPoint> points) {
        for (const ScanPoint& point : points) {
            positions.push_back(point.position);
            if (parts != nullptr) parts->push_back(point.part);
        }
    });
    return positions;
}

NeighborTree tree_of(std::span<const Vec3d> positions) {
    const Vec3d scale = scan_quantization().scale;
    std::vector<TreePoint> points;
    for (size_t i = 0; i < positions.size(); ++i) {
        const Vec3d quanta = positions[i].cwiseQuotient(scale);
        points.push_back({Vec3i(int(std::lround(quanta.x())), int(std::lround(quanta.y())), int(std::lround(quanta.z()))), uint32_t(i)});
    }
    return NeighborTree(std::move(points), scale);
}

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
}

// What a sampled point's neighbors say.
struct Found {
    Vec3d normal = Vec3d::Zero();
    double radius = 0.0;
};

// The same pulses with every noise: point i is always on the same piece of surface.
class NormalCases {
public:
    NormalCases(BenchScene& scene, const BenchSettings& bench)
        : village_(scene.village()), bench_(bench), exact_(scan(village_, bench, 0.0, &parts_)) {
        truth_.resize(exact_.size() / stride() + 1);
        parallel_blocks(bench.threads, truth_.size(), 64, [&](size_t begin, size_t end) {
            SceneProbe probe(village_);
            for (size_t s = begin; s < end; ++s)
                if (s * stride() < exact_.size()) truth_[s] = probe.nearest_surface(exact_[s * stride()]).normal;
        });
    }

    BenchSection run() {
        BenchSection section{.name = "normals", .title = "Normals: noise and neighbors", .words = {}, .table = {}, .plots = {}};
        section.words =
            "Normals of a plane through each point's k nearest neighbors, as `convert --normals` computes them, against the true "
            "surface's: the angle between "
            "them, either side. The scan is the village with normal noise of a beam's range; leaves and wires, which are no surface, do "
            "not count. `flat` are the "
            "points around which the true surface turns by no more than 0.01 radians within the neighbors' radius. There the expected "
            "median is that "
            "of an error of 2σ/(r√k) around each of two axes, which is 1.18 times as large; r is the neighbors' radius, σ the noise across "
            "the surface "
            "and the rounding to 1 mm. `all` counts edges and corners too.";
        section.table.columns = {{"case", "case"},
                                 {"noise_m", "σ, m", 3},
                                 {"k", "k", 0},
                                 {"mega_per_s", "M points/s", 2},
                                 {"flat_points", "flat points", 0},
                                 {"flat_median_deg", "flat 50 %, °", 3},
                                 {"expected_deg", "expected 50 %, °", 3},
                                 {"flat_p90_deg", "flat 90 %, °", 3},
                                 {"all_median_deg", "all 50 %, °", 3},
                                 {"all_p90_deg", "all 90 %, °", 3}};
        Plot plot{"Error of normals on flat surfaces: lower is better", {"noise, m", true}, {"median angle, degrees", true}, {}};
        std::array<PlotSeries, kNeighbors.size()> measured, expected;
        for (const double noise : kNoises)
            for (size_t i = 0; i < kNeighbors.size(); ++i) {
                if (!bench_.wants(case_name(noise, kNeighbors[i]))) continue;
                const Vec2d median = add_row(section.table, noise, kNeighbors[i]);
                if (noise == 0.0) continue;  // no place on the axis
                measured[i].points.emplace_back(noise, median.x());
                expected[i].points.emplace_back(noise, median.y());
            }
        for (size_t i = 0; i < kNeighbors.size(); ++i) {
            if (measured[i].points.empty()) continue;
            measured[i].name = "k = " + std::to_string(kNeighbors[i]);
            expected[i].name = measured[i].name + ", 2σ/(r√k)";
            expected[i].expected = true;
            plot.series.push_back(std::move(measured[i]));
            plot.series.push_back(std::move(expected[i]));
        }
        if (!plot.series.empty()) section.plots.push_back({"noise", std::move(plot)});
        return section;
    }

private:
    size_t stride() const { return std::max<size_t>(exact_.size() / kSamples, 1); }

    // [samples] normals and radii by the k nearest of all points.  ms: what all points took
    std::vector<Found> find(std::span<const Vec3d> positions, uint32_t k, double& ms) const {
        const NeighborTree tree = tree_of(positions);
        const Quantization quantization{.scale = tree.scale(), .offset = Vec3d::Zero()};
        std::vector<Found> found(truth_.size());
        std::vector<SurfaceEstimate> all(positions.size());
        const auto start = std::chrono::steady_clock::now();
        for_each_neighborhood(tree, k, bench_.threads, [&](const TreePoint& point, const Neighborhood& neighbors) {
            all[point.index] = estimate_surface(neighbors, quantization, std::nullopt);
            if (point.index % stride() == 0) found[point.index / stride()].radius = std::sqrt(neighbors.radius_squared);
        });
        ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        for (size_t s = 0; s < found.size(); ++s)
            if (s * stride() < all.size()) found[s].normal = all[s * stride()].normal.cast<double>();
        return found;
    }

    bool is_surface(size_t sample) const {
        return sample * stride() < parts_.size() && parts_[sample * stride()] != Part::leaf && parts_[sample * stride()] != Part::wire;
    }

    // Whether the true surface is a plane as far as the neighbors of the exact points lie.
    const std::vector<char>& flat(uint32_t k) {
        std::vector<char>& flat = flat_[size_t(std::find(kNeighbors.begin(), kNeighbors.end(), k) - kNeighbors.begin())];
        if (!flat.empty()) return flat;
        flat.assign(truth_.size(), 0);
        double ms = 0.0;
        const std::vector<Found> found = find(exact_, k, ms);
        parallel_blocks(bench_.threads, truth_.size(), 64, [&](size_t begin, size_t end) {
            SceneProbe probe(village_);
            for (size_t s = begin; s < end; ++s) {
                if (!is_surface(s)) continue;
                const Vec3d normal = truth_[s], first = normal.unitOrthogonal(), second = normal.cross(first);
                flat[s] = 1;
                for (int direction = 0; direction < 8 && flat[s] != 0; ++direction) {
                    const double angle = 0.25 * std::numbers::pi * direction, reach = found[s].radius;
                    const NearestPoint there =
                        probe.nearest_surface(exact_[s * stride()] + reach * (std::cos(angle) * first + std::sin(angle) * second));
                    flat[s] = there.distance < kFlat * reach + 1e-6 && std::acos(std::min(1.0, there.normal.dot(normal))) < kFlat;
                }
            }
        });
        return flat;
    }

    // returns  median angle and the expected one of flat points, degrees
    Vec2d add_row(BenchTable& table, double noise, uint32_t k) {
        const std::vector<char>& is_flat = flat(k);
        if (noise_ != noise || noisy_.empty()) noisy_ = scan(village_, bench_, noise, nullptr);
        noise_ = noise;
        double ms = 0.0;
        const std::vector<Found> found = find(noisy_, k, ms);
        std::vector<double> angles, flat_angles, expected;
        const double rounding = scan_quantization().scale.x() / std::sqrt(12.0);
        for (size_t s = 0; s < found.size(); ++s) {
            if (!is_surface(s) || found[s].normal.isZero()) continue;
            const double angle = kDegrees * std::atan2(found[s].normal.cross(truth_[s]).norm(), std::abs(found[s].normal.dot(truth_[s])));
            angles.push_back(angle);
            if (is_flat[s] == 0) continue;
            flat_angles.push_back(angle);
            const Vec3d moved = noisy_[s * stride()] - exact_[s * stride()];  // along the beam
            const double across = moved.isZero() ? 0.0 : noise * std::abs(moved.normalized().dot(truth_[s]));
            expected.push_back(kDegrees * kMedianOfTwo * 2.0 * std::hypot(across, rounding) / (found[s].radius * std::sqrt(double(k))));
        }
        const Vec2d medians(quantile(flat_angles, 0.5), quantile(expected, 0.5));
        table.rows.push_back({case_name(noise, k), noise, double(k), 1e-3 * double(noisy_.size()) / ms, double(flat_angles.size()),
                              medians.x(), medians.y(), quantile(flat_angles, 0.9), quantile(angles, 0.5), quantile(angles, 0.9)});
        char text[128];
        std::snprintf(text, sizeof text, "%-32s %8.3f degrees, expected %.3f", case_name(noise, k).c_str(), medians.x(), medians.y());
        bench_.log(text);
        return medians;
    }

    const VillageScene& village_;
    const BenchSettings& bench_;
    std::vector<Part> parts_;           // of the points
    std::vector<Vec3d> exact_, noisy_;  // the points without noise, and with noise_
    double noise_ = 0.0;
    std::vector<Vec3d> truth_;  // [samples]
    std::array<std::vector<char>, kNeighbors.size()> flat_;
};

}  // namespace

std::optional<BenchSection> run_normal_cases(BenchScene& scene, const BenchSettings& settings) {
    for (const double noise : kNoises)
        for (const uint32_t k : kNeighbors)
            if (settings.wants(case_name(noise, k))) return NormalCases(scene, settings).run();
    return std::nullopt;
}

}  // namespace strata
