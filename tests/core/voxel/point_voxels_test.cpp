#include "core/voxel/point_voxels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <random>

#include "core/error.h"
#include "core/voxel/voxel_code_kernel.h"
#include "core/voxel/voxel_record.h"

namespace strata {
namespace {

// Points with colors and normals in memory.
class ColoredSource : public PointSource {
public:
    struct Point {
        Vec3i quanta = Vec3i::Zero();
        std::array<uint16_t, 3> rgb = {};
        Vec3f normal = Vec3f::Zero();
    };

    ColoredSource(std::vector<Point> points, const Quantization& quantization, size_t batch = 10'000)
        : points_(std::move(points)), batch_(batch) {
        info_.points = points_.size();
        info_.quantization = quantization;
        info_.attributes = {{.name = "rgb", .type = ScalarType::uint16, .components = 3}};
        for (const std::string_view name : attribute_name::kNormal)
            info_.attributes.push_back({.name = std::string(name), .type = ScalarType::float32});
        for (const Point& point : points_) info_.bounds.extend(quantization.world_from_quanta(point.quanta));
    }

    CloudInfo& changeable_info() { return info_; }
    const std::vector<Point>& points() const { return points_; }
    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (points_.size() + batch_ - 1) / batch_; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t begin = index * batch_, size = std::min(batch_, points_.size() - begin);
        resize_batch(out, size, info_.attributes, wanted);
        for (size_t i = 0; i < size; ++i) {
            const Point& point = points_[begin + i];
            out.x[i] = point.quanta.x();
            out.y[i] = point.quanta.y();
            out.z[i] = point.quanta.z();
            if (!out.columns[0].empty()) std::memcpy(out.columns[0].data() + 6 * i, point.rgb.data(), 6);
            for (size_t axis = 0; axis < 3; ++axis)
                if (!out.columns[1 + axis].empty()) out.column<float>(1 + axis)[i] = point.normal[Eigen::Index(axis)];
        }
    }

private:
    std::vector<Point> points_;
    size_t batch_;
    CloudInfo info_;
};

// A scratch store in memory that counts what is left in it.
class MemoryScratch : public ScratchStore {
public:
    void write(uint64_t offset, std::span<const std::byte> bytes) override {
        const std::lock_guard lock(mutex_);
        if (bytes_.size() < offset + bytes.size()) bytes_.resize(offset + bytes.size());
        std::copy(bytes.begin(), bytes.end(), bytes_.begin() + ptrdiff_t(offset));
        held_ += bytes.size();
    }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        const std::lock_guard lock(mutex_);
        ASSERT_LE(offset + out.size(), bytes_.size());
        std::copy_n(bytes_.begin() + ptrdiff_t(offset), out.size(), out.begin());
    }
    void discard(uint64_t, uint64_t size) override {
        const std::lock_guard lock(mutex_);
        held_ -= size;
    }
    uint64_t held() const { return held_; }

private:
    mutable std::mutex mutex_;
    std::vector<std::byte> bytes_;
    uint64_t held_ = 0;
};

struct Voxels {
    VoxelBatch all;  // every batch, one behind the other
    PointVoxelReport report;
};

Voxels voxelize(const PointSource& source, const VoxelFrame& frame, const PointVoxelSettings& settings) {
    Voxels voxels;
    voxels.report = voxelize_points(source, frame, settings, [&](const VoxelBatch& batch) {
        const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
        append(voxels.all.blocks, batch.blocks);
        append(voxels.all.counts, batch.counts);
        append(voxels.all.colors, batch.colors);
        append(voxels.all.normals, batch.normals);
    });
    return voxels;
}

constexpr VoxelAttributes kAll = {.count = true, .color = true, .normal = true};

PointVoxelSettings with(VoxelAttributes attributes, int threads = 2) {
    PointVoxelSettings settings;
    settings.attributes = attributes;
    settings.threads = threads;
    return settings;
}

void expect_equal(const Voxels& a, const Voxels& b) {
    EXPECT_EQ(a.all.blocks, b.all.blocks);
    EXPECT_EQ(a.all.counts, b.all.counts);
    EXPECT_EQ(a.all.colors, b.all.colors);
    EXPECT_EQ(a.all.normals, b.all.normals);
    EXPECT_EQ(a.report.points, b.report.points);
    EXPECT_EQ(a.report.outside, b.report.outside);
    EXPECT_EQ(a.report.voxels, b.report.voxels);
}

// The plain way: a map of voxels. For coordinates where doubles are exact
// (scale and voxel size powers of two).
Voxels twin(const ColoredSource& source, const VoxelFrame& frame, int rgb_bits) {
    struct Sums {
        uint64_t count = 0;
        double color[3] = {}, normal[3] = {};
    };
    std::map<uint64_t, Sums> voxels;
    Voxels result;
    for (const ColoredSource::Point& point : source.points()) {
        ++result.report.points;
        const Vec3d p = frame.voxel_from_world(source.info().quantization.world_from_quanta(point.quanta)).array().floor();
        if (p.minCoeff() < 0.0 || p.maxCoeff() >= frame.side()) {
            ++result.report.outside;
            continue;
        }
        Sums& sums = voxels[octant_code(uint32_t(p.x()), uint32_t(p.y()), uint32_t(p.z()))];
        ++sums.count;
        for (int i = 0; i < 3; ++i) {
            sums.color[i] += point.rgb[size_t(i)];
            if (point.normal.norm() > 0.0f)
                sums.normal[i] += std::round(32767.0 * double(point.normal[i]) / point.normal.cast<double>().norm());
        }
    }
    for (const auto& [code, sums] : voxels) {
        if (result.all.blocks.empty() || result.all.blocks.back().code != code / 64) result.all.blocks.push_back({code / 64, 0, 0});
        result.all.blocks.back().mask |= uint64_t{1} << code % 64;
        result.all.counts.push_back(uint32_t(sums.count));
        const Vec3d normal(sums.normal[0], sums.normal[1], sums.normal[2]);
        VoxelColor color;
        VoxelNormal direction = {};
        for (int i = 0; i < 3; ++i) {
            const double mean = sums.color[i] / double(sums.count);
            color[size_t(i)] = uint8_t(rgb_bits == 16 ? std::floor(mean / 256.0) : std::floor(mean + 0.5));
            if (normal.norm() > 0.0) direction[size_t(i)] = int8_t(std::round(127.0 * normal[i] / normal.norm()));
        }
        result.all.colors.push_back(color);
        result.all.normals.push_back(direction);
    }
    result.report.voxels = voxels.size();
    return result;
}

// Blobs of different density, so that voxels hold one point or thousands; some
// points lie outside of the frame below.
ColoredSource random_cloud(size_t points, uint32_t seed, uint16_t most_channel = 65535) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<ColoredSource::Point> cloud(points);
    Vec3d center = Vec3d::Zero();
    double width = 1.0;
    for (size_t i = 0; i < points; ++i) {
        if (i % 5'000 == 0) {
            center = 3000.0 * Vec3d(normal(random), normal(random), normal(random));
            width = std::exp(2.0 + 2.0 * normal(random));
        }
        ColoredSource::Point& point = cloud[i];
        point.quanta = (center + width * Vec3d(normal(random), normal(random), normal(random))).array().round().cast<int>();
        for (uint16_t& channel : point.rgb) channel = uint16_t(random() % (most_channel + 1u));
        if (random() % 8 != 0) point.normal = Vec3d(normal(random), normal(random), 2.0 + normal(random)).cast<float>();
    }
    return {std::move(cloud), {.scale = Vec3d::Constant(0.0625), .offset = {1024.0, -512.0, 0.25}}};
}

VoxelFrame frame_of_random_cloud(double voxel_size = 0.5) {
    return {.origin = {768.0, -768.0, -256.0}, .voxel_size = voxel_size, .levels = 5};
}

TEST(PointVoxels, EqualThePlainWay) {
    for (const uint32_t seed : {1u, 2u, 3u})
        for (const double size : {0.25, 0.5, 8.0}) {
            const ColoredSource source = random_cloud(60'000, seed);
            const VoxelFrame frame = frame_of_random_cloud(size);
            const Voxels expected = twin(source, frame, 16), found = voxelize(source, frame, with(kAll));
            expect_equal(found, expected);
            if (size < 8.0) EXPECT_GT(found.report.outside, 0u);
            uint64_t sum = 0;
            for (const uint32_t count : found.all.counts) sum += count;
            EXPECT_EQ(sum + found.report.outside, 60'000u);
        }
}

TEST(PointVoxels, ColorsOfEightBits) {
    const ColoredSource source = random_cloud(20'000, 4, 255);
    expect_equal(voxelize(source, frame_of_random_cloud(), with(kAll)), twin(source, frame_of_random_cloud(), 8));
}

// Every choice of attributes gives its columns, the same ones as all together,
// and no others.
TEST(PointVoxels, OnlyWhatIsAskedFor) {
    const ColoredSource source = random_cloud(20'000, 5);
    const Voxels all = voxelize(source, frame_of_random_cloud(), with(kAll));
    for (int choice = 0; choice < 8; ++choice) {
        const VoxelAttributes attributes = {.count = (choice & 1) != 0, .color = (choice & 2) != 0, .normal = (choice & 4) != 0};
        const Voxels some = voxelize(source, frame_of_random_cloud(), with(attributes));
        EXPECT_EQ(some.all.blocks, all.all.blocks);
        EXPECT_EQ(some.all.counts, attributes.count ? all.all.counts : std::vector<uint32_t>());
        EXPECT_EQ(some.all.colors, attributes.color ? all.all.colors : std::vector<VoxelColor>());
        EXPECT_EQ(some.all.normals, attributes.normal ? all.all.normals : std::vector<VoxelNormal>());
    }
}

TEST(PointVoxels, NeitherThreadsNorMemoryShow) {
    const ColoredSource source = random_cloud(100'000, 6);
    for (const VoxelAttributes attributes : {VoxelAttributes{}, VoxelAttributes{.count = true}, kAll}) {
        const Voxels expected = voxelize(source, frame_of_random_cloud(), with(attributes, 1));
        for (const int threads : attributes == kAll ? std::vector<int>{1, 2, 3, 7} : std::vector<int>{3})
            for (const uint64_t memory_bytes : {uint64_t{0}, uint64_t{1} << 18, uint64_t{1} << 21, uint64_t{1} << 30})
                for (const bool scratch : {false, true}) {
                    MemoryScratch store;
                    PointVoxelSettings settings = with(attributes, threads);
                    settings.memory_bytes = memory_bytes;
                    settings.scratch = scratch ? &store : nullptr;
                    const Voxels found = voxelize(source, frame_of_random_cloud(), settings);
                    expect_equal(found, expected);
                    if (scratch && memory_bytes < uint64_t{1} << 21) EXPECT_GT(found.report.scratch_bytes, 0u);
                    if (!scratch || memory_bytes == uint64_t{1} << 30) EXPECT_EQ(found.report.scratch_bytes, 0u);
                    EXPECT_EQ(store.held(), 0u);
                }
    }
}

// More equal points than a record may stand for, and than a bucket has room
// for.
TEST(PointVoxels, EqualPoints) {
    std::vector<ColoredSource::Point> points(1'000'000, {.quanta = {7, 8, 9}, .rgb = {100, 65535, 300}, .normal = {0, 0, -2}});
    points.push_back({.quanta = {0, 0, 0}});
    const ColoredSource source(std::move(points), {.scale = Vec3d::Ones()}, 100'000);
    for (const bool small : {false, true}) {
        MemoryScratch store;
        PointVoxelSettings settings = with(kAll);
        settings.memory_bytes = small ? 0 : uint64_t{1} << 30;
        settings.scratch = &store;
        const Voxels found = voxelize(source, {.levels = 10}, settings);
        EXPECT_EQ(found.report.voxels, 2u);
        EXPECT_EQ(found.all.blocks, (std::vector<VoxelBlock>{{0, 1, 0}, {octant_code(1, 2, 2), uint64_t{1} << mask_bit(7, 8, 9), 0}}));
        EXPECT_EQ(found.all.counts, (std::vector<uint32_t>{1, 1'000'000}));
        EXPECT_EQ(found.all.colors[1], (VoxelColor{0, 255, 1}));
        EXPECT_EQ(found.all.normals, (std::vector<VoxelNormal>{{0, 0, 0}, {0, 0, -127}}));
        // Each run became two records of its own.
        EXPECT_LT(found.report.scratch_bytes, 10'000u);
    }
}

// Two voxels in turn, far apart, so that no bucket but one of 4^3 voxels can be
// small: the sums are made in place.
TEST(PointVoxels, OneDenseBlockBeyondMemory) {
    std::vector<ColoredSource::Point> points;
    std::mt19937 random(8);
    for (size_t i = 0; i < 300'000; ++i) {
        const bool far = random() % 2 == 0;
        points.push_back(
            {.quanta = far ? Vec3i(1'000'000, 1'000'000, 1'000'000) : Vec3i(int(random() % 4), int(random() % 4), int(random() % 4)),
             .rgb = {uint16_t(random()), uint16_t(random()), uint16_t(random())}});
    }
    const ColoredSource source(std::move(points), {.scale = Vec3d::Ones()},
                               40);  // batches so small that hardly any points become one
    MemoryScratch store;
    PointVoxelSettings settings = with({.count = true, .color = true}, 3);
    settings.memory_bytes = 0;
    settings.scratch = &store;
    const Voxels found = voxelize(source, {.levels = 10}, settings);
    EXPECT_EQ(found.report.voxels, 65u);
    EXPECT_GT(found.report.scratch_bytes, 1'000'000u);
    expect_equal(found, voxelize(source, {.levels = 10}, with({.count = true, .color = true}, 1)));
}

// Millimeter points and voxels of 0.1 m far from the origin: a point whose
// decimals lie on a face is in the voxel above, whatever doubles make of 0.1 *
// k. Integers say where each lies.
TEST(PointVoxels, PointsOnFacesGoUp) {
    for (const double offset : {0.0, 500'000.0, 5'300'000.0, 6'378'137.0, -6'378'137.0})
        for (const int voxel_mm : {1, 3, 10, 100, 300, 700}) {
            const VoxelFrame frame = {.origin = Vec3d::Constant(offset - 3.0), .voxel_size = voxel_mm / 1000.0, .levels = 10};
            const Quantization quantization = {.scale = Vec3d::Constant(0.001), .offset = Vec3d::Constant(offset + 2.0)};
            const VoxelFromQuanta map(frame, quantization);
            std::vector<int32_t> quanta;
            for (int64_t voxel = -2; voxel <= int64_t{1} << 20; voxel += voxel < 3000 ? 1 : 997)
                for (const int beside : {-1, 0, 1}) {
                    const int64_t mm = voxel * voxel_mm + beside - 5000;
                    if (std::abs(mm) < INT32_MAX) quanta.push_back(int32_t(mm));
                }
            std::vector<uint64_t> codes(quanta.size());
            find_voxel_codes(map, quanta.data(), quanta.data(), quanta.data(), codes);
            for (size_t i = 0; i < quanta.size(); ++i) {
                const int64_t mm = int64_t(quanta[i]) + 5000, voxel = mm < 0 ? -1 : mm / voxel_mm;
                const uint64_t expected =
                    voxel < 0 || voxel >= int64_t{1} << 20 ? kNoVoxel : octant_code(uint32_t(voxel), uint32_t(voxel), uint32_t(voxel));
                ASSERT_EQ(codes[i], expected) << "offset " << offset << ", voxels of " << voxel_mm << " mm, at " << mm << " mm";
            }
        }
}

TEST(PointVoxels, EveryInstructionSetFindsTheSameVoxels) {
    std::mt19937 random(9);
    for (const double scale : {1e-9, 0.001, 1.0, 1e6, 1e300}) {
        const VoxelFromQuanta map({.origin = Vec3d(-1e5, 3.0, 1e7), .voxel_size = 0.37, .levels = 10},
                                  {.scale = Vec3d::Constant(scale), .offset = Vec3d(0.1, 0.2, 1e7)});
        std::vector<int32_t> x(1000), y(1000), z(1000);
        for (size_t i = 0; i < x.size(); ++i)
            x[i] = int32_t(random()) >> random() % 32, y[i] = int32_t(random()) >> random() % 32, z[i] = int32_t(random()) >> random() % 32;
        std::vector<uint64_t> expected(x.size()), found(x.size());
        find_voxel_codes(map, x.data(), y.data(), z.data(), expected, SimdLevel::baseline);
        for (const SimdLevel level : simd_levels()) {
            find_voxel_codes(map, x.data(), y.data(), z.data(), found, level);
            EXPECT_EQ(found, expected) << name_of(level);
        }
    }
}

// The greatest points of a cloud lie in the last voxel where the frame has room
// for them, and outside where it has not.
TEST(PointVoxels, TheFarFaceOfTheFrame) {
    const ColoredSource source({{.quanta = {0, 0, 0}}, {.quanta = {15, 15, 15}}, {.quanta = {16, 0, 0}}}, {.scale = Vec3d::Ones()});
    const Voxels exact = voxelize(source, {.levels = 2}, with({.count = true}));
    EXPECT_EQ(exact.report.outside, 1u);
    EXPECT_EQ(exact.report.voxels, 2u);
    const Voxels wider = voxelize(source, frame_of_resolution(source.info().bounds, 16), with({.count = true}));
    EXPECT_EQ(wider.report.outside, 0u);
    EXPECT_EQ(wider.report.voxels, 3u);
}

TEST(PointVoxels, SourceWithoutPoints) {
    const ColoredSource source({}, {.scale = Vec3d::Ones()});
    const Voxels found = voxelize(source, {.levels = 10}, with(kAll, 3));
    EXPECT_EQ(found.report, PointVoxelReport{});
    EXPECT_TRUE(found.all.blocks.empty());
}

// Headers lie; only what they say of the number of points is looked at, to
// share memory out.
TEST(PointVoxels, WhatTheHeaderSaysDoesNotShow) {
    ColoredSource source = random_cloud(50'000, 10);
    const Voxels expected = voxelize(source, frame_of_random_cloud(), with(kAll));
    const double infinity = std::numeric_limits<double>::infinity();
    for (const uint64_t points : {uint64_t{0}, uint64_t{1}, uint64_t{1} << 40, ~uint64_t{0}})
        for (const Box3d& bounds : {Box3d(), Box3d(Vec3d::Constant(-infinity), Vec3d::Constant(infinity)),
                                    Box3d(Vec3d::Zero(), Vec3d::Ones()), Box3d(Vec3d::Ones(), Vec3d::Constant(std::nan("")))}) {
            source.changeable_info().points = points;
            source.changeable_info().bounds = bounds;
            MemoryScratch store;
            PointVoxelSettings settings = with(kAll);
            settings.memory_bytes = 1 << 20;
            settings.scratch = &store;
            expect_equal(voxelize(source, frame_of_random_cloud(), settings), expected);
        }
}

TEST(PointVoxels, AttributesThatAreMissingAreNamed) {
    ColoredSource source = random_cloud(10, 11);
    source.changeable_info().attributes.clear();
    EXPECT_THROW(voxelize(source, frame_of_random_cloud(), with({.color = true})), Error);
    EXPECT_THROW(voxelize(source, frame_of_random_cloud(), with({.normal = true})), Error);
}

// Only directions count; what has none is left out, and so is what is no
// number.
TEST(PointVoxels, NormalsOfAnyLength) {
    const float infinity = std::numeric_limits<float>::infinity(), nan = std::nanf("");
    std::vector<ColoredSource::Point> points;
    const auto add = [&](int x, Vec3f normal) { points.push_back({.quanta = {x, 0, 0}, .normal = normal}); };
    add(0, {3e38f, 0, 0}), add(0, {0, 1e-40f, 0});
    add(1, {0, 0, 0}), add(1, {nan, 1, 1}), add(1, {1, infinity, 1}), add(1, {-infinity, nan, 0});
    add(2, {0, 0, -5}), add(2, {nan, nan, nan});
    add(3, {1, 2, 3}), add(3, {-1, -2, -3});
    const ColoredSource source(std::move(points), {.scale = Vec3d::Ones()});
    const Voxels found = voxelize(source, {.levels = 1}, with({.normal = true}));
    EXPECT_EQ(found.all.normals, (std::vector<VoxelNormal>{{90, 90, 0}, {0, 0, 0}, {0, 0, -127}, {0, 0, 0}}));
}

TEST(PointVoxels, FailuresOfSinkAndSourceEndAll) {
    struct Broken : ColoredSource {
        using ColoredSource::ColoredSource;
        void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
            if (index == 3) throw Error(ErrorKind::malformed, "batch 3");
            ColoredSource::read_batch(index, wanted, out);
        }
    };
    const ColoredSource source = random_cloud(200'000, 12);
    const Broken broken(source.points(), source.info().quantization);
    for (const int threads : {1, 4}) {
        EXPECT_THROW(voxelize(broken, frame_of_random_cloud(), with(kAll, threads)), Error);
        PointVoxelSettings settings = with(kAll, threads);
        settings.memory_bytes = 1 << 18;
        int batches = 0;
        EXPECT_THROW(voxelize_points(source, frame_of_random_cloud(), settings,
                                     [&](const VoxelBatch&) {
                                         if (++batches == 3) throw Error(ErrorKind::io, "full");
                                     }),
                     Error);
        EXPECT_EQ(batches, 3);
    }
}

// What records stand for is what was put into them, whatever the numbers and
// however many records they take.
template <RecordForm form>
void expect_sums_come_back(VoxelSums sums, size_t most_records) {
    std::vector<VoxelRecord<form>> records;
    append_records<form>(123456789, sums, records);
    EXPECT_LE(records.size(), most_records);
    std::reverse(records.begin(), records.end());
    VoxelSums found;
    for (const VoxelRecord<form>& record : records) {
        EXPECT_EQ(record.code(), 123456789u);
        found.add(record);
    }
    if (!form.color) sums.color = {};
    if (!form.normal) sums.normal = {};
    EXPECT_EQ(found.count, sums.count);
    EXPECT_EQ(found.color, sums.color);
    EXPECT_EQ(found.normal, sums.normal);
}

TEST(VoxelRecord, SumsComeBack) {
    const auto expect_all = [](const VoxelSums& sums, size_t most_records) {
        expect_sums_come_back<RecordForm{.color = true}>(sums, most_records);
        expect_sums_come_back<RecordForm{.normal = true}>(sums, most_records);
        expect_sums_come_back<RecordForm{.count = true, .color = true, .normal = true}>(sums, most_records);
    };
    for (const uint64_t count : {1u, 2u, 15u, 16u}) {
        expect_all({count, {count * 65535, 0, count}, {int64_t(count) * -32767, int64_t(count) * 32767, -1}}, 1);
        expect_all({count, {0, count * 65535, count * 65535}, {0, 0, int64_t(count) * -32767}}, 1);
    }
    expect_all({17, {17 * 65535, 17, 5}, {17 * 32767, 3, -17 * 32767}}, 2);
    expect_all({65536, {uint64_t{65536} * 65535, 65536, 0}, {-65536 * int64_t{32767}, 65536 * int64_t{32767}, -1}}, 2);
    expect_all({uint64_t{5} << 32, {uint64_t{9} << 32, 1, uint64_t{3} << 31}, {-(int64_t{1} << 33), int64_t{1} << 33, 7}}, 30);
    expect_all({0, {0, 5, 6}, {0, 7, -8}}, 2);  // the second of two wide records
    for (const uint64_t count : {1u, 2u, 3u, 255u, 65535u, 65536u, 1000000u})
        expect_sums_come_back<RecordForm{.count = true}>({count, {}, {}}, std::min<size_t>(count, 48));
}

TEST(VoxelSums, CountsSaturateAndMeansGoOn) {
    const uint64_t count = (uint64_t{1} << 32) + 65536;
    const VoxelSums sums = {count, {count * 65535, count * (65535 - 256), count * (65535 - 512)}, {-int64_t(count) * 32767, 0, 0}};
    EXPECT_EQ(saturated_count(sums.count), UINT32_MAX);
    EXPECT_EQ(saturated_count(7), 7u);
    EXPECT_EQ(mean_color(sums, 16), (VoxelColor{255, 254, 253}));
    EXPECT_EQ(mean_normal(sums), (VoxelNormal{-127, 0, 0}));
}

}  // namespace
}  // namespace strata
