#include "render/point_color.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "core/error.h"
#include "render/colormap.h"

namespace strata {
namespace {

CloudInfo lidar_info() {
    CloudInfo info;
    info.quantization = {.scale = Vec3d::Constant(0.01), .offset = Vec3d(0, 0, 100)};
    info.attributes = {{"intensity", "", ScalarType::uint16},       {"classification", "", ScalarType::uint8},
                       {"rgb", "", ScalarType::uint16, 3},          {"curvature", "", ScalarType::float32, 1, 2.0, 1.0},
                       {"return number", "", ScalarType::uint8},    {"normal", "", ScalarType::float32, 3}};
    return info;
}

PointBatch batch_of(const CloudInfo& info, const std::vector<int>& wanted, size_t size) {
    PointBatch batch;
    resize_batch(batch, size, info.attributes, wanted);
    return batch;
}

// A cloud of one node per given batch; the root is the first, all others are its children.
class BatchCloud : public LayeredCloud {
public:
    BatchCloud(CloudInfo info, std::vector<PointBatch> batches) : info_(std::move(info)), batches_(std::move(batches)) {
        nodes_.resize(batches_.size());
        for (size_t i = 0; i < nodes_.size(); ++i) nodes_[i].points = batches_[i].size;
        nodes_[0].first_child = 1;
        nodes_[0].child_count = uint32_t(nodes_.size() - 1);
    }
    const CloudInfo& info() const override { return info_; }
    size_t node_count() const override { return nodes_.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }
    void read_node(NodeId id, std::span<const int>, PointBatch& out) const override { out = batches_[id]; }

private:
    CloudInfo info_;
    std::vector<PointBatch> batches_;
    std::vector<LayeredNode> nodes_;
};

std::vector<Rgba8> colors_of(const PointColorizer& colorizer, const PointBatch& batch, uint32_t level = 0) {
    std::vector<Rgba8> out(batch.size);
    colorizer.color(batch, level, out);
    return out;
}

TEST(PointColor, SixteenBitColorsMadeFromEightComeBackExactly) {
    const CloudInfo info = lidar_info();
    const ColorChannel channel = find_color_channel(info, "rgb");
    for (const unsigned spread : {256u, 257u}) {  // both ways to write 8 bits as 16
        PointBatch batch = batch_of(info, {2}, 256);
        for (size_t i = 0; i < 256; ++i)
            for (size_t c = 0; c < 3; ++c) batch.column<uint16_t>(2)[3 * i + c] = uint16_t((i * (c + 1) % 256) * spread);
        const auto colors = colors_of(PointColorizer(info, channel, {0, 65535}), batch);
        for (size_t i = 0; i < 256; ++i) EXPECT_EQ(colors[i], make_rgba(uint8_t(i), uint8_t(i * 2), uint8_t(i * 3))) << i;
    }
}

TEST(PointColor, EightBitsInSixteenAreRecognisedForTheCloudNotPerChannel) {
    const CloudInfo info = lidar_info();
    const ColorChannel channel = find_color_channel(info, "rgb");
    PointBatch low = batch_of(info, {2}, 2), mixed = low;
    for (auto& value : low.column<uint16_t>(2)) value = 200;
    for (auto& value : mixed.column<uint16_t>(2)) value = 200;  // red of 0..255, blue beyond: still one 16-bit cloud
    mixed.column<uint16_t>(2)[2] = 40000;
    EXPECT_EQ(derive_range(BatchCloud(info, {low}), channel).high, 255.0);
    EXPECT_EQ(derive_range(BatchCloud(info, {low, mixed}), channel).high, 65535.0);
    EXPECT_EQ(colors_of(PointColorizer(info, channel, {0, 255}), low)[0], make_rgba(200, 200, 200));
    EXPECT_EQ(colors_of(PointColorizer(info, channel, {0, 65535}), mixed)[0], make_rgba(0, 0, 40000 >> 8));
}

TEST(PointColor, PercentilesLeaveOutliersOut) {
    std::vector<double> values;
    for (int i = 0; i <= 1000; ++i) values.push_back(i);
    values[500] = 1e30;
    values.push_back(std::numeric_limits<double>::quiet_NaN());
    values.push_back(-std::numeric_limits<double>::infinity());
    const ColorRange range = percentile_range(values);
    // The 20th and 980th of 1001 sorted values, of which 500 was replaced by one that is the greatest.
    EXPECT_EQ(range.low, 20.0);
    EXPECT_EQ(range.high, 981.0);
    std::vector<double> none = {std::numeric_limits<double>::quiet_NaN()};
    EXPECT_LT(percentile_range(none).low, percentile_range(none).high);
}

TEST(PointColor, RampEndsAndMiddleHitTheMap) {
    const CloudInfo info = lidar_info();
    const Colormap map("ember");
    PointBatch batch = batch_of(info, {0}, 5);
    const uint16_t stored[5] = {0, 1000, 2000, 3000, 65535};
    std::copy(stored, stored + 5, batch.column<uint16_t>(0).begin());
    const auto colors = colors_of(PointColorizer(info, find_color_channel(info, "intensity"), {1000, 3000}, "ember"), batch);
    EXPECT_EQ(colors[0], map.colors().front());
    EXPECT_EQ(colors[1], map.colors().front());
    EXPECT_EQ(colors[2], map.colors()[Colormap::kColors / 2]);
    EXPECT_EQ(colors[3], map.colors().back());
    EXPECT_EQ(colors[4], map.colors().back());
    const auto reversed = colors_of(PointColorizer(info, find_color_channel(info, "intensity"), {3000, 1000}, "ember"), batch);
    EXPECT_EQ(reversed[1], map.colors().back());
    EXPECT_EQ(reversed[3], map.colors().front());
}

TEST(PointColor, ElevationIsInWorldUnits) {
    const CloudInfo info = lidar_info();  // z = quanta * 0.01 + 100
    PointBatch batch = batch_of(info, {}, 3);
    batch.z = {-1000, 0, 1000};  // 90, 100, 110
    const auto colors = colors_of(PointColorizer(info, find_color_channel(info, "elevation"), {90, 110}, "gray"), batch);
    const Colormap map("gray");
    EXPECT_EQ(colors[0], map.colors().front());
    EXPECT_EQ(colors[1], map.colors()[Colormap::kColors / 2]);
    EXPECT_EQ(colors[2], map.colors().back());
    const ColorRange range = derive_range(BatchCloud(info, {batch}), find_color_channel(info, "elevation"));
    EXPECT_DOUBLE_EQ(range.low, 90.0);
    EXPECT_DOUBLE_EQ(range.high, 110.0);
}

TEST(PointColor, ScaledAttributesAndValuesThatAreNoNumbers) {
    const CloudInfo info = lidar_info();  // curvature = stored * 2 + 1
    PointBatch batch = batch_of(info, {3}, 4);
    const float stored[4] = {0.0f, 2.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
    std::copy(stored, stored + 4, batch.column<float>(3).begin());
    const ColorChannel channel = find_color_channel(info, "curvature");
    const auto colors = colors_of(PointColorizer(info, channel, {1, 5}, "gray"), batch);
    const Colormap map("gray");
    EXPECT_EQ(colors[0], map.colors().front());
    EXPECT_EQ(colors[1], map.colors().back());
    EXPECT_EQ(colors[2], make_rgba(128, 128, 128));
    EXPECT_EQ(colors[3], map.colors().back());
    const ColorRange range = derive_range(BatchCloud(info, {batch}), channel);
    EXPECT_EQ(range.low, 1.0);
    EXPECT_EQ(range.high, 5.0);
}

TEST(PointColor, NoDataHasNoColorAndNoShareInTheRange) {
    CloudInfo info = lidar_info();
    info.attributes[0].no_data = 65535;
    PointBatch batch = batch_of(info, {0}, 3);
    const uint16_t stored[3] = {10, 65535, 20};
    std::copy(stored, stored + 3, batch.column<uint16_t>(0).begin());
    const ColorChannel channel = find_color_channel(info, "intensity");
    const ColorRange range = derive_range(BatchCloud(info, {batch}), channel);
    EXPECT_EQ(range.low, 10.0);
    EXPECT_EQ(range.high, 20.0);
    EXPECT_EQ(colors_of(PointColorizer(info, channel, range), batch)[1], make_rgba(128, 128, 128));
}

TEST(PointColor, OneValueOnlyIsTheMiddleOfTheMap) {
    const CloudInfo info = lidar_info();
    PointBatch batch = batch_of(info, {0}, 1);
    batch.column<uint16_t>(0)[0] = 7;
    const auto colors = colors_of(PointColorizer(info, find_color_channel(info, "intensity"), {7, 7}, "gray"), batch);
    EXPECT_EQ(colors[0], Colormap("gray").colors()[Colormap::kColors / 2]);
}

TEST(PointColor, CategoriesAreDistinctAndFollowTheirMeaning) {
    const CloudInfo info = lidar_info();
    PointBatch batch = batch_of(info, {1}, 3);
    batch.column<uint8_t>(1)[0] = 2, batch.column<uint8_t>(1)[1] = 9, batch.column<uint8_t>(1)[2] = 5;
    const auto colors = colors_of(PointColorizer(info, find_color_channel(info, "classification"), {}), batch);
    EXPECT_GT(red_of(colors[0]), blue_of(colors[0]));  // ground is brown,
    EXPECT_GT(blue_of(colors[1]), red_of(colors[1]));  // water blue,
    EXPECT_GT(green_of(colors[2]), red_of(colors[2]));  // trees green
    const PointColorizer by_level(info, find_color_channel(info, "lod"), {});
    EXPECT_TRUE(by_level.wanted().empty());
    std::set<Rgba8> seen;
    for (uint32_t level = 0; level < 24; ++level) seen.insert(colors_of(by_level, batch, level)[0]);
    EXPECT_EQ(seen.size(), 24u);
}

TEST(PointColor, NamesFindTheirAttributesOrSayWhatThereIs) {
    const CloudInfo info = lidar_info();
    EXPECT_EQ(find_color_channel(info, "return").attribute, 4);
    EXPECT_EQ(find_color_channel(info, "curvature").rule, ColorChannel::Rule::ramp);
    EXPECT_EQ(find_color_channel(info, "normal[2]").component, 2);
    EXPECT_EQ(default_color(info), "rgb");
    EXPECT_EQ(default_color(CloudInfo{}), "elevation");
    for (const char* wrong : {"gps-time", "normal", "normal[3]", "normal[-1]", "nothing", "", "[0]"}) {
        try {
            find_color_channel(info, wrong);
            ADD_FAILURE() << wrong;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::usage);
        }
    }
    try {
        find_color_channel(info, "nothing");
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("curvature"), std::string::npos);
    }
    EXPECT_THROW(PointColorizer(info, find_color_channel(info, "intensity"), {0, 1}, "no such map"), Error);
}

TEST(PointColor, NormalsAreDirectionsAsColors) {
    CloudInfo info;
    info.attributes = {{"NormalX", "", ScalarType::float32}, {"x", "", ScalarType::uint8}, {"NormalY", "", ScalarType::float32},
                       {"NormalZ", "", ScalarType::int8, 1, 1.0 / 127.0}};
    const ColorChannel channel = find_color_channel(info, "normal");
    EXPECT_FALSE(channel.needs_range());
    const PointColorizer colorizer(info, channel, {});
    EXPECT_EQ(std::vector<int>(colorizer.wanted().begin(), colorizer.wanted().end()), (std::vector<int>{0, 2, 3}));
    PointBatch batch = batch_of(info, {0, 2, 3}, 5);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float x[] = {0, 1, -1, 0.5f, nan}, y[] = {0, 0, 0, -0.5f, 0};
    const int8_t z[] = {127, 0, 0, -127, 127};
    std::copy_n(x, 5, batch.column<float>(0).begin());
    std::copy_n(y, 5, batch.column<float>(2).begin());
    std::copy_n(z, 5, batch.column<int8_t>(3).begin());
    EXPECT_EQ(colors_of(colorizer, batch), (std::vector<Rgba8>{make_rgba(128, 128, 255), make_rgba(255, 128, 128), make_rgba(0, 128, 128),
                                                               make_rgba(191, 64, 0), make_rgba(128, 128, 128)}));
    info.attributes[2].name = "y";
    try {
        find_color_channel(info, "normal");
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("strata convert --normals"), std::string::npos);
    }
}

// Equal ratios are equal steps: the mean of the ends' logarithms is the middle of the map.
TEST(PointColor, DensityGoesByItsLogarithm) {
    CloudInfo info;
    info.attributes = {{"density", "", ScalarType::float32, 1, 2.0}};
    const ColorChannel channel = find_color_channel(info, "density");
    PointBatch batch = batch_of(info, {0}, 6);
    const float stored[] = {0.5f, 5.0f, 50.0f, 5000.0f, 0.0f, std::numeric_limits<float>::quiet_NaN()};
    std::copy_n(stored, 6, batch.column<float>(0).begin());
    const Colormap map("gray");
    const auto& colors = map.colors();
    const Rgba8 none = make_rgba(128, 128, 128);
    EXPECT_EQ(colors_of(PointColorizer(info, channel, {1.0, 100.0}, "gray"), batch),
              (std::vector<Rgba8>{colors.front(), colors[colors.size() / 2], colors.back(), colors.back(), none, none}));
    EXPECT_EQ(colors_of(PointColorizer(info, channel, {10000.0, 1.0}, "gray"), batch),
              (std::vector<Rgba8>{colors.back(), colors[colors.size() * 3 / 4 - 1], colors[colors.size() / 2 - 1], colors.front(), none, none}));
    EXPECT_THROW(PointColorizer(info, channel, {0.0, 1.0}), Error);
    const ColorRange range = derive_range(BatchCloud(info, {batch}), channel);
    EXPECT_EQ(range.low, 1.0);  // zero does not count
    EXPECT_EQ(range.high, 10000.0);
}

}  // namespace
}  // namespace strata
