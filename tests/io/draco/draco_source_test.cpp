// Files as other programs write them: made by Draco's own encoder, or real ones.
#include "io/draco/draco_source.h"

#include <draco/mesh/mesh.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "io/format.h"
#include "tests/io/draco/draco_cloud.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using draco::GeometryAttribute;
using test::DracoCloud;
using test::points_of;
using test::values_of;
using test::walk;
using Values = std::vector<double>;

DracoSource open(std::vector<std::byte> bytes) { return DracoSource(memory_source("test.drc", std::move(bytes))); }

// The farthest that any coordinate of the source lies from those, x y z of each point; order counts.
template <typename T>
double worst_error(const PointSource& source, const std::vector<T>& truth) {
    const PointBatch points = points_of(source);
    EXPECT_EQ(points.size * 3, truth.size());
    double worst = 0.0;
    for (size_t i = 0; i < points.size; ++i) {
        const Vec3d world = source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]});
        for (size_t axis = 0; axis < 3; ++axis) worst = std::max(worst, std::abs(world[Eigen::Index(axis)] - double(truth[3 * i + axis])));
    }
    return worst;
}

class QuantizedPositions : public ::testing::TestWithParam<std::pair<int, int>> {};

// Draco rounds to a grid of 2^bits - 1 steps over the longest side: that grid is the cloud's own quantization, exactly.
TEST_P(QuantizedPositions, KeepTheGridOfTheFile) {
    const auto [method, bits] = GetParam();
    const std::vector<float> places = walk<float>(5000, 0.125, {100, -50, 7});
    DracoCloud cloud(5000);
    cloud.quantize(cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, places), bits);
    const DracoSource source = open(cloud.encode(method));
    Vec3d low = Vec3d::Constant(1e9), high = -low;
    for (size_t i = 0; i < places.size(); ++i) {
        low[Eigen::Index(i % 3)] = std::min(low[Eigen::Index(i % 3)], double(places[i]));
        high[Eigen::Index(i % 3)] = std::max(high[Eigen::Index(i % 3)], double(places[i]));
    }
    const double step = (high - low).maxCoeff() / (std::pow(2.0, bits) - 1.0);
    EXPECT_EQ(source.info().quantization.offset, low);
    EXPECT_NEAR(source.info().quantization.scale.x(), step, 1e-12 * step);
    EXPECT_EQ(source.info().worst_rounding, 0.0);  // by this reader; what Draco rounded is done
    EXPECT_TRUE(source.info().attributes.empty());
    EXPECT_EQ(source.info().points, 5000u);
    if (method == draco::POINT_CLOUD_SEQUENTIAL_ENCODING) {
        // Half a step, and four roundings of float32 on the way to it, of up to 2^bits steps.
        EXPECT_LE(worst_error(source, places), 0.5 * step + std::ldexp(step, bits - 22));
        EXPECT_GT(worst_error(source, places), 0.4 * step);
    }
    const PointBatch points = points_of(source);
    int32_t most = 0;
    for (const auto* axis : {&points.x, &points.y, &points.z}) {
        EXPECT_EQ(*std::min_element(axis->begin(), axis->end()), 0);
        most = std::max(most, *std::max_element(axis->begin(), axis->end()));
    }
    EXPECT_EQ(most, (1 << bits) - 1);
}
INSTANTIATE_TEST_SUITE_P(Draco, QuantizedPositions,
                         ::testing::Values(std::pair{0, 8}, std::pair{0, 11}, std::pair{0, 16}, std::pair{1, 8}, std::pair{1, 11}, std::pair{1, 16}));

TEST(DracoSource, IntegersAreQuanta) {
    const std::vector<int32_t> places = {5, -7, 0, 1 << 20, 3, -(1 << 20), 0, 0, 1};
    DracoCloud cloud(3);
    cloud.add(GeometryAttribute::POSITION, draco::DT_INT32, 3, places);
    const DracoSource source = open(cloud.encode());
    EXPECT_EQ(source.info().quantization, (Quantization{.scale = Vec3d::Ones(), .offset = Vec3d::Zero()}));
    EXPECT_EQ(worst_error(source, places), 0.0);
    EXPECT_EQ(source.info().bounds.max.x(), 1 << 20);
    EXPECT_EQ(source.info().bounds.min.z(), -(1 << 20));
}

TEST(DracoSource, IntegersBeyond32BitsAreMovedAndWidened) {
    const std::vector<uint64_t> near = {uint64_t{5'000'000'000}, 0, 7, uint64_t{5'000'000'003}, 1, 8};
    DracoCloud cloud(2);
    cloud.add(GeometryAttribute::POSITION, draco::DT_UINT64, 3, near);
    EXPECT_EQ(worst_error(open(cloud.encode()), near), 0.0);
    const std::vector<uint64_t> far = {0, 0, 0, uint64_t{1} << 50, 1, 1};
    DracoCloud wide(2);
    wide.add(GeometryAttribute::POSITION, draco::DT_UINT64, 3, far);
    const DracoSource source = open(wide.encode());
    EXPECT_EQ(source.info().quantization.scale.x(), 1e6);  // 2^49 / 1e6 < 2^31
    EXPECT_EQ(worst_error(source, far), source.info().worst_rounding);
    EXPECT_LE(source.info().worst_rounding, 0.5e6);
}

// Floats that Draco did not quantize lose less than they are rounded by themselves, and the reader says how much.
TEST(DracoSource, PlainFloatsAreRoundedBelowTheirOwnStep) {
    const std::vector<float> places = walk<float>(1000, 0.0071, {3000, 1e-3, -5});
    DracoCloud cloud(1000);
    cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, places);
    const DracoSource source = open(cloud.encode());
    const double worst = worst_error(source, places);
    EXPECT_EQ(worst, source.info().worst_rounding);
    EXPECT_LE(worst, 0x1p-13);  // half the step of floats from 2048 to 4096
    EXPECT_GT(worst, 0.0);
    EXPECT_EQ(source.info().quantization.scale.x(), 1e-4);  // the step is 2.4e-4
    // Zeros alone have no step.
    DracoCloud zeros(2);
    zeros.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, std::vector<float>(6, 0.0f));
    EXPECT_EQ(worst_error(open(zeros.encode()), std::vector<float>(6, 0.0f)), 0.0);
    // Nor is any number too large or too small.
    const std::vector<float> ends = {3e38f, -3e38f, 1e-45f, -1e-40f, 0.0f, 5e37f};
    DracoCloud wide(2);
    wide.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, ends);
    EXPECT_LE(worst_error(open(wide.encode()), ends), 1e32);
}

TEST(DracoSource, DoublesKeepWhatUtmNeeds) {
    const std::vector<double> places = walk<double>(1000, 0.0001, {500000.0, 5300000.0, 300.0});
    DracoCloud cloud(1000);
    cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT64, 3, places);
    const DracoSource source = open(cloud.encode());
    EXPECT_LE(worst_error(source, places), 1e-7);
    EXPECT_EQ(worst_error(source, places), source.info().worst_rounding);
}

TEST(DracoSource, PointsThatAreNowhereAreLeftOutWithWhatTheyHave) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    DracoCloud cloud(4);
    cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, std::vector<float>{0, 0, nan, 1, 2, 3, inf, 1, 1, 4, 5, 6});
    cloud.add(GeometryAttribute::GENERIC, draco::DT_UINT16, 1, std::vector<uint16_t>{10, 11, 12, 13});
    const DracoSource source = open(cloud.encode());
    EXPECT_EQ(source.info().points, 2u);
    ASSERT_EQ(source.info().notes.size(), 1u);
    EXPECT_EQ(source.info().notes[0], "2 points without a finite position are left out");
    for (int pass = 0; pass < 2; ++pass) {  // as it was opened, and decoded again
        const PointBatch points = points_of(source);
        EXPECT_EQ(values_of(source, points, "generic 0"), (Values{11, 13}));
        EXPECT_NEAR(source.info().quantization.world_from_quanta({points.x[1], points.y[1], points.z[1]}).z(), 6.0, 1e-6);
    }
}

// 8 bits stay as they are, as LAS files have them; floats are fractions.
TEST(DracoSource, ColorsOfAnyType) {
    const std::vector<float> places(6, 1.0f);
    const auto rgb_of = [&](draco::DataType type, int components, const auto& values) {
        DracoCloud cloud(2);
        cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, places);
        cloud.add(GeometryAttribute::COLOR, type, components, values);
        const DracoSource source = open(cloud.encode());
        const PointBatch points = points_of(source);
        return std::pair(values_of(source, points, "rgb"), values_of(source, points, "alpha"));
    };
    EXPECT_EQ(rgb_of(draco::DT_UINT8, 3, std::vector<uint8_t>{0, 128, 255, 1, 2, 3}), std::pair(Values{0, 128, 255, 1, 2, 3}, Values{}));
    EXPECT_EQ(rgb_of(draco::DT_UINT8, 4, std::vector<uint8_t>{0, 128, 255, 9, 1, 2, 3, 8}), std::pair(Values{0, 128, 255, 1, 2, 3}, Values{9, 8}));
    EXPECT_EQ(rgb_of(draco::DT_UINT16, 3, std::vector<uint16_t>{0, 40000, 65535, 1, 2, 3}), std::pair(Values{0, 40000, 65535, 1, 2, 3}, Values{}));
    EXPECT_EQ(rgb_of(draco::DT_FLOAT32, 3, std::vector<float>{0.0f, 0.5f, 1.0f, -1.0f, 2.0f, 0.25f}),
              std::pair(Values{0, 32768, 65535, 0, 65535, 16384}, Values{}));
    EXPECT_EQ(rgb_of(draco::DT_UINT8, 1, std::vector<uint8_t>{7, 250}), std::pair(Values{7, 7, 7, 250, 250, 250}, Values{}));
    EXPECT_EQ(rgb_of(draco::DT_UINT8, 2, std::vector<uint8_t>{7, 1, 250, 2}), std::pair(Values{7, 7, 7, 250, 250, 250}, Values{1, 2}));
}

TEST(DracoSource, NormalsBecomeThreeFloats) {
    DracoCloud cloud(2);
    cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, std::vector<float>(6, 1.0f));
    cloud.add(GeometryAttribute::NORMAL, draco::DT_FLOAT32, 3, std::vector<float>{1, 0, 0, 0, -0.6f, 0.8f});
    const DracoSource source = open(cloud.encode());
    const PointBatch points = points_of(source);
    EXPECT_EQ(values_of(source, points, "NormalX"), (Values{1, 0}));
    EXPECT_EQ(values_of(source, points, "NormalY"), (Values{0, double(-0.6f)}));
    EXPECT_EQ(values_of(source, points, "NormalZ"), (Values{0, double(0.8f)}));

    DracoCloud bytes(2);
    bytes.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, std::vector<float>(6, 1.0f));
    bytes.add(GeometryAttribute::NORMAL, draco::DT_INT8, 3, std::vector<int8_t>{127, 0, 0, 0, -127, 64}, true);
    const DracoSource normalized = open(bytes.encode());
    EXPECT_EQ(values_of(normalized, points_of(normalized), "NormalY"), (Values{0, -1}));
    EXPECT_EQ(values_of(normalized, points_of(normalized), "NormalZ"), (Values{0, double(float(64.0 / 127.0))}));
}

TEST(DracoSource, OtherAttributesKeepTypeAndName) {
    DracoCloud cloud(2);
    auto metadata = std::make_unique<draco::GeometryMetadata>();
    metadata->AddEntryString("scale", "means nothing without the word that says it is ours");
    cloud.cloud().AddMetadata(std::move(metadata));
    cloud.add(GeometryAttribute::GENERIC, draco::DT_FLOAT64, 1, std::vector<double>{1.5, -1e300}, false, "time");
    cloud.add(GeometryAttribute::POSITION, draco::DT_INT32, 3, std::vector<int32_t>(6, 1));
    cloud.add(GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, 2, std::vector<float>{0, 0.5f, 1, 0.25f});
    cloud.add(GeometryAttribute::GENERIC, draco::DT_UINT32, 1, std::vector<uint32_t>{7, 9});
    cloud.add(GeometryAttribute::GENERIC, draco::DT_UINT16, 1, std::vector<uint16_t>{8, 65535}, false, "intensity");
    cloud.add(GeometryAttribute::GENERIC, draco::DT_FLOAT32, 1, std::vector<float>{2, 3}, false, "classification");  // not what that name stands for
    cloud.add(GeometryAttribute::GENERIC, draco::DT_INT8, 1, std::vector<int8_t>{-2, 3}, false, "time");
    cloud.add(GeometryAttribute::POSITION, draco::DT_INT32, 3, std::vector<int32_t>(6, 2));
    const DracoSource source = open(cloud.encode());
    std::vector<std::string> names;
    for (const Attribute& attribute : source.info().attributes) names.push_back(attribute.name);
    EXPECT_EQ(names, (std::vector<std::string>{"time", "texture 0", "generic 1", "intensity", "classification (draco)", "time 2"}));
    const PointBatch points = points_of(source);
    EXPECT_EQ(points.x, (std::vector<int32_t>{1, 1}));
    EXPECT_EQ(source.info().notes, std::vector<std::string>{"a second attribute POSITION is left out"});
    EXPECT_EQ(values_of(source, points, "time"), (Values{1.5, -1e300}));
    EXPECT_EQ(values_of(source, points, "texture 0"), (Values{0, 0.5, 1, 0.25}));
    EXPECT_EQ(values_of(source, points, "generic 1"), (Values{7, 9}));
    EXPECT_EQ(values_of(source, points, "intensity"), (Values{8, 65535}));
    EXPECT_EQ(values_of(source, points, "time 2"), (Values{-2, 3}));
}

// Two triangles of four corners: a point each, by both ways to encode a mesh.
TEST(DracoSource, AMeshIsItsVertices) {
    draco::Mesh mesh;
    mesh.set_num_points(4);
    const std::vector<float> places = {0, 0, 0, 4, 0, 0, 4, 3, 0, 0, 3, 1};
    draco::GeometryAttribute position;
    position.Init(GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
    const int index = mesh.AddAttribute(position, true, 4);
    std::memcpy(mesh.attribute(index)->buffer()->data(), places.data(), sizeof(float) * places.size());
    mesh.AddFace({draco::PointIndex(0), draco::PointIndex(1), draco::PointIndex(2)});
    mesh.AddFace({draco::PointIndex(0), draco::PointIndex(2), draco::PointIndex(3)});
    for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
        draco::ExpertEncoder encoder(mesh);
        encoder.SetEncodingMethod(method);
        encoder.SetAttributeQuantization(index, 12);
        draco::EncoderBuffer buffer;
        ASSERT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
        const auto* const bytes = reinterpret_cast<const std::byte*>(buffer.data());
        const DracoSource source = open({bytes, bytes + buffer.size()});
        EXPECT_EQ(source.info().notes, std::vector<std::string>{"a mesh of 2 faces: its vertices are read, as points"});
        const PointBatch points = points_of(source);
        std::multiset<std::array<int, 3>> found, expected = {{0, 0, 0}, {4, 0, 0}, {4, 3, 0}, {0, 3, 1}};
        for (size_t i = 0; i < points.size; ++i) {
            const Vec3d world = source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]});
            found.insert({int(std::lround(world.x())), int(std::lround(world.y())), int(std::lround(world.z()))});
            EXPECT_LE((world.array() - world.array().round()).abs().maxCoeff(), 0.5 * 4.0 / 4095.0 + 1e-6);
        }
        EXPECT_EQ(found, expected);
    }
}

// A long file is decoded once for a pass over its batches, and again for one that comes back.
TEST(DracoSource, LongFilesComeInBatchesOfAnyOrder) {
    const size_t count = DracoSource::kWholeBatchPoints + 70'000;
    DracoCloud cloud(count);
    std::vector<int32_t> places(3 * count);
    for (size_t i = 0; i < count; ++i) places[3 * i] = int32_t(i);
    cloud.add(GeometryAttribute::POSITION, draco::DT_INT32, 3, places);
    const std::vector<std::byte> bytes = cloud.encode();
    for (const DracoSource::Keep keep : {DracoSource::Keep::decoded, DracoSource::Keep::nothing}) {
        const DracoSource source(memory_source("long.drc", bytes), keep);
        ASSERT_EQ(source.batch_count(), 6u);
        PointBatch batch;
        for (const uint64_t index : {5, 0, 3, 5, 4, 2, 1}) {
            source.read_batch(index, {}, batch);
            ASSERT_EQ(batch.size, index < 5 ? DracoSource::kBatchPoints : count - 5 * DracoSource::kBatchPoints);
            for (size_t i = 0; i < batch.size; ++i) ASSERT_EQ(uint64_t(batch.x[i]), index * DracoSource::kBatchPoints + i);
        }
    }
}

TEST(DracoSource, NoPointsAreNoBatches) {
    // Draco's encoder refuses to make such a file: header, no points, one decoder, one attribute (POSITION, int32 x 3), integers.
    const uint8_t bytes[] = {'D', 'R', 'A', 'C', 'O', 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 5, 3, 0, 0, 1};
    const auto* const data = reinterpret_cast<const std::byte*>(bytes);
    try {
        const DracoSource source = open({data, data + sizeof bytes});
        EXPECT_EQ(source.info().points, 0u);
        EXPECT_EQ(source.batch_count(), 0u);
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::malformed) << error.what();
    }
}

// What a file says of itself is held against its size before Draco, which believes it, sees it.
class LyingDraco : public ::testing::Test {
protected:
    static void expect_refused(const std::vector<std::byte>& bytes, const std::string& part) {
        try {
            open(bytes);
            ADD_FAILURE() << "taken for true: " << part;
        } catch (const Error& error) {
            EXPECT_EQ(std::string(error.what()).rfind("test.drc: ", 0), 0u) << error.what();
            EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
        }
    }
    static std::vector<std::byte> points(int method) {
        DracoCloud cloud(100);
        cloud.quantize(cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, walk<float>(100, 1.0)), 10);
        return cloud.encode(method);
    }
    template <typename T>
    static std::vector<std::byte> with(std::vector<std::byte> bytes, size_t at, T value) {
        std::memcpy(bytes.data() + at, &value, sizeof value);
        return bytes;
    }
    // Where the fields of these files are: 11 bytes of header, the count, one decoder, one attribute of 5 bytes and its count.
    static constexpr size_t kCount = 11, kDecoders = 15, kAttributes = 16, kKind = 17, kType = 18, kComponents = 19, kLevel = 22, kBits = 23, kTreeCount = 27;
};

TEST_F(LyingDraco, Header) {
    const std::vector<std::byte> bytes = points(0);
    ASSERT_NO_THROW(open(bytes));
    expect_refused({}, "5 bytes needed");
    expect_refused(with<uint8_t>(bytes, 5, 3), "bitstream 3.3 of points");
    expect_refused(with<uint8_t>(bytes, 6, 4), "bitstream 2.4 of points");
    expect_refused(with<uint8_t>(bytes, 7, 2), "points (0) or a mesh (1)");
    expect_refused(with<uint8_t>(bytes, 8, 2), "encoding method");
    expect_refused(with<uint8_t>(bytes, kKind, 9), "attribute type 0 to 8");
    expect_refused(with<uint8_t>(bytes, kKind, 4), "no attribute POSITION");
    expect_refused(with<uint8_t>(bytes, kType, 12), "data type 1 to 11");
    expect_refused(with<uint8_t>(bytes, kComponents, 0), "without components");
    expect_refused(with<uint8_t>(bytes, kDecoders, 255), "");
    expect_refused(with<uint8_t>(bytes, kAttributes, 127), "");
}

TEST_F(LyingDraco, Counts) {
    for (const int method : {0, 1}) {
        const std::vector<std::byte> bytes = points(method);
        expect_refused(with<uint32_t>(bytes, kCount, 0x7FFFFFFF), "2147483647 points need about");
        expect_refused(with<uint32_t>(bytes, kCount, 0xFFFFFFFF), "at most 2147483647");
        expect_refused(with<uint32_t>(bytes, kCount, 5'000'000), "5000000 points need about");
    }
    const std::vector<std::byte> tree = points(1);
    expect_refused(with<uint32_t>(tree, kTreeCount, 0xFFFFFFFF), "a kd-tree of 100 points expected");
    expect_refused(with<uint32_t>(tree, kBits, 33), "at most 32 bits");
    expect_refused(with<uint8_t>(tree, kLevel, 7), "compression level 0 to 6");
    expect_refused(with<uint8_t>(tree, 6, 2), "a kd-tree of bitstream 2.3 expected, got 2.2");
}

// A few bytes that ask for 255 components of 8 bytes, 10 million times, as an attribute of a mesh too.
TEST_F(LyingDraco, AttributesOfAMesh) {
    const char* const folder = std::getenv("STRATA_DATA");
    std::ifstream file(std::string(folder ? folder : "") + "/drc/bunny_gltf.drc", std::ios::binary);
    if (!file) GTEST_SKIP() << "STRATA_DATA has no drc/bunny_gltf.drc";
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    const auto* const data = reinterpret_cast<const std::byte*>(text.data());
    const std::vector<std::byte> bytes(data, data + text.size());
    ASSERT_NO_THROW(open(bytes));
    // Behind the kind of traversal: 34834 vertices and 69451 faces, as varints of three bytes, and how many attributes have seams.
    ASSERT_EQ(uint8_t(bytes[12]), 0x92);
    expect_refused(with<uint8_t>(with<uint8_t>(with<uint8_t>(bytes, 15, 0xFF), 16, 0xFF), 17, 0x7F), "2097151 faces need about");
    expect_refused(with<uint8_t>(bytes, 18, 255), "69451 faces need about");
}

// As their index has them.
TEST(DracoSource, RealFiles) {
    const char* const folder = std::getenv("STRATA_DATA");
    std::ifstream file(std::string(folder ? folder : "") + "/index.json");
    if (!file) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    int seen = 0;
    for (const nlohmann::json& entry : nlohmann::json::parse(file)) {
        if (entry["format"] != "DRC") continue;
        ++seen;
        const std::string path = std::string(folder) + "/" + std::string(entry["file"]);
        EXPECT_EQ(identify_format(path).name, "drc");
        const std::unique_ptr<PointSource> source = open_points({&path, 1});
        const CloudInfo& info = source->info();
        EXPECT_EQ(info.points, uint64_t(entry["points"])) << path;
        for (int axis = 0; axis < 3; ++axis) {  // the index has what float32 makes of it
            EXPECT_NEAR(info.bounds.min[axis], double(entry["min"][size_t(axis)]), 1e-6 * std::abs(info.bounds.min[axis])) << path;
            EXPECT_NEAR(info.bounds.max[axis], double(entry["max"][size_t(axis)]), 1e-6 * std::abs(info.bounds.max[axis])) << path;
        }
        const PointBatch points = points_of(*source);
        EXPECT_EQ(points.size, info.points);
        if (find_attribute(info.attributes, "rgb") >= 0)
            for (const double channel : values_of(*source, points, "rgb")) ASSERT_LE(channel, 255.0);
    }
    EXPECT_EQ(seen, 3);
}

// Cut at many places and with changed bytes, a file is refused or read to its last point. The sanitized build runs this too.
TEST(DracoSource, DamagedFilesAreRefusedOrWhole) {
    std::vector<std::vector<std::byte>> files;
    for (const int method : {0, 1}) {
        DracoCloud cloud(300);
        cloud.quantize(cloud.add(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, walk<float>(300, 1.0)), 12);
        cloud.add(GeometryAttribute::COLOR, draco::DT_UINT8, 3, std::vector<uint8_t>(900, 77));
        cloud.add(GeometryAttribute::GENERIC, draco::DT_UINT16, 1, std::vector<uint16_t>(300, 5), false, "intensity");
        files.push_back(cloud.encode(method));
    }
    if (const char* const folder = std::getenv("STRATA_DATA"))
        for (const char* name : {"1.2-with-color.drc", "pc_kd_color.drc", "bunny_gltf.drc"}) {
            std::ifstream file(std::string(folder) + "/drc/" + name, std::ios::binary);
            const std::string text((std::istreambuf_iterator<char>(file)), {});
            const auto* const data = reinterpret_cast<const std::byte*>(text.data());
            if (!text.empty()) files.emplace_back(data, data + text.size());
        }
    size_t refused = 0, read = 0;
    const auto attempt = [&](std::vector<std::byte> bytes) {
        try {
            const DracoSource source = open(std::move(bytes));
            EXPECT_EQ(points_of(source).size, source.info().points);
            ++read;
        } catch (const Error& error) {
            EXPECT_EQ(std::string(error.what()).rfind("test.drc: ", 0), 0u) << error.what();
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
            ++refused;
        }
    };
    uint32_t state = 7;
    const auto next = [&](size_t below) {
        state = state * 1664525u + 1013904223u;
        return size_t((uint64_t(state) * below) >> 32);
    };
    for (const std::vector<std::byte>& file : files) {
        for (size_t i = 0; i < 150; ++i) {
            const size_t end = i < 60 ? std::min(i, file.size()) : next(file.size());
            attempt({file.begin(), file.begin() + ptrdiff_t(end)});
        }
        for (int i = 0; i < 150; ++i) {
            std::vector<std::byte> bytes = file;
            for (size_t changes = 1 + next(3); changes > 0; --changes)  // half of them where counts and tables are
                bytes[next(2) == 0 ? next(std::min<size_t>(200, bytes.size())) : next(bytes.size())] ^= std::byte(1 << next(8));
            attempt(std::move(bytes));
        }
    }
    EXPECT_GT(refused, files.size() * 100);
    EXPECT_GT(read, files.size());
}

}  // namespace
}  // namespace strata
