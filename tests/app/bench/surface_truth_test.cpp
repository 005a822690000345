#include "app/bench/surface_truth.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/simulate/scan_cloud.h"
#include "render/gbuffer.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 48, kHeight = 27;

// Looks down at the village's roads and roofs.
Camera camera_above() {
    Camera camera;
    camera.eye = scan_origin() + Vec3d(40, -60, 60);
    camera.view_from_world = look_along(Vec3d(-40, 60, -60), Vec3d::UnitZ());
    return camera;
}

// Depths by rays cast here, whatever the picture under test does.
std::vector<float> true_depths(const VillageScene& village, const Camera& camera) {
    SceneProbe probe(village);
    BeamPath path;
    std::vector<float> depths;
    const double unit = 2.0 * std::tan(0.5 * camera.fov_rad) / kHeight;
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const Vec3d in_view((x + 0.5 - 0.5 * kWidth) * unit, (0.5 * kHeight - y - 0.5) * unit, -1.0);
            probe.trace({camera.eye - scan_origin(), (camera.view_from_world.transpose() * in_view).normalized()}, 1e5, 0.0, path);
            depths.push_back(path.hard.found() ? float(path.hard.distance / in_view.norm()) : kNoDepth);
        }
    return depths;
}

class SurfaceTruthTest : public testing::Test {
protected:
    const VillageScene village_{1};
    const Camera camera_ = camera_above();
    const SurfaceTruth truth_{village_, camera_, kWidth, kHeight, [](const Vec3d&) { return true; }, 2};
    std::vector<float> depths_ = true_depths(village_, camera_);
};

TEST_F(SurfaceTruthTest, TheTruthHasNoError) {
    const SurfaceError error = truth_.measure(depths_, 0.01, 2);
    EXPECT_GT(error.pixels, kWidth * kHeight / 4u);
    EXPECT_EQ(error.hole_share, 0.0);
    EXPECT_EQ(error.bleed_share, 0.0);
    EXPECT_LT(error.depth_p99, 1e-4);  // floats of 100 m
}

TEST_F(SurfaceTruthTest, MissingAndFartherPixelsAreHoles) {
    std::vector<float> half = depths_, all = depths_;
    for (size_t i = 0; i < half.size(); ++i) {
        if (i % 2 == 0) half[i] = i % 4 == 0 ? kNoDepth : half[i] + 50.0f;
        all[i] = kNoDepth;
    }
    EXPECT_NEAR(truth_.measure(half, 0.5, 2).hole_share, 0.5, 0.1);  // pixels that do not count fall on both halves
    EXPECT_EQ(truth_.measure(half, 0.5, 2).bleed_share, 0.0);
    EXPECT_EQ(truth_.measure(all, 0.5, 2).hole_share, 1.0);
    EXPECT_TRUE(std::isnan(truth_.measure(all, 0.5, 2).depth_median));
}

TEST_F(SurfaceTruthTest, NearerPixelsAreBleed) {
    for (float& depth : depths_) depth = 1.0f;
    EXPECT_EQ(truth_.measure(depths_, 0.5, 2).bleed_share, 1.0);
    EXPECT_GT(truth_.measure(depths_, 0.5, 2).depth_median, 10.0);
}

TEST_F(SurfaceTruthTest, WhatWasNotScannedDoesNotCount) {
    const SurfaceTruth unseen(village_, camera_, kWidth, kHeight, [](const Vec3d&) { return false; }, 2);
    const SurfaceError error = unseen.measure(std::vector<float>(depths_.size(), kNoDepth), 0.5, 2);
    EXPECT_EQ(error.pixels, 0u);
    EXPECT_EQ(error.hole_share, 0.0);
}

}  // namespace
}  // namespace strata
