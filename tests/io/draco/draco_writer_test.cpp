// What is written is read back by strata, and by Draco alone, which is the judge of how far points have moved.
#include "io/draco/draco_writer.h"

#include <draco/compression/decode.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "io/draco/draco_block.h"
#include "io/draco/draco_source.h"
#include "io/format.h"
#include "tests/io/draco/column_source.h"
#include "tests/support/points_of.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

using test::ColumnSource;
using test::points_of;

constexpr auto kUnsynced = Durability::unsynced;

// Pseudo-random bits, the same every time.
struct Bits {
    uint64_t state = 1;
    uint64_t next() {
        state = state * 6364136223846793005u + 1442695040888963407u;
        return state ^ state >> 29;
    }
    int32_t below(int32_t most) { return int32_t(next() % uint64_t(most)); }
};

// What Draco alone makes of a file: x y z of each point, offset and scale of its metadata applied as the guide says.
std::vector<Vec3d> decoded_by_draco(const std::string& path) {
    const std::string file = test::file_contents(path);
    draco::DecoderBuffer buffer;
    buffer.Init(file.data(), file.size());
    draco::Decoder decoder;
    auto cloud = decoder.DecodePointCloudFromBuffer(&buffer);
    if (!cloud.ok()) throw std::runtime_error(cloud.status().error_msg_string());
    std::vector<double> scale, offset;
    EXPECT_TRUE(cloud.value()->GetMetadata()->GetEntryDoubleArray("scale", &scale));
    EXPECT_TRUE(cloud.value()->GetMetadata()->GetEntryDoubleArray("offset", &offset));
    const draco::PointAttribute* const places = cloud.value()->GetNamedAttribute(draco::GeometryAttribute::POSITION);
    std::vector<Vec3d> points;
    for (uint32_t i = 0; i < cloud.value()->num_points(); ++i) {
        std::array<float, 3> value;  // as viewers take them, whatever they are
        EXPECT_TRUE((places->ConvertValue<float, 3>(places->mapped_index(draco::PointIndex(i)), value.data())));
        points.push_back({value[0] * scale[0] + offset[0], value[1] * scale[1] + offset[1], value[2] * scale[2] + offset[2]});
    }
    return points;
}

double worst_of(const std::vector<Vec3d>& points, const ColumnSource& source, int axis) {
    EXPECT_EQ(points.size(), source.x.size());
    double worst = 0.0;
    for (size_t i = 0; i < points.size(); ++i)
        worst = std::max(worst, std::abs(points[i][axis] - source.cloud_info.quantization.world_from_quanta({source.x[i], source.y[i], source.z[i]})[axis]));
    return worst;
}

std::vector<Vec3d> read_by_strata(const PointSource& source) {
    const PointBatch points = points_of(source);
    std::vector<Vec3d> world;
    for (size_t i = 0; i < points.size; ++i) world.push_back(source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]}));
    return world;
}

// Points of a scan-like walk in a box of so many quanta.
ColumnSource walk(size_t points, std::array<int32_t, 3> extent, Vec3d scale, Vec3d offset) {
    ColumnSource source;
    source.cloud_info.quantization = {.scale = scale, .offset = offset};
    Bits bits;
    for (size_t i = 0; i < points; ++i) {
        source.x.push_back(bits.below(extent[0] + 1));
        source.y.push_back(bits.below(extent[1] + 1));
        source.z.push_back(bits.below(extent[2] + 1));
    }
    source.finish();
    return source;
}

struct HardCase {
    const char* name;
    ColumnSource source;
    double max_error;   // 0: the default
    Vec3d expected;     // what each axis may be off by, for Draco
    bool exact;         // strata reads the integers back
    bool floats;        // other programs see world units
};

void PrintTo(const HardCase& hard, std::ostream* out) { *out << hard.name; }

std::vector<HardCase> hard_cases() {
    std::vector<HardCase> cases;
    const auto add = [&](const char* name, ColumnSource source, double max_error, Vec3d expected, bool exact, bool floats) {
        cases.push_back({name, std::move(source), max_error, expected, exact, floats});
    };
    const auto all = [](double e) { return Vec3d(Vec3d::Constant(e)); };
    const Vec3d mm = all(0.001), utm(500000, 5300000, 300);
    add("utm_millimeters", walk(3000, {900'000, 900'000, 90'000}, mm, utm), 0, all(0.0005), true, true);
    add("utm_one_centimeter", walk(3000, {900'000, 900'000, 90'000}, mm, utm), 0.01, all(0.01), false, true);
    add("utm_one_meter", walk(3000, {900'000, 900'000, 90'000}, mm, utm), 1.0, all(1.0), false, true);
    add("eight_kilometers", walk(3000, {8'100'000, 8'100'000, 90'000}, mm, utm), 0, all(0.0005), true, true);
    add("earth_centered", walk(3000, {400'000, 400'000, 400'000}, mm, {4'177'000.123, 855'000.456, 4'727'000.789}), 0, all(0.0005), true, true);
    add("offset_zero", [&] {
        ColumnSource source = walk(3000, {900'000, 900'000, 90'000}, mm, Vec3d::Zero());
        for (int32_t& x : source.x) x += 548'000'000;
        source.cloud_info.bounds = {};
        source.finish();
        return source;
    }(), 0, all(0.0005), true, true);
    add("flat", walk(3000, {50'000, 50'000, 0}, mm, utm), 0, all(0.0005), true, true);
    add("one_point", walk(1, {50'000, 50'000, 1000}, mm, utm), 0, all(0.0005), true, true);
    add("equal_points", walk(100'000, {0, 0, 0}, mm, utm), 0, all(0.0), true, true);
    add("steps_of_a_power_of_two", walk(3000, {100'000, 100'000, 100'000}, all(0x1p-9), utm), 0, all(0.0), true, true);
    add("odd_steps", walk(3000, {100'000, 100'000, 100'000}, {0.00025, 0.0007, 0.01}, utm), 0, all(0.000125), true, true);
    add("nine_kilometers", walk(3000, {9'000'000, 9'000'000, 90'000}, mm, utm), 0, all(0.0005), true, false);
    add("twenty_kilometers_of_road", walk(3000, {20'000'000, 900'000, 90'000}, mm, utm), 0, all(2.0), true, false);
    add("twenty_kilometers_each_way", walk(3000, {20'000'000, 20'000'000, 20'000'000}, mm, utm), 0, all(2.0), true, false);
    add("degrees", walk(3000, {90'000, 90'000, 90'000}, {1e-7, 1e-7, 0.01}, {11, 48, 0}), 0, {0, 0, 0}, true, false);
    add("beyond_float", walk(3000, {20'000'000, 20'000'000, 90'000}, mm, utm), 0.0005, all(2.0), true, false);
    add("beyond_float_coarse", walk(3000, {2'000'000'000, 900'000, 90'000}, mm, utm), 0.1, all(0.1 + 1000 * 0x1p-10), false, false);
    add("finer_than_its_steps", walk(3000, {900'000, 900'000, 90'000}, mm, utm), 1e-5, all(0x1p-5), true, false);
    add("floats_in_disguise", walk(3000, {1'000'000'000, 1'000'000'000, 500'000'000}, all(1e-9), Vec3d::Zero()), 0, all(0x1p-25), false, false);
    return cases;
}

class MovedPoints : public ::testing::TestWithParam<HardCase> {};

TEST_P(MovedPoints, AreWithinTheError) {
    const HardCase& hard = GetParam();
    const TemporaryFolder folder;
    const std::string path = folder.file("out.drc");
    const DracoWriteReport report = make_draco_writer(path, {.max_error = hard.max_error, .durability = kUnsynced})->write(hard.source);
    EXPECT_EQ(report.points, hard.source.x.size());
    EXPECT_EQ(report.output_bytes, fs::file_size(path));
    EXPECT_EQ(report.exact, hard.exact);

    const std::vector<Vec3d> seen = decoded_by_draco(path);
    double worst = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        // Doubles of offsets up to 2^23 leave 2^-30. Integers become floats on their way here: the cases allow for them.
        EXPECT_LE(worst_of(seen, hard.source, axis), hard.expected[axis] + 0x1p-29 + (hard.floats ? 0.0 : hard.source.cloud_info.bounds.max.maxCoeff() * 0x1p-23)) << axis;
        worst = std::max(worst, worst_of(seen, hard.source, axis));
    }
    if (hard.floats) {
        EXPECT_NEAR(report.worst_error, worst, 0x1p-29);
    }

    const std::unique_ptr<PointSource> back = open_points({&path, 1});
    const PointBatch points = points_of(*back);
    if (hard.exact) {
        EXPECT_EQ(back->info().quantization, hard.source.cloud_info.quantization);
        EXPECT_EQ(points.x, hard.source.x);
        EXPECT_EQ(points.y, hard.source.y);
        EXPECT_EQ(points.z, hard.source.z);
    } else {
        const double limit = hard.max_error > 0.0 ? hard.max_error : hard.expected.maxCoeff();
        for (int axis = 0; axis < 3; ++axis) EXPECT_LE(worst_of(read_by_strata(*back), hard.source, axis), limit + 0x1p-29);
        EXPECT_LE(report.worst_error, limit * (1 + 1e-9));
        EXPECT_GT(report.worst_error, 0.2 * limit);  // the steps are as coarse as they may be
    }
    // Bounds without decoding are those of the points.
    Box3d bounds;
    for (const Vec3d& p : read_by_strata(*back)) bounds.extend(p);
    EXPECT_LE((bounds.min - back->info().bounds.min).cwiseAbs().maxCoeff(), 0x1p-29);
    EXPECT_LE((bounds.max - back->info().bounds.max).cwiseAbs().maxCoeff(), 0x1p-29);
}
INSTANTIATE_TEST_SUITE_P(Draco, MovedPoints, ::testing::ValuesIn(hard_cases()), [](const auto& info) { return std::string(info.param.name); });

// Every type at its ends, every kind of attribute: what comes back has the same name, type, meaning and bytes.
ColumnSource lively_cloud(size_t count, int rgb_most) {
    ColumnSource source = walk(count, {400'000, 300'000, 20'000}, Vec3d::Constant(0.001), {500000, 5300000, 0});
    source.cloud_info.crs = "PROJCS[\"made up\"]";
    Bits bits{7};
    const auto values = [&]<typename T>(int components, auto make) {
        std::vector<T> all;
        for (size_t i = 0; i < count; ++i)
            for (int c = 0; c < components; ++c) all.push_back(T(make(i)));
        return all;
    };
    using namespace attribute_name;
    const auto name = [](std::string_view text) { return std::string(text); };
    source.add({.name = name(kIntensity), .type = ScalarType::uint16}, values.operator()<uint16_t>(1, [&](size_t) { return bits.next(); }));
    source.add({.name = name(kReturnNumber), .type = ScalarType::uint8}, values.operator()<uint8_t>(1, [&](size_t i) { return 1 + i % 15; }));
    source.add({.name = name(kClassificationFlags), .type = ScalarType::uint8}, values.operator()<uint8_t>(1, [&](size_t) { return bits.next(); }));
    source.add({.name = name(kClassification), .type = ScalarType::uint8}, values.operator()<uint8_t>(1, [&](size_t i) { return i / 100; }));
    source.add({.name = name(kScanAngleRank), .type = ScalarType::int8}, values.operator()<int8_t>(1, [&](size_t i) { return int(i % 181) - 90; }));
    source.add({.name = name(kScanAngle), .type = ScalarType::int16}, values.operator()<int16_t>(1, [&](size_t) { return bits.next(); }));
    source.add({.name = name(kPointSourceId), .type = ScalarType::uint16}, values.operator()<uint16_t>(1, [&](size_t i) { return i % 2 ? 0 : 65535; }));
    std::vector<double> times = values.operator()<double>(1, [&](size_t i) { return 3e8 + double(i / 3) * 1e-5 + (i % 97 == 0 ? 1000.0 : 0.0); });
    times[0] = -0.0;
    times[1] = std::numeric_limits<double>::infinity();
    times[2] = std::numeric_limits<double>::quiet_NaN();
    times[3] = -1e308;
    times[4] = 5e-324;
    source.add({.name = name(kGpsTime), .type = ScalarType::float64}, times);
    source.add({.name = name(kRgb), .type = ScalarType::uint16, .components = 3}, values.operator()<uint16_t>(3, [&](size_t) { return bits.below(rgb_most + 1); }));
    for (const std::string_view axis : kNormal) source.add({.name = name(axis), .type = ScalarType::float32}, values.operator()<float>(1, [&](size_t) { return bits.below(2000) / 1000.0 - 1.0; }));
    source.add({.name = "any uint32", .description = "every bit", .type = ScalarType::uint32}, values.operator()<uint32_t>(1, [&](size_t) { return bits.next() >> 7; }));
    source.add({.name = "close uint32", .type = ScalarType::uint32}, values.operator()<uint32_t>(1, [&](size_t i) { return 2'000'000'000 + i; }));
    source.add({.name = "high uint32", .type = ScalarType::uint32}, values.operator()<uint32_t>(1, [&](size_t i) { return UINT32_MAX - i; }));
    source.add({.name = "any int32", .type = ScalarType::int32}, values.operator()<int32_t>(1, [&](size_t i) { return i % 3 == 0 ? INT32_MIN : i % 3 == 1 ? INT32_MAX : 0; }));
    source.add({.name = "close int32", .type = ScalarType::int32, .scale = 0.25, .offset = -3.5, .no_data = -7}, values.operator()<int32_t>(1, [&](size_t i) { return int(i % 1000) - 500; }));
    source.add({.name = "any int64", .type = ScalarType::int64}, values.operator()<int64_t>(1, [&](size_t i) { return i == 0 ? INT64_MIN : i == 1 ? INT64_MAX : int64_t(bits.next()); }));
    source.add({.name = "pairs", .type = ScalarType::uint64, .components = 2}, values.operator()<uint64_t>(2, [&](size_t) { return bits.next(); }));
    source.add({.name = "floats", .type = ScalarType::float32, .components = 2}, values.operator()<uint32_t>(2, [&](size_t) { return bits.next(); }));  // NaN too
    source.add({.name = "bytes", .type = ScalarType::int8, .components = 4}, values.operator()<int8_t>(4, [&](size_t) { return bits.next(); }));
    source.finish();
    return source;
}

void expect_same_attributes(const PointSource& found, const ColumnSource& expected) {
    const PointBatch points = points_of(found);
    ASSERT_EQ(found.info().attributes.size(), expected.cloud_info.attributes.size());
    for (size_t i = 0; i < expected.columns.size(); ++i) {
        const Attribute& wanted = expected.cloud_info.attributes[i];
        const int index = find_attribute(found.info().attributes, wanted.name);
        ASSERT_GE(index, 0) << wanted.name;
        const Attribute& attribute = found.info().attributes[size_t(index)];
        EXPECT_EQ(attribute.type, wanted.type) << wanted.name;
        EXPECT_EQ(attribute.components, wanted.components) << wanted.name;
        EXPECT_EQ(attribute.description, wanted.description) << wanted.name;
        EXPECT_EQ(attribute.scale, wanted.scale) << wanted.name;
        EXPECT_EQ(attribute.offset, wanted.offset) << wanted.name;
        EXPECT_TRUE(attribute.no_data == wanted.no_data || (std::isnan(attribute.no_data) && std::isnan(wanted.no_data))) << wanted.name;
        EXPECT_TRUE(points.columns[size_t(index)] == expected.columns[i]) << wanted.name;
    }
}

TEST(DracoWriter, EveryAttributeComesBack) {
    const TemporaryFolder folder;
    for (const int rgb_most : {255, 65535}) {
        const ColumnSource source = lively_cloud(3000, rgb_most);
        const std::string path = folder.file(std::to_string(rgb_most) + ".drc");
        EXPECT_TRUE(make_draco_writer(path, {.durability = kUnsynced})->write(source).exact);
        const std::unique_ptr<PointSource> back = open_points({&path, 1});
        expect_same_attributes(*back, source);
        EXPECT_EQ(back->info().crs, source.cloud_info.crs);
        EXPECT_TRUE(back->info().notes.empty());
    }
}

// 8 bits become bytes, which all viewers know, but not in a dark block of a cloud of 16.
TEST(DracoWriter, DepthOfColorIsThatOfTheCloud) {
    const TemporaryFolder folder;
    const auto type_in = [&](int rgb_most, int blocks) {
        ColumnSource source = walk(4000, {10, 10, 10}, Vec3d::Ones(), Vec3d::Zero());
        std::vector<uint16_t> rgb(12000, 200);
        rgb.back() = uint16_t(rgb_most);
        source.add({.name = "rgb", .type = ScalarType::uint16, .components = 3}, rgb);
        const drc::BlockFrame frame = drc::block_frame(source, 0.0, 1);
        source.batches.assign(size_t(blocks), 4000 / size_t(blocks));
        PointBatch first;
        const int wanted = 0;
        source.read_batch(0, {&wanted, 1}, first);
        const drc::EncodedBlock block = drc::encode_block(first, source.info(), frame);
        return drc::read_header(*memory_source("block", block.bytes)).attributes[1].type;
    };
    EXPECT_EQ(type_in(255, 1), ScalarType::uint8);
    EXPECT_EQ(type_in(256, 1), ScalarType::uint16);
    EXPECT_EQ(type_in(65535, 2), ScalarType::uint16);  // though its first half is dark
}

std::vector<std::string> files_in(const std::string& folder) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
}

// Batches of any size, one longer than a block: all points in their order, and the same bytes whatever the threads.
TEST(DracoWriter, AFolderHoldsBlocks) {
    const size_t block = DracoSource::kWholeBatchPoints, count = 3 * block + 1234;
    ColumnSource source = walk(count, {400'000, 300'000, 20'000}, Vec3d::Constant(0.001), {500000, 5300000, 0});
    std::vector<uint32_t> numbers(count);
    for (size_t i = 0; i < count; ++i) numbers[i] = uint32_t(i);
    source.add({.name = "number", .type = ScalarType::uint32}, numbers);
    source.batches = {1000, 0, 2 * block + 5, 7, 300, count - 2 * block - 1312};
    const TemporaryFolder folder;
    std::vector<std::string> names;
    for (const int threads : {1, 2, 3, 7}) {
        const std::string path = folder.file("threads" + std::to_string(threads));
        const DracoWriteReport report = make_draco_writer(path, {.durability = kUnsynced, .threads = threads, .memory_bytes = uint64_t{4} << 30})->write(source);
        EXPECT_EQ(report.points, count);
        EXPECT_EQ(report.blocks, files_in(path).size());
        EXPECT_GE(report.blocks, 4u);
        if (threads == 1) {
            names = files_in(path);
            EXPECT_EQ(names.front(), "000000.drc");
            continue;
        }
        ASSERT_EQ(files_in(path), names);
        for (const std::string& name : names) EXPECT_TRUE(test::file_contents(path + "/" + name) == test::file_contents(folder.file("threads1/" + name))) << name;
    }
    const std::vector<std::string> words = {folder.file("threads1")};
    const std::unique_ptr<PointSource> back = open_points(point_files(words));
    EXPECT_EQ(back->info().points, count);
    EXPECT_EQ(back->info().quantization.scale, source.cloud_info.quantization.scale);
    const PointBatch points = points_of(*back);
    EXPECT_TRUE(points.x == source.x && points.y == source.y && points.z == source.z);
    EXPECT_TRUE(points.columns[0] == source.columns[0]);
    // And they lie in one frame for those who know nothing of quanta.
    const std::vector<Vec3d> last = decoded_by_draco(folder.file("threads1/" + names.back()));
    EXPECT_LE(std::abs(last.back().x() - source.cloud_info.quantization.world_from_quanta({source.x.back(), 0, 0}).x()), 0.0005 + 1e-9);
}

// Of the points that lie out of reach of the frame's zero, too.
TEST(DracoWriter, AFarBlockHasItsOwnZero) {
    ColumnSource source = walk(100, {100, 100, 100}, Vec3d::Constant(0.001), {500000, 5300000, 0});
    source.x.back() += 100'000'000;  // 100 km
    source.cloud_info.bounds = {};
    source.finish();
    source.batches = {99, 1};
    const drc::BlockFrame frame = drc::block_frame(source, 0.0005, 1);
    for (uint64_t i = 0; i < 2; ++i) {
        PointBatch points;
        source.read_batch(i, {}, points);
        const drc::EncodedBlock block = drc::encode_block(points, source.info(), frame);
        EXPECT_TRUE(block.exact);
        const DracoSource back(memory_source("block.drc", block.bytes));
        EXPECT_EQ(points_of(back).x, points.x);
        EXPECT_EQ(drc::read_header(*memory_source("block", block.bytes)).attributes[0].type, ScalarType::float32);
    }
}

template <typename Function>
void expect_error(ErrorKind kind, const std::string& part, Function function) {
    try {
        function();
        ADD_FAILURE() << "no error: " << part;
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, kind) << error.what();
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
}

TEST(DracoWriter, WhatCannotBeWrittenLeavesNothing) {
    const TemporaryFolder folder;
    ColumnSource none;
    none.finish();
    for (const char* name : {"none.drc", "none"})
        expect_error(ErrorKind::unsupported, "no points to write", [&] { make_draco_writer(folder.file(name), {})->write(none); });
    const ColumnSource many = walk(3'000'000, {100, 100, 100}, Vec3d::Ones(), Vec3d::Zero());
    expect_error(ErrorKind::limit, "a folder of blocks", [&] { make_draco_writer(folder.file("many.drc"), {.memory_bytes = 100 << 20})->write(many); });
    expect_error(ErrorKind::limit, "MiB are allowed", [&] { make_draco_writer(folder.file("many"), {.memory_bytes = 80 << 20})->write(many); });
    const ColumnSource wide = walk(100, {2'000'000'000, 100, 100}, Vec3d::Ones(), Vec3d::Zero());
    expect_error(ErrorKind::limit, "a greater --max-error is needed", [&] { make_draco_writer(folder.file("wide.drc"), {.max_error = 0.5})->write(wide); });
    EXPECT_TRUE(files_in(folder.path()).empty());
}

TEST(DracoWriter, AnEarlierOutputStaysUnlessToldOtherwise) {
    const TemporaryFolder folder;
    const ColumnSource source = walk(10, {100, 100, 100}, Vec3d::Ones(), Vec3d::Zero());
    for (const char* name : {"out.drc", "out"}) {
        make_draco_writer(folder.file(name), {.durability = kUnsynced})->write(source);
        expect_error(ErrorKind::io, "--overwrite", [&] { make_draco_writer(folder.file(name), {}); });
        make_draco_writer(folder.file(name), {.overwrite = true, .durability = kUnsynced})->write(source);
    }
    fs::create_directory(folder.file("mine"));
    std::ofstream(folder.file("mine/notes.txt")) << "kept";
    expect_error(ErrorKind::io, "is no earlier output", [&] { make_draco_writer(folder.file("mine"), {.overwrite = true}); });

    // What comes while the writer is at work is kept as well.
    const std::unique_ptr<DracoWriter> writer = make_draco_writer(folder.file("out"), {.overwrite = true, .durability = kUnsynced});
    std::ofstream(folder.file("out/late.txt")) << "kept";
    expect_error(ErrorKind::io, "holds 'late.txt'", [&] { writer->write(source); });
    EXPECT_TRUE(fs::exists(folder.file("out/late.txt")));
}

// Our own metadata may lie as well as Draco's; each cut and flip is refused or read to the last point.
TEST(DracoWriter, DamagedFilesAreRefusedOrWhole) {
    const TemporaryFolder folder;
    const std::string path = folder.file("out.drc");
    make_draco_writer(path, {.durability = kUnsynced})->write(lively_cloud(200, 255));
    const std::string text = test::file_contents(path);
    const auto* const data = reinterpret_cast<const std::byte*>(text.data());
    const std::vector<std::byte> whole(data, data + text.size());
    size_t refused = 0, read = 0;
    const auto attempt = [&](std::vector<std::byte> bytes) {
        try {
            const DracoSource source(memory_source("test.drc", std::move(bytes)));
            EXPECT_EQ(points_of(source).size, source.info().points);
            ++read;
        } catch (const Error& error) {
            EXPECT_EQ(std::string(error.what()).rfind("test.drc: ", 0), 0u) << error.what();
            ++refused;
        }
    };
    for (size_t end = 0; end < whole.size(); end += end < 2500 ? 7 : 101) attempt({whole.begin(), whole.begin() + ptrdiff_t(end)});
    EXPECT_EQ(read, 0u);
    Bits bits;
    for (size_t at = 0; at < 2500; ++at) {
        std::vector<std::byte> bytes = whole;
        bytes[at] ^= std::byte(1 << bits.below(8));
        attempt(std::move(bytes));
    }
    EXPECT_GT(refused, 500u);
    EXPECT_GT(read, 100u);
}

}  // namespace
}  // namespace strata
