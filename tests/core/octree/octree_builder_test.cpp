#include "core/octree/octree_builder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <mutex>
#include <set>
#include <unordered_map>

#include "core/error.h"
#include "core/math/random.h"
#include "core/octree/octree_frame.h"
#include "core/octree/partition.h"
#include "core/octree/record_layout.h"
#include "core/octree/subtree_builder.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

constexpr size_t kRecordBytes = 16;  // position and index

// Keeps what it is given, in the order it comes.
class MemorySink : public NodeSink {
public:
    void begin(const BuiltCloud& built) override { cloud = built; }
    void encode(std::span<const std::byte> records, uint32_t points, std::vector<std::byte>& out) const override {
        EXPECT_EQ(records.size(), points * kRecordBytes);
        out.insert(out.end(), records.begin(), records.end());
    }
    void append(std::span<const BuiltNode> added, std::span<const std::byte> added_bytes) override {
        for (BuiltNode node : added) {
            node.byte_offset += bytes.size();
            nodes.push_back(node);
        }
        bytes.insert(bytes.end(), added_bytes.begin(), added_bytes.end());
    }
    void finish() override { finished = true; }

    const std::byte* record(const BuiltNode& node, size_t i) const { return bytes.data() + node.byte_offset + i * kRecordBytes; }

    BuiltCloud cloud;
    std::vector<BuiltNode> nodes;
    std::vector<std::byte> bytes;
    bool finished = false;
};

class MemoryScratch : public ScratchStore {
public:
    void write(uint64_t offset, std::span<const std::byte> added) override {
        const std::lock_guard lock(mutex);
        if (bytes.size() < offset + added.size()) bytes.resize(offset + added.size());
        std::copy(added.begin(), added.end(), bytes.begin() + ptrdiff_t(offset));
    }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        const std::lock_guard lock(mutex);
        std::copy_n(bytes.begin() + ptrdiff_t(offset), out.size(), out.begin());
    }
    void discard(uint64_t offset, uint64_t size) override {
        const std::lock_guard lock(mutex);
        std::fill_n(bytes.begin() + ptrdiff_t(offset), size, std::byte{0xee});  // must not be read again
    }

    mutable std::mutex mutex;
    std::vector<std::byte> bytes;
};

constexpr uint64_t kRoomy = uint64_t{1} << 31;

// Sanitized builds look at a share of the points where the twin takes most of the time; what is built stays the same.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr size_t kTwinStride = 31;
#else
constexpr size_t kTwinStride = 1;
#endif

// Builds and checks what holds for every cloud: each point in exactly one node, inside the node's cube, whose
// ancestors exist; leaves within their limit unless their points coincide.
MemorySink build(const MemorySource& source, int threads = 2, uint64_t memory_bytes = kRoomy, ScratchStore* scratch = nullptr) {
    MemorySink sink;
    const BuildReport report = build_octree(source, {.threads = threads, .memory_bytes = memory_bytes}, scratch, sink);
    EXPECT_TRUE(sink.finished);
    EXPECT_EQ(report.points_read, source.positions().size());
    EXPECT_EQ(report.points_written, source.positions().size());

    std::set<NodeKey> keys, parents;
    for (const BuiltNode& node : sink.nodes) {
        EXPECT_TRUE(keys.insert(node.key).second) << node_name(node.key) << " twice";
        if (node.key.level > 0) parents.insert(node.key.parent());
    }
    std::vector<bool> seen(source.positions().size(), false);
    for (const BuiltNode& node : sink.nodes) {
        EXPECT_TRUE(node.key.level == 0 || keys.contains(node.key.parent())) << node_name(node.key);
        const double side = std::ldexp(sink.cloud.cube_side, -int(node.key.level));
        std::set<std::array<int, 3>> places;
        for (size_t i = 0; i < node.points; ++i) {
            const Vec3i p = record_position(sink.record(node, i));
            uint32_t index = 0;
            std::memcpy(&index, sink.record(node, i) + 12, 4);
            if (seen.at(index)) ADD_FAILURE() << "point " << index << " twice";
            seen[index] = true;
            EXPECT_EQ(p + sink.cloud.min_quanta, source.positions()[index]);
            const Vec3d low = Vec3d(node.key.x, node.key.y, node.key.z) * side;
            const Vec3d local = p.cast<double>().cwiseProduct(sink.cloud.quantization.scale) - low;
            // Bounds are rounded to doubles: a point on a face may lie 2^-50 of the cube outside.
            EXPECT_TRUE((local.array() >= -sink.cloud.cube_side * 0x1p-50).all() && (local.array() <= side + sink.cloud.cube_side * 0x1p-50).all())
                << node_name(node.key);
            places.insert({p.x(), p.y(), p.z()});
        }
        const bool overfull_leaf = !parents.contains(node.key) && node.points > kMaxLeafPoints;
        EXPECT_TRUE(!overfull_leaf || places.size() == 1) << node_name(node.key);
    }
    EXPECT_EQ(std::count(seen.begin(), seen.end(), false), 0);
    return sink;
}

// A rough terrain, `side` quanta wide.
std::vector<Vec3i> terrain(size_t n, double side, uint64_t seed = 1) {
    Random random(seed);
    std::vector<Vec3i> points;
    for (size_t i = 0; i < n; ++i) {
        const double x = random.uniform(0.0, side), y = random.uniform(0.0, side);
        points.push_back({int32_t(x), int32_t(y), int32_t(0.05 * side * std::sin(9.0 * x / side) * std::cos(7.0 * y / side))});
    }
    return points;
}

// Of the union of levels 0 ... level: positions, quanta from the corner, that inner nodes hold.
std::vector<Vec3i> union_of_levels(const MemorySink& sink, uint32_t level) {
    std::set<NodeKey> inner;
    for (const BuiltNode& node : sink.nodes)
        if (node.key.level > 0) inner.insert(node.key.parent());
    std::vector<Vec3i> points;
    for (const BuiltNode& node : sink.nodes)
        if (node.key.level <= level && inner.contains(node.key))
            for (size_t i = 0; i < node.points; ++i) points.push_back(record_position(sink.record(node, i)));
    return points;
}

TEST(OctreeBuilder, KeepsEveryPointOnce) { build(MemorySource(terrain(100'000, 1e6))); }

TEST(OctreeBuilder, SameBytesForAnyThreadsAndMemory) {
    // More than two chunks' worth, so that chunks, the top and seeds between chunks all take part.
    const MemorySource source(terrain(1'200'000, 2e6));
    const MemorySink expected = build(source, 1);
    for (const int threads : {2, 7}) {
        const MemorySink sink = build(source, threads);
        EXPECT_TRUE(sink.bytes == expected.bytes) << threads << " threads";
    }
    MemoryScratch scratch;
    const uint64_t least = estimate_build(source.info(), {}).least_memory_bytes;
    EXPECT_FALSE(estimate_build(source.info(), {.threads = 3, .memory_bytes = least}).in_memory);
    EXPECT_TRUE(build(source, 3, least, &scratch).bytes == expected.bytes);
    EXPECT_FALSE(scratch.bytes.empty());
    EXPECT_LE(scratch.bytes.size(), 1.1 * double(source.info().points * kRecordBytes));
}

TEST(OctreeBuilder, OrderOfThePointsDoesNotShow) {
    std::vector<Vec3i> points = terrain(60'000, 1e6);
    const MemorySink expected = build(MemorySource(points));
    std::reverse(points.begin(), points.end());
    const MemorySink sink = build(MemorySource(points));
    ASSERT_EQ(sink.nodes.size(), expected.nodes.size());
    for (size_t i = 0; i < sink.nodes.size(); ++i) {  // all but the index must agree
        EXPECT_EQ(sink.nodes[i].key, expected.nodes[i].key);
        for (size_t k = 0; k < sink.nodes[i].points; ++k)
            ASSERT_EQ(record_position(sink.record(sink.nodes[i], k)), record_position(expected.record(expected.nodes[i], k)));
    }
}

// Points of a level keep their distance also across node borders and chunk borders. None that was left out is farther
// than the spacing from one that was kept, inside chunks. Beside an earlier chunk, points of its next level may be in
// the way, and above the chunks nodes choose from what their children keep: 1 + 1/2 spacings then, on one such level.
// A twin by exhaustive cell lists.
TEST(OctreeBuilder, LevelsAreEvenlySpacedAcrossBorders) {
    const MemorySource source(terrain(1'200'000, 2e6));
    const MemorySink sink = build(source);
    for (uint32_t level = 0; level < 3; ++level) {
        const double spacing = std::ldexp(sink.cloud.spacing, -int(level)) / sink.cloud.quantization.scale.x();  // quanta
        const std::vector<Vec3i> kept = union_of_levels(sink, level);
        const auto hash = [](const std::array<int, 3>& c) { return mix_bits(mix_bits(uint64_t(c[0]) << 32 | uint32_t(c[1])) + uint64_t(c[2])); };
        std::unordered_map<std::array<int, 3>, std::vector<Vec3i>, decltype(hash)> cells(100'000, hash);
        const auto cell_of = [&](const Vec3i& p) { return std::array{int(p.x() / spacing), int(p.y() / spacing), int(p.z() / spacing)}; };
        for (const Vec3i& p : kept) cells[cell_of(p)].push_back(p);
        const auto nearest = [&](const Vec3i& p, bool itself) {
            double least = 1e300;
            const auto [x, y, z] = cell_of(p);
            for (int dx = -1; dx <= 1; ++dx)
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dz = -1; dz <= 1; ++dz)
                        if (const auto found = cells.find({x + dx, y + dy, z + dz}); found != cells.end())
                            for (const Vec3i& q : found->second)
                                if (itself || p != q) least = std::min(least, (p - q).cast<double>().norm());
            return least / spacing;
        };
        double closest = 1e300, farthest = 0.0, beyond = 0.0, looked_at = 0.0;
        for (size_t i = 0; i < kept.size(); i += kTwinStride) closest = std::min(closest, nearest(kept[i], false));
        for (size_t i = 0; i < source.positions().size(); i += kTwinStride) {
            const double distance = nearest(source.positions()[i] - sink.cloud.min_quanta, true);
            farthest = std::max(farthest, distance);
            beyond += distance > 1.0 + 1e-4;
            ++looked_at;
        }
        EXPECT_GE(closest, 1.0 - 1e-4) << "level " << level;  // node-relative floats: 2^-24 of 128 spacings, and rounding
        EXPECT_LT(farthest, 1.5 + 1e-4) << "level " << level;
        // Of the 2 x 4 chunk faces, a strip of half a spacing has points in the way; the level above chunks is measured.
        EXPECT_LT(beyond / looked_at, level == 0 ? 0.12 : 0.001) << "level " << level;
    }
}

// Dart throwing in random order, plainly: the twin of what the root keeps of a cloud that is one chunk.
size_t count_by_dart_throwing(std::vector<Vec3i> points, double spacing, uint64_t seed) {
    Random random(seed);
    for (size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random.bits() % i]);
    std::map<std::pair<int, int>, std::vector<Vec3i>> cells;
    size_t kept = 0;
    for (const Vec3i& p : points) {
        const int x = int(p.x() / spacing), y = int(p.y() / spacing);
        bool free = true;
        for (int dx = -1; free && dx <= 1; ++dx)
            for (int dy = -1; free && dy <= 1; ++dy)
                if (const auto found = cells.find({x + dx, y + dy}); found != cells.end())
                    for (const Vec3i& q : found->second) free = free && (p - q).cast<double>().norm() >= spacing;
        if (!free) continue;
        cells[{x, y}].push_back(p);
        ++kept;
    }
    return kept;
}

TEST(OctreeBuilder, KeepsAsManyPointsOfAPlaneAsRandomDarts) {
    Random random(5);
    std::vector<Vec3i> points;
    for (int i = 0; i < 400'000; ++i) points.push_back({int32_t(random.uniform(0, 1e6)), int32_t(random.uniform(0, 1e6)), 0});
    const MemorySink sink = build(MemorySource(points));
    const double kept = double(union_of_levels(sink, 0).size());
    const double expected = double(count_by_dart_throwing(points, sink.cloud.spacing / sink.cloud.quantization.scale.x(), 3));
    // The number varies by about its root times 0.3 (packings repel each other); five of that, and rounding.
    EXPECT_NEAR(kept, expected, 1.5 * std::sqrt(expected) + 2.0);
}

TEST(OctreeBuilder, NoPointsGiveAnEmptyRoot) {
    const MemorySink sink = build(MemorySource(std::vector<Vec3i>{}));
    ASSERT_EQ(sink.nodes.size(), 1u);
    EXPECT_EQ(sink.nodes[0].points, 0u);
}

TEST(OctreeBuilder, OnePoint) {
    const MemorySink sink = build(MemorySource({{7, -3, INT32_MAX}}));
    ASSERT_EQ(sink.nodes.size(), 1u);
    EXPECT_EQ(sink.nodes[0].points, 1u);
}

TEST(OctreeBuilder, MillionsOfIdenticalPointsAreOneLeaf) {
    const MemorySink sink = build(MemorySource(std::vector<Vec3i>(1'100'000, Vec3i(5, 6, 7))));
    EXPECT_EQ(sink.nodes.size(), 1u);
}

TEST(OctreeBuilder, CoincidentPointsAmongOthers) {
    std::vector<Vec3i> points = terrain(30'000, 1e6);
    points.insert(points.end(), 25'000, points[17]);
    build(MemorySource(points));
}

TEST(OctreeBuilder, PointsOnALine) {
    std::vector<Vec3i> points;
    for (int i = 0; i < 200'000; ++i) points.push_back({i * 10, 0, 0});
    build(MemorySource(points));
}

TEST(OctreeBuilder, FarOutlierMakesADeepTree) {
    std::vector<Vec3i> points = terrain(50'000, 400.0);  // 0.4 m of detail in a cube of 2,000 km
    points.push_back({2'000'000'000, 2'000'000'000, 1'000'000'000});
    const MemorySink sink = build(MemorySource(points));
    uint32_t deepest = 0;
    for (const BuiltNode& node : sink.nodes) deepest = std::max(deepest, node.key.level);
    EXPECT_GE(deepest, 21u);
}

TEST(OctreeBuilder, DenseSpotBeyondOneChunkIsDivided) {
    std::vector<Vec3i> points = terrain(1'200'000, 3000.0);  // more than a chunk in one cell of the first grid
    points.push_back({2'000'000'000, 0, 0});
    build(MemorySource(points));
}

TEST(OctreeBuilder, DenseLattice) {
    std::vector<Vec3i> points;
    for (int x = 0; x < 110; ++x)
        for (int y = 0; y < 110; ++y)
            for (int z = 0; z < 110; ++z) points.push_back({x, y, z});
    build(MemorySource(points, 1.0));
}

TEST(OctreeBuilder, WholeRangeOfQuantaIsCoarsenedAndSaid) {
    const MemorySource source({{INT32_MIN, INT32_MIN, INT32_MIN}, {INT32_MAX, INT32_MAX, INT32_MAX}, {0, 1, -1}});
    MemorySink sink;
    const BuildReport report = build_octree(source, {.threads = 2, .memory_bytes = kRoomy}, nullptr, sink);
    EXPECT_EQ(report.points_written, 3u);
    EXPECT_EQ(sink.cloud.coarsening_bits, 2);  // 2^32 - 1 quanta, one more on the upper side, below 2^31
    EXPECT_DOUBLE_EQ(report.worst_rounding, 0.002);
}

TEST(OctreeBuilder, WrongBoundsInTheHeaderDoNotShow) {
    MemorySource source(terrain(60'000, 1e6));
    const MemorySink expected = build(source);
    source.changeable_info().bounds = {Vec3d(0, 0, 0), Vec3d(1, 1, 1)};
    EXPECT_TRUE(build(source).bytes == expected.bytes);
    source.changeable_info().bounds = {};
    EXPECT_TRUE(build(source).bytes == expected.bytes);
}

TEST(OctreeBuilder, CapBelowTheLeastIsRefusedWithTheNumber) {
    const MemorySource source(terrain(60'000, 1e6));
    MemorySink sink;
    try {
        build_octree(source, {.threads = 1, .memory_bytes = 1 << 20}, nullptr, sink);
        FAIL() << "accepted";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_NE(std::string(error.what()).find("MiB is needed"), std::string::npos) << error.what();
    }
    EXPECT_FALSE(sink.finished);
}

// 2^32 and more points: the arithmetic alone.
TEST(OctreeBuilder, EstimatesBeyond32Bits) {
    CloudInfo info;
    info.points = (uint64_t{1} << 33) + 1;
    info.attributes = {{.name = "a", .type = ScalarType::float64}};
    const BuildEstimate estimate = estimate_build(info, {.threads = 2, .memory_bytes = kRoomy});
    EXPECT_EQ(estimate.record_bytes, info.points * 20);
    EXPECT_EQ(estimate.temporary_bytes, estimate.record_bytes);
    EXPECT_LE(estimate.memory_bytes, kRoomy);
}

TEST(Partition, CountsBeyond32Bits) {
    Partition partition(uint64_t{1} << 33);
    const uint32_t far = 1u << 30;
    partition.count(0, 0, 0, uint64_t{1} << 33);
    partition.count(far, far, far, 999'999);
    while (!partition.refine()) partition.count(0, 0, 0, uint64_t{1} << 33);
    ASSERT_EQ(partition.chunks().size(), 2u);
    EXPECT_EQ(partition.nodes()[size_t(partition.root())].points, (uint64_t{1} << 33) + 999'999);
    EXPECT_EQ(partition.chunks()[partition.chunk_of(0, 0, 0)].points, uint64_t{1} << 33);
    EXPECT_EQ(partition.chunks()[partition.chunk_of(far, far, far)].points, 999'999u);
}

}  // namespace
}  // namespace strata
