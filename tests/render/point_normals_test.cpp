#include "render/point_normals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/math/random.h"
#include "render/renderer.h"
#include "tests/support/test_cloud.h"

namespace strata {
namespace {

CloudInfo info_with_normals(ScalarType type, double scale = 1.0, double no_data = std::numeric_limits<double>::quiet_NaN()) {
    CloudInfo info;
    info.attributes.push_back({.name = "index", .description = "", .type = ScalarType::uint32});
    for (const std::string_view name : attribute_name::kNormal)
        info.attributes.push_back({.name = std::string(name), .description = "", .type = type, .scale = scale, .no_data = no_data});
    return info;
}

template <typename Scalar>
PointBatch batch_of(const CloudInfo& info, const std::vector<std::array<Scalar, 3>>& normals) {
    PointBatch batch;
    resize_batch(batch, normals.size(), info.attributes, std::vector<int>{1, 2, 3});
    for (size_t i = 0; i < normals.size(); ++i)
        for (size_t axis = 0; axis < 3; ++axis) std::memcpy(batch.columns[axis + 1].data() + i * sizeof(Scalar), &normals[i][axis], sizeof(Scalar));
    return batch;
}

// Half a step of 127 to each side of the two smaller numbers: at most 0.32 degrees.
TEST(PointNormals, DirectionsSurvivePacking) {
    const CloudInfo info = info_with_normals(ScalarType::float32);
    Random random(2);
    std::vector<std::array<float, 3>> normals;
    for (int i = 0; i < 10'000; ++i) normals.push_back({float(random.uniform(-1, 1)), float(random.uniform(-1, 1)), float(random.uniform(-1, 1))});
    const std::vector<PackedNormal> packed = PointNormals(info).read(batch_of(info, normals));
    for (size_t i = 0; i < normals.size(); ++i) {
        const Vec3d n(normals[i][0], normals[i][1], normals[i][2]), p(packed[i][0], packed[i][1], packed[i][2]);
        EXPECT_LT((n.normalized() - p.normalized()).norm(), 0.0056);
    }
}

TEST(PointNormals, WhatIsNoDirectionIsZero) {
    const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
    const CloudInfo info = info_with_normals(ScalarType::float32, 1.0, -9);
    const auto packed = PointNormals(info).read(batch_of<float>(info, {{0, 0, 0}, {nan, 0, 1}, {infinity, 1, 0}, {0, -9, 1}, {0, 0, -1e-30f}, {3e38f, 3e38f, 0}}));
    const std::vector<PackedNormal> expected = {{}, {}, {}, {}, {0, 0, -127}, {127, 127, 0}};
    EXPECT_EQ(packed, expected);
}

TEST(PointNormals, StoredIntegersAreScaled) {
    const CloudInfo info = info_with_normals(ScalarType::int16, -1.0 / 32767);
    EXPECT_EQ(PointNormals(info).read(batch_of<int16_t>(info, {{32767, 0, -32767}}))[0], (PackedNormal{-127, 0, 127}));
}

TEST(PointNormals, ACloudWithoutThemIsRefused) {
    CloudInfo info = info_with_normals(ScalarType::float32);
    info.attributes.pop_back();
    try {
        const PointNormals normals(info);
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        EXPECT_NE(std::string(error.what()).find("strata convert --normals"), std::string::npos);
    }
}

// Normals are read when surfels are asked for, once, and gone when they are not.
TEST(PointNormals, AreInMemoryForSurfelsOnly) {
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 900; ++i) quanta.emplace_back(i % 30, i / 30, 0);
    TestCloud cloud = single_node_cloud(quanta, {.scale = Vec3d::Constant(1), .offset = Vec3d::Zero()}, 1.0);
    Camera camera;
    camera.eye = {15, 15, 40};
    camera.view_from_world = look_along({0, 0, -1}, {0, 1, 0});
    fit_depth_range(camera, cloud.info().bounds);
    RenderSettings settings;
    settings.width = settings.height = 60;
    settings.color = find_color_channel(cloud.info(), "rgb");
    Renderer renderer;
    const auto bytes_with = [&](SplatShape shape) {
        settings.splat.shape = shape;
        renderer.render_frame(cloud, camera, settings, [](const RenderedRows&) {});
        return renderer.resident_bytes();
    };
    const uint64_t plain = bytes_with(SplatShape::gaussian);
    EXPECT_THROW(bytes_with(SplatShape::surfel), Error);
    EXPECT_EQ(bytes_with(SplatShape::disc), plain);
    cloud.cloud_info.attributes = info_with_normals(ScalarType::int8).attributes;
    cloud.cloud_info.attributes[0] = {.name = "rgb", .description = "", .type = ScalarType::uint16, .components = 3};
    EXPECT_EQ(bytes_with(SplatShape::surfel), plain + 3 * quanta.size());
    EXPECT_EQ(bytes_with(SplatShape::surfel), plain + 3 * quanta.size());
    EXPECT_EQ(bytes_with(SplatShape::paraboloid), plain);
}

}  // namespace
}  // namespace strata
