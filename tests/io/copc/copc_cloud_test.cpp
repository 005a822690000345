// COPC as a layered cloud: hierarchies put together by hand, whose nodes nobody decodes, and real files.
#include "io/copc/copc_cloud.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "core/error.h"
#include "core/octree/layered_points.h"
#include "core/octree/layered_validation.h"
#include "io/las/laz_source.h"
#include "tests/support/las_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::put;
using test::put_text;

constexpr uint64_t kPointOffset = 683;  // behind the records copc and laszip encoded
constexpr uint64_t kChunkBytes = 100;   // of every node that has points

struct TestEntry {
    std::array<int32_t, 4> key;  // level, x, y, z
    int32_t points = 0;
    uint64_t offset = 0;
    int32_t bytes = 0;
};

// A COPC file whose chunks are zeros. Pages are written in the order in which they are added; the root's may come anywhere.
class CopcFile {
public:
    explicit CopcFile(uint64_t points, size_t chunks) : points_(points), chunks_(chunks) {}

    uint64_t chunk(size_t index) const { return kPointOffset + 8 + index * kChunkBytes; }
    TestEntry node(std::array<int32_t, 4> key, int32_t points, size_t chunk_index) const {
        return points == 0 ? TestEntry{key, 0, 0, 0} : TestEntry{key, points, chunk(chunk_index), int32_t(kChunkBytes)};
    }
    // The entry that names the page.
    TestEntry add_page(const std::vector<TestEntry>& entries) {
        const uint64_t begin = chunk(chunks_) + pages_.size();
        for (const TestEntry& entry : entries) {
            for (const int32_t number : entry.key) put(pages_, number);
            put(pages_, entry.offset);
            put(pages_, entry.bytes);
            put(pages_, entry.points);
        }
        return {entries.empty() ? std::array<int32_t, 4>{} : entries[0].key, -1, begin, int32_t(32 * entries.size())};
    }

    std::unique_ptr<LayeredCloud> open(const TestEntry& root_page) const { return open_copc(memory_source("set.copc.laz", bytes(root_page))); }

    std::vector<std::byte> bytes(const TestEntry& root_page) const {
        std::vector<std::byte> info;
        for (const double number : {8.0, 8.0, 8.0, 8.0, 1.0}) put(info, number);  // center, half size, spacing
        put(info, root_page.offset);
        put(info, uint64_t(uint32_t(root_page.bytes)));
        info.resize(160);
        std::vector<std::byte> laszip;
        put(laszip, uint16_t(3));  // layered chunks
        put(laszip, uint16_t(0));
        put(laszip, uint32_t(0));
        put(laszip, uint32_t(0));
        put(laszip, ~uint32_t(0));  // chunks of any size
        laszip.resize(32);
        put(laszip, uint16_t(1));
        for (const uint16_t number : {10, 30, 3}) put(laszip, number);
        test::LasFile file{.minor_version = 4, .point_format = 6, .record_size = 30,
                           .vlrs = {{"copc", 1, info}, {"laszip encoded", 22204, laszip}}};
        std::vector<std::byte> bytes = file.bytes();
        EXPECT_EQ(bytes.size(), kPointOffset);
        test::poke(bytes, 104, uint8_t(6 | 0x80));
        test::poke(bytes, 247, points_);
        bytes.resize(chunk(chunks_));
        bytes.insert(bytes.end(), pages_.begin(), pages_.end());
        return bytes;
    }

private:
    uint64_t points_;
    size_t chunks_;
    std::vector<std::byte> pages_;
};

std::string message_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "no error";
}

void load_all(LayeredCloud& cloud) {
    for (NodeId id = 0; id < cloud.node_count(); ++id) cloud.load_children(id);
}

TEST(CopcCloud, OnePage) {
    CopcFile file(35, 3);
    // In any order; a node without points has children.
    const auto cloud = file.open(file.add_page({file.node({2, 2, 1, 3}, 5, 2), file.node({0, 0, 0, 0}, 10, 0), file.node({1, 1, 0, 1}, 0, 0),
                                                file.node({1, 0, 1, 1}, 20, 1)}));
    ASSERT_EQ(cloud->node_count(), 4u);
    const LayeredNode& root = cloud->node(cloud->root());
    EXPECT_EQ(root.points, 10u);
    EXPECT_EQ(root.byte_offset, file.chunk(0));
    EXPECT_EQ(root.byte_size, kChunkBytes);
    EXPECT_EQ(root.child_count, 2u);
    EXPECT_EQ(root.spacing, 1.0);
    EXPECT_EQ(root.error, 1.0);
    const LayeredNode& leaf = cloud->node(root.first_child);  // octant 3 comes before 5
    EXPECT_EQ(leaf.key, (NodeKey{1, 0, 1, 1}));
    EXPECT_EQ(leaf.error, 0.0);
    EXPECT_EQ(leaf.bounds.min, Vec3d(0, 8, 8));
    const LayeredNode& inner = cloud->node(root.first_child + 1);
    EXPECT_EQ(inner.points, 0u);
    EXPECT_EQ(inner.child_count, 1u);
    const LayeredNode& deep = cloud->node(inner.first_child);
    EXPECT_EQ(deep.parent, root.first_child + 1);
    EXPECT_EQ(deep.bounds.min, Vec3d(8, 4, 12));
    EXPECT_EQ(deep.bounds.max, Vec3d(12, 8, 16));
    EXPECT_EQ(deep.spacing, 0.25);
}

// Three levels of pages, the root's last. What a page holds is known when the nodes that need it are asked for, not before.
TEST(CopcCloud, PagesComeWhenAskedFor) {
    CopcFile file(31, 5);
    const TestEntry deepest = file.add_page({file.node({2, 0, 0, 1}, 1, 4)});
    const TestEntry middle = file.add_page({file.node({1, 0, 0, 0}, 2, 1), file.node({2, 0, 0, 0}, 4, 2), deepest});
    const TestEntry root = file.add_page({file.node({0, 0, 0, 0}, 16, 0), middle, file.node({1, 1, 1, 1}, 8, 3)});
    const auto cloud = file.open(root);
    ASSERT_EQ(cloud->node_count(), 1u);
    EXPECT_TRUE(cloud->node(0).children_pending);
    EXPECT_EQ(cloud->node(0).error, 1.0);
    cloud->load_children(0);
    ASSERT_EQ(cloud->node_count(), 3u);
    EXPECT_FALSE(cloud->node(0).children_pending);
    EXPECT_EQ(cloud->node(1).points, 2u);
    EXPECT_TRUE(cloud->node(1).children_pending);
    EXPECT_EQ(cloud->node(2).points, 8u);
    EXPECT_FALSE(cloud->node(2).children_pending);
    EXPECT_EQ(cloud->read_page(2), nullptr);
    cloud->load_children(1);
    ASSERT_EQ(cloud->node_count(), 5u);
    EXPECT_EQ(cloud->node(3).points, 4u);
    EXPECT_EQ(cloud->node(4).points, 1u);
    EXPECT_EQ(cloud->node(4).parent, 1u);
    const LayeredSummary summary = validate_layered(*cloud, {});
    EXPECT_EQ(summary.points, 31u);
    EXPECT_EQ(summary.nodes, 5u);
}

TEST(CopcCloud, WithoutPoints) {
    CopcFile file(0, 0);
    EXPECT_EQ(file.open(file.add_page({}))->node_count(), 0u);
    const auto cloud = file.open(file.add_page({file.node({0, 0, 0, 0}, 0, 0)}));
    EXPECT_EQ(cloud->node_count(), 1u);
    PointBatch batch;
    cloud->read_node(0, {}, batch);
    EXPECT_EQ(batch.size, 0u);
}

TEST(CopcCloud, EveryLieInTheHierarchyIsNamed) {
    const std::array<int32_t, 4> kRoot = {0, 0, 0, 0}, kChild = {1, 0, 1, 0};
    const struct {
        std::string what;
        std::function<TestEntry(CopcFile&)> root_page;
        std::string expected;
    } lies[] = {
        {"no root", [&](CopcFile& f) { return f.add_page({f.node(kChild, 5, 0)}); }, "node 1-0-1-0: its parent is not in its page"},
        {"nothing", [&](CopcFile& f) { return f.add_page({}); }, "the root's page is empty"},
        {"an orphan", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 5, 0), f.node({2, 3, 0, 0}, 5, 1)}); }, "node 2-3-0-0: its parent is not"},
        {"twice", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 5, 0), f.node(kChild, 5, 1), f.node(kChild, 5, 2)}); }, "two entries"},
        {"one chunk for two", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 5, 0), f.node(kChild, 5, 0)}); }, "are part of another"},
        {"too many points", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 15, 0), f.node(kChild, 6, 1)}); }, "more than the 20 points"},
        {"more than a chunk holds", [&](CopcFile& f) { return f.add_page({f.node(kRoot, INT32_MAX, 0)}); }, "cannot lie in 100 bytes"},
        {"negative points", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 5, 0), f.node(kChild, -2, 1)}); }, "node 1-0-1-0: -2 points"},
        {"negative bytes", [&](CopcFile& f) { return f.add_page({{kRoot, 5, f.chunk(0), -100}}); }, "lie beyond the file's"},
        {"beyond the file", [&](CopcFile& f) { return f.add_page({{kRoot, 5, uint64_t{1} << 60, 100}}); }, "lie beyond the file's"},
        {"an offset that wraps", [&](CopcFile& f) { return f.add_page({{kRoot, 5, ~uint64_t{50}, 100}}); }, "lie beyond the file's"},
        {"a level below 0", [&](CopcFile& f) { return f.add_page({f.node({-1, 0, 0, 0}, 5, 0)}); }, "a level of 0 to 31 is expected, -1 found"},
        {"a level too deep", [&](CopcFile& f) { return f.add_page({f.node({32, 0, 0, 0}, 5, 0)}); }, "a level of 0 to 31"},
        {"an index outside", [&](CopcFile& f) { return f.add_page({f.node(kRoot, 5, 0), f.node({1, 0, 2, 0}, 5, 1)}); }, "indices of 0 to 1"},
        {"a root that is a page", [&](CopcFile& f) { return f.add_page({f.add_page({f.node(kRoot, 5, 0)})}); }, "only names another page"},
        {"a page that is no list", [&](CopcFile& f) { TestEntry page = f.add_page({f.node(kRoot, 5, 0)}); page.bytes -= 1; return page; }, "32-byte entries"},
        {"a page beyond the file", [&](CopcFile& f) { TestEntry page = f.add_page({f.node(kRoot, 5, 0)}); page.bytes += 32; return page; }, "of"},
        {"below a page", [&](CopcFile& f) {
             const TestEntry page = f.add_page({f.node(kChild, 5, 1)});
             return f.add_page({f.node(kRoot, 5, 0), page, f.node({2, 0, 2, 0}, 5, 2)});
         }, "node 2-0-2-0: its parent is not in its page"},
        {"a page of another node", [&](CopcFile& f) {
             TestEntry page = f.add_page({f.node({1, 1, 1, 1}, 5, 1)});
             page.key = kChild;
             return f.add_page({f.node(kRoot, 5, 0), page});
         }, "its parent is not in its page, that of node 1-0-1-0"},
        {"an empty page", [&](CopcFile& f) {
             TestEntry page = f.add_page({});
             page.key = kChild;
             page.bytes = 0;
             return f.add_page({f.node(kRoot, 5, 0), page});
         }, "lie beyond the file's"},
        {"a page that holds itself", [&](CopcFile& f) {
             TestEntry page = f.add_page({});  // where the next one begins
             page.key = kChild;
             page.bytes = 64;
             TestEntry below = page;
             below.key = {2, 0, 2, 0};
             f.add_page({f.node(kChild, 5, 1), below});
             return f.add_page({f.node(kRoot, 5, 0), page});
         }, "node 1-0-1-0: its parent is not in its page, that of node 2-0-2-0"},
        {"one page for two", [&](CopcFile& f) {
             TestEntry page = f.add_page({f.node(kChild, 5, 1)}), other = page;
             other.key = {1, 1, 1, 1};
             return f.add_page({f.node(kRoot, 5, 0), page, other});
         }, "node 1-1-1-1"},
    };
    for (const auto& lie : lies) {
        CopcFile file(20, 3);
        const TestEntry root_page = lie.root_page(file);
        const std::string message = message_of([&] { load_all(*file.open(root_page)); });
        EXPECT_NE(message.find(lie.expected), std::string::npos) << lie.what << ": " << message;
        EXPECT_EQ(message.find("set.copc.laz: "), 0u) << lie.what << ": " << message;
    }
}

// The view is framed by the box, so that one which cannot be must not count.
TEST(CopcCloud, TheCubeStandsForABoxBeyondIt) {
    CopcFile file(5, 1);
    std::vector<std::byte> bytes = file.bytes(file.add_page({file.node({0, 0, 0, 0}, 5, 0)}));
    test::poke(bytes, 179, 16.0);   // max x, the cube's own
    const auto sound = open_copc(memory_source("set", bytes));
    EXPECT_EQ(sound->info().bounds.max, Vec3d(16, 0, 0));
    test::poke(bytes, 179, 1e300);
    const auto lying = open_copc(memory_source("set", bytes));
    EXPECT_EQ(lying->info().bounds.min, Vec3d(0, 0, 0));
    EXPECT_EQ(lying->info().bounds.max, Vec3d(16, 16, 16));
    EXPECT_EQ(lying->info().notes.size(), 1u);
}

// A page that lies leaves the cloud as it was, and the same page is not refused for what it claimed the first time.
TEST(CopcCloud, AFailedPageChangesNothing) {
    CopcFile file(20, 4);
    const TestEntry bad = file.add_page({file.node({1, 0, 1, 0}, 5, 1), file.node({2, 0, 2, 0}, 5, 2), file.node({2, 1, 2, 0}, 5, 2)});
    const auto cloud = file.open(file.add_page({file.node({0, 0, 0, 0}, 5, 0), bad}));
    const std::string first = message_of([&] { cloud->load_children(0); });
    EXPECT_NE(first.find("node 2-1-2-0: its bytes"), std::string::npos) << first;
    EXPECT_EQ(cloud->node_count(), 1u);
    EXPECT_TRUE(cloud->node(0).children_pending);
    EXPECT_EQ(message_of([&] { cloud->load_children(0); }), first);
}

// Whatever a byte of header, records and pages becomes, and wherever the file ends: a whole hierarchy, or an Error.
TEST(CopcCloud, SurvivesEveryDamagedByteAndEveryEnd) {
    CopcFile file(31, 5);
    const TestEntry deepest = file.add_page({file.node({2, 0, 0, 1}, 1, 4)});
    const TestEntry middle = file.add_page({file.node({1, 0, 0, 0}, 2, 1), file.node({2, 0, 0, 0}, 4, 2), deepest});
    const std::vector<std::byte> whole = file.bytes(file.add_page({file.node({0, 0, 0, 0}, 16, 0), middle, file.node({1, 1, 1, 1}, 8, 3)}));
    size_t opened = 0, refused = 0;
    const auto try_open = [&](std::vector<std::byte> bytes) {
        try {
            const auto cloud = open_copc(memory_source("set", std::move(bytes)));
            EXPECT_LE(validate_layered(*cloud, {}).nodes, 5u);
            PointBatch batch;
            for (NodeId id = 0; id < cloud->node_count(); ++id) cloud->read_node(id, {}, batch);
            ++opened;
        } catch (const Error&) {
            ++refused;
        }
    };
    for (size_t size = 0; size < whole.size(); ++size) try_open({whole.begin(), whole.begin() + std::ptrdiff_t(size)});
    EXPECT_EQ(opened, 0u);
    for (size_t at = 0; at < whole.size(); ++at)
        for (const int value : {0x00, 0x01, 0x7f, 0x80, 0xff}) {
            std::vector<std::byte> damaged = whole;
            damaged[at] = std::byte(value);
            try_open(std::move(damaged));
        }
    EXPECT_GT(refused, whole.size());
}

struct Sums {
    uint64_t points = 0;
    std::vector<uint64_t> columns = std::vector<uint64_t>(64);

    void add(const PointBatch& batch, std::span<const int> wanted) {
        points += batch.size;
        for (size_t i = 0; i < batch.size; ++i) {
            columns[0] += uint64_t(int64_t{batch.x[i]});
            columns[1] += uint64_t(int64_t{batch.y[i]}) * uint64_t(int64_t{batch.z[i]});  // not the sum of each: points stay together
        }
        for (size_t a = 0; a < wanted.size(); ++a)
            for (const std::byte byte : batch.columns[size_t(wanted[a])]) columns[2 + a] += uint64_t(byte) * uint64_t(byte);
    }
    bool operator==(const Sums&) const = default;
};

Sums sums_of(const PointSource& source) {
    std::vector<int> all;
    for (size_t a = 0; a < source.info().attributes.size(); ++a) all.push_back(int(a));
    Sums sums;
    PointBatch batch;
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        source.read_batch(i, all, batch);
        sums.add(batch, all);
    }
    return sums;
}

// Every point of a real file lies in its node's cube, and the nodes together hold what the file does, read as plain LAZ.
TEST(CopcCloud, RealFilesAreWhole) {
    const char* const data = std::getenv("STRATA_DATA");
    if (!data || !fs::exists(fs::path(data) / "copc")) GTEST_SKIP() << "STRATA_DATA names no folder with real scans";
    size_t files = 0;
    for (const auto& entry : fs::directory_iterator(fs::path(data) / "copc")) {
        const std::string path = entry.path().string();
        const auto cloud = open_copc(open_file(path));
        const LayeredSummary summary = validate_layered(*cloud, {.name = path, .read_points = true, .threads = 2});
        const LazSource plain(open_file(path));
        EXPECT_EQ(summary.points, plain.info().points);
        EXPECT_GT(summary.points_per_level.size(), 1u);
        EXPECT_EQ(sums_of(LayeredPoints(*cloud)), sums_of(plain)) << path;
        ++files;
    }
    EXPECT_GE(files, 2u);
}

}  // namespace
}  // namespace strata
