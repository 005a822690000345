#include "core/cloud/surface_estimate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/math/random.h"
#include "core/simulate/scan_cloud.h"
#include "core/simulate/scan_stream.h"

namespace strata {
namespace {

std::vector<SurfaceEstimate> estimates(const std::vector<Vec3i>& points, const Quantization& quantization,
                                       std::optional<Vec3d> viewpoint = {}, uint32_t k = 16, int threads = 1) {
    std::vector<TreePoint> numbered;
    for (const Vec3i& p : points) numbered.push_back({p, uint32_t(numbered.size())});
    const NeighborTree tree(std::move(numbered), quantization.scale);
    std::vector<SurfaceEstimate> result(points.size());
    for_each_neighborhood(tree, k, threads, [&](const TreePoint& point, const Neighborhood& neighbors) {
        result[point.index] = estimate_surface(neighbors, quantization, viewpoint);
    });
    return result;
}

double angle_between(const Vec3f& a, const Vec3d& b) { return std::atan2(a.cast<double>().cross(b).norm(), a.cast<double>().dot(b)); }

TEST(EstimateSurface, APlaneFarFromTheOrigin) {
    // World coordinates up to 6.4 * 10^6 m with millimetre detail: what a float of them would lose is 0.5 m.
    const Quantization quantization{Vec3d::Constant(0.001), Vec3d(5e6, -6.4e6, 1e6)};
    const Vec3d normal = Vec3d(0.3, -0.2, 0.9).normalized();
    Random random(1);
    std::vector<Vec3i> points;
    for (int i = 0; i < 20'000; ++i) {
        const double x = random.uniform(0.0, 1e4), y = random.uniform(0.0, 1e4);  // 10 m, 200 points/m^2
        points.push_back(Vec3i(int(x), int(y), int(std::lround(-(normal.x() * int(x) + normal.y() * int(y)) / normal.z()))) +
                         Vec3i::Constant(2'000'000'000));
    }
    std::vector<double> densities;
    for (const SurfaceEstimate& estimate : estimates(points, quantization)) {
        // Rounding by up to half a quantum: sigma 0.29 mm of z at r = 0.16 m, so 2 sigma / (r sqrt k) is 0.9 mrad.
        EXPECT_LT(angle_between(estimate.normal, normal), 0.008);
        EXPECT_NEAR(estimate.normal.norm(), 1.0f, 1e-6f);
        densities.push_back(double(estimate.density));
    }
    std::nth_element(densities.begin(), densities.begin() + 10'000, densities.end());
    const double expected = 20'000 / 100.0 * normal.z();
    EXPECT_NEAR(densities[10'000] / expected, 1.0, 0.1);  // (k - 1) / (k - 2) for random points, less at the edges
}

TEST(EstimateSurface, ASphereSeenFromInsideAndFromAbove) {
    const Quantization quantization{Vec3d::Constant(0.0001), Vec3d(100.0, 200.0, 300.0)};
    Random random(2);
    std::vector<Vec3i> points;
    std::vector<Vec3d> outward;
    for (int i = 0; i < 30'000; ++i) {
        outward.push_back(Vec3d(random.normal(), random.normal(), random.normal()).normalized());
        points.push_back((outward.back() * 1e5).cast<int32_t>());  // 10 m
    }
    // The fitted plane turns by about (distance of the mean from the point) / R; r = 10 m * sqrt(16 / 30,000 * 4) = 0.46 m.
    const std::vector<SurfaceEstimate> inside = estimates(points, quantization, Vec3d(100.0, 200.0, 300.0));
    const std::vector<SurfaceEstimate> up = estimates(points, quantization);
    for (size_t i = 0; i < points.size(); ++i) {
        EXPECT_LT(angle_between(inside[i].normal, -outward[i]), 0.05);
        EXPECT_GE(up[i].normal.z(), 0.0f);
        EXPECT_EQ(up[i].normal.cwiseAbs(), inside[i].normal.cwiseAbs());
    }
}

TEST(EstimateSurface, AWallLooksToOneSideWithoutAViewpoint) {
    std::vector<Vec3i> points;
    for (int y = 0; y < 30; ++y)
        for (int z = 0; z < 30; ++z) points.push_back({-40, 100 * y, 100 * z});
    for (const SurfaceEstimate& e : estimates(points, {})) EXPECT_EQ(e.normal, Vec3f(1, 0, 0));
    for (const SurfaceEstimate& e : estimates(points, {}, Vec3d(-9, 0, 0))) EXPECT_EQ(e.normal, Vec3f(-1, 0, 0));
    for (const SurfaceEstimate& e : estimates(points, {}, Vec3d(-0.04, 99, 0))) EXPECT_EQ(e.normal, Vec3f(1, 0, 0));  // in the wall
}

TEST(EstimateSurface, WhereThereIsNoSurface) {
    const auto expect_none = [](const std::vector<Vec3i>& points, float density) {
        for (const SurfaceEstimate& e : estimates(points, {})) {
            EXPECT_EQ(e.normal, Vec3f::Zero());
            for (int axis = 0; axis < 3; ++axis) EXPECT_FALSE(std::signbit(e.normal[axis]));
            EXPECT_FLOAT_EQ(e.density, density);
        }
    };
    expect_none({{5, 5, 5}}, 0.0f);
    expect_none({{0, 0, 0}, {0, 3000, 4000}}, float(1.0 / (M_PI * 25.0)));
    expect_none(std::vector<Vec3i>(500, Vec3i(1, 2, 3)), float(15.0 / (M_PI * 0.0005 * 0.0005)));  // half a quantum
    std::vector<Vec3i> line;
    for (int i = 0; i < 1000; ++i) line.push_back(Vec3i(30, 40, 0) * i);
    for (const SurfaceEstimate& e : estimates(line, {})) EXPECT_EQ(e.normal, Vec3f::Zero());
}

// A square lattice of unit density has 15 others within r: r is 2 or sqrt(5), whichever corner a tie leaves out.
TEST(EstimateSurface, DensityOfALattice) {
    std::vector<Vec3i> points;
    for (int x = 0; x < 40; ++x)
        for (int y = 0; y < 40; ++y) points.push_back({1000 * x, 1000 * y, 0});
    const std::vector<SurfaceEstimate> found = estimates(points, {});
    EXPECT_FLOAT_EQ(found[20 * 40 + 20].density, float(15.0 / (M_PI * 5.0)));  // 1 + 4 + 4 + 4 within 2; the 16th at sqrt(5)
    EXPECT_LT(found[0].density, found[20 * 40 + 20].density);                  // a corner sees a quarter
}

TEST(EstimateSurface, ThreadsDoNotShow) {
    Random random(3);
    std::vector<Vec3i> points;
    for (int i = 0; i < 50'000; ++i) points.push_back({int(random.uniform(0, 500)), int(random.uniform(0, 500)), int(random.uniform(0, 5))});
    const auto bits = [&](int threads) {
        std::vector<uint32_t> all;
        for (const SurfaceEstimate& e : estimates(points, {}, {}, 16, threads))
            for (const float value : {e.normal.x(), e.normal.y(), e.normal.z(), e.density}) all.push_back(std::bit_cast<uint32_t>(value));
        return all;
    };
    const std::vector<uint32_t> expected = bits(1);
    EXPECT_EQ(bits(2), expected);
    EXPECT_EQ(bits(7), expected);
}

// A simulated scan of a village against the scene's own normals, on what is smooth there: ground and buildings.
TEST(EstimateSurface, TheVillageAgainstItsTruth) {
    const VillageScene scene(1);
    const Survey survey(scene, {.points = 150'000, .noise = 0.0, .seed = 1, .mode = SurveyMode::airborne});
    std::vector<Vec3i> points;
    std::vector<ScanPoint> scanned;
    PointBatch batch;
    stream_scan(scene, survey, 2, [&](std::span<const ScanPoint> block) {
        fill_scan_batch(block, batch);
        for (size_t i = 0; i < batch.size; ++i) points.push_back({batch.x[i], batch.y[i], batch.z[i]});
        scanned.insert(scanned.end(), block.begin(), block.end());
    });
    const std::vector<SurfaceEstimate> found = estimates(points, scan_quantization());
    SceneProbe probe(scene);
    std::vector<double> errors;
    for (size_t i = 0; i < points.size(); i += 23) {
        const NearestPoint truth = probe.nearest_surface(scanned[i].position);
        if (truth.distance > 0.01 || truth.normal.z() < 0.2) continue;  // leaves, wires; walls may look either way
        errors.push_back(angle_between(found[i].normal, truth.normal));
    }
    ASSERT_GT(errors.size(), 2000u);
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.02);       // rad: rounding and the curvature of the ground
    EXPECT_LT(errors[errors.size() * 3 / 4], 0.10);   // the rest lies at eaves, curbs and stems
}

}  // namespace
}  // namespace strata
