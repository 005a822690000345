#include "io/potree/potree_cloud.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <set>
#include <thread>

#include "core/error.h"
#include "core/math/random.h"
#include "core/octree/layered_validation.h"
#include "io/potree/potree_hierarchy.h"
#include "tests/support/potree_files.h"

namespace strata {
namespace {

using test::make_potree;
using test::open_potree_files;
using test::PotreeFiles;
using test::PotreePoint;
using test::PotreeSet;

constexpr int kWanted[] = {0, 1, 2};  // intensity, rgb, gps-time

/// Random points inside the node of that name.
std::vector<PotreePoint> points_in(const std::string& name, const PotreeSet& set, size_t count, uint64_t seed) {
    double low[3] = {0, 0, 0}, side = set.side;
    for (const char digit : name.substr(1)) {
        side *= 0.5;
        low[0] += side * ((digit - '0') >> 2 & 1);
        low[1] += side * ((digit - '0') >> 1 & 1);
        low[2] += side * ((digit - '0') & 1);
    }
    Random random(seed);
    std::vector<PotreePoint> points(count);
    for (PotreePoint& point : points) {
        for (size_t axis = 0; axis < 3; ++axis)
            point.quanta[axis] = int32_t(random.uniform(low[axis], low[axis] + side) / set.scale);
        point.intensity = uint16_t(random.bits());
        for (uint16_t& channel : point.rgb) channel = uint16_t(random.bits());
        point.gps_time = random.uniform(0.0, 1e9);
    }
    return points;
}

/// A chain of inner nodes down to level `depth`, a leaf beside each: as many chunks as steps fit.
PotreeSet chain(int depth, bool brotli) {
    PotreeSet set;
    set.brotli = brotli;
    std::string name = "r";
    for (int level = 0; level <= depth; ++level) {
        set.nodes[name] = points_in(name, set, size_t(3 + level), uint64_t(level));
        if (level == depth) break;
        const std::string leaf = name + "2";
        set.nodes[leaf] = points_in(leaf, set, 5, uint64_t(100 + level));
        name += "5";
    }
    return set;
}

/// Every node that the reader sees, by name, as the points that it decodes.
std::map<std::string, std::vector<PotreePoint>> read_all(LayeredCloud& cloud) {
    std::map<std::string, std::vector<PotreePoint>> nodes;
    PotreeFiles files;
    PointBatch batch;
    for (NodeId id = 0; id < cloud.node_count(); ++id) {
        cloud.load_children(id);
        cloud.read_node(id, kWanted, batch);
        std::vector<PotreePoint>& points = nodes[node_name(cloud.node(id).key)];
        for (size_t i = 0; i < batch.size; ++i) {
            const auto rgb = batch.column<uint16_t>(1);
            points.push_back({.quanta = {batch.x[i], batch.y[i], batch.z[i]},
                              .intensity = batch.column<uint16_t>(0)[i],
                              .rgb = {rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]},
                              .gps_time = batch.column<double>(2)[i]});
        }
    }
    return nodes;
}

void expect_same(const std::map<std::string, std::vector<PotreePoint>>& expected,
                 const std::map<std::string, std::vector<PotreePoint>>& found) {
    ASSERT_EQ(expected.size(), found.size());
    for (const auto& [name, points] : expected) {
        ASSERT_TRUE(found.contains(name)) << name;
        ASSERT_EQ(found.at(name).size(), points.size()) << name;
        for (size_t i = 0; i < points.size(); ++i) {
            EXPECT_EQ(found.at(name)[i].quanta, points[i].quanta) << name;
            EXPECT_EQ(found.at(name)[i].intensity, points[i].intensity) << name;
            EXPECT_EQ(found.at(name)[i].rgb, points[i].rgb) << name;
            EXPECT_EQ(found.at(name)[i].gps_time, points[i].gps_time) << name;
        }
    }
}

std::string message_of(const std::function<void()>& body, ErrorKind expected = ErrorKind::malformed) {
    try {
        body();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, expected) << error.what();
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        return error.what();
    }
    return "nothing was thrown";
}

void open_and_validate(const PotreeFiles& files) {
    const auto cloud = open_potree_files(files);
    validate_layered(*cloud, {.read_points = true});
}

/// One record of hierarchy.bin, to be bent.
struct RawRecord {
    std::byte* bytes;
    void set_type(uint8_t value) { std::memcpy(bytes, &value, 1); }
    void set_mask(uint8_t value) { std::memcpy(bytes + 1, &value, 1); }
    void set_points(uint32_t value) { std::memcpy(bytes + 2, &value, 4); }
    void set_offset(uint64_t value) { std::memcpy(bytes + 6, &value, 8); }
    void set_size(uint64_t value) { std::memcpy(bytes + 14, &value, 8); }
};
RawRecord record(PotreeFiles& files, size_t index) { return {files.hierarchy.data() + 22 * index}; }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

class BothEncodings : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Potree, BothEncodings, testing::Bool(),
                         [](const auto& info) { return info.param ? "Brotli" : "Default"; });

// 1, 5 and 9 levels: no proxy, one, and proxies inside the chunks of proxies.
TEST_P(BothEncodings, EveryPointComesBackFromAnyDepth) {
    for (const int depth : {0, 3, 4, 5, 8, 9, 13}) {
        const PotreeSet set = chain(depth, GetParam());
        const auto cloud = open_potree_files(make_potree(set));
        expect_same(set.nodes, read_all(*cloud));
    }
}

TEST_P(BothEncodings, IntegersOfAllSizesComeBack) {
    PotreeSet set;
    set.brotli = GetParam();
    set.side = 4.3e6;  // 2^32 quanta and a bit
    set.nodes["r"] = {{.quanta = {0, 1, 2}}, {.quanta = {INT32_MAX, 65535, 65536}}, {.quanta = {0x12345678, 0x7edcba98, 0x0f0f0f0f}},
                      {.quanta = {INT32_MIN, -1, -65536}, .rgb = {65535, 0, 0x1234}}};
    const auto cloud = open_potree_files(make_potree(set));
    expect_same(set.nodes, read_all(*cloud));
}

TEST_P(BothEncodings, OnlyWantedColumnsAreFilled) {
    const auto cloud = open_potree_files(make_potree(chain(0, GetParam())));
    PointBatch batch;
    const int rgb[] = {1};
    cloud->read_node(0, rgb, batch);
    EXPECT_EQ(batch.size, 3u);
    EXPECT_TRUE(batch.columns[0].empty());
    EXPECT_EQ(batch.columns[1].size(), 18u);
    EXPECT_TRUE(batch.columns[2].empty());
}

TEST_P(BothEncodings, InnerNodesWithoutPointsAreRead) {
    PotreeSet set = chain(6, GetParam());
    set.nodes["r"].clear();
    set.nodes["r5555"].clear();  // a proxy's node
    const auto cloud = open_potree_files(make_potree(set));
    expect_same(set.nodes, read_all(*cloud));
}

TEST_P(BothEncodings, ValidationCountsAndMeasures) {
    const PotreeSet set = chain(9, GetParam());
    const auto cloud = open_potree_files(make_potree(set));
    const LayeredSummary summary = validate_layered(*cloud, {.read_points = true, .threads = 3});
    EXPECT_EQ(summary.nodes, set.nodes.size());
    EXPECT_EQ(summary.points, cloud->info().points);
    EXPECT_EQ(summary.nodes_per_level, (std::vector<uint64_t>{1, 2, 2, 2, 2, 2, 2, 2, 2, 2}));
    EXPECT_EQ(summary.points_per_level[3], 3u + 3 + 5);
}

// A node below a proxy can be drawn before its children are known; that is what a viewer starts with.
TEST(PotreeCloud, LoadsTheHierarchyOnDemand) {
    const auto cloud = open_potree_files(make_potree(chain(9, false)));
    ASSERT_EQ(cloud->node_count(), 9u);  // levels 0 to 4
    NodeId pending = kNoNode;
    for (NodeId id = 0; id < 9; ++id)
        if (cloud->node(id).children_pending) pending = id;
    ASSERT_NE(pending, kNoNode);
    const LayeredNode before = cloud->node(pending);
    EXPECT_EQ(node_name(before.key), "r5555");
    EXPECT_EQ(before.points, 7u);
    EXPECT_EQ(before.error, before.spacing);
    PointBatch batch;
    cloud->read_node(pending, {}, batch);
    EXPECT_EQ(batch.size, 7u);

    cloud->load_children(pending);
    EXPECT_EQ(cloud->node_count(), 17u);  // two nodes on each of levels 5 to 8
    const LayeredNode& after = cloud->node(pending);
    EXPECT_FALSE(after.children_pending);
    EXPECT_EQ(after.child_count, 2u);
    EXPECT_EQ(cloud->node(after.first_child).parent, pending);
    EXPECT_EQ(after.parent, before.parent);
    EXPECT_EQ(after.byte_offset, before.byte_offset);
    cloud->load_children(pending);  // nothing is pending any more
    EXPECT_EQ(cloud->node_count(), 17u);
}

TEST(PotreeCloud, StatesBoxesSpacingAndWhatMetadataSays) {
    PotreeSet set = chain(2, false);
    set.corner = {500000.0, 5.3e6, -20.0};
    const auto cloud = open_potree_files(make_potree(set));
    const CloudInfo& info = cloud->info();
    EXPECT_EQ(info.format, "potree 2.0, DEFAULT");
    EXPECT_EQ(info.crs, "EPSG:25832");
    EXPECT_EQ(info.quantization, (Quantization{.scale = Vec3d::Constant(0.001), .offset = Vec3d(500000.0, 5.3e6, -20.0)}));
    ASSERT_EQ(info.attributes.size(), 3u);
    EXPECT_EQ(info.attributes[1].name, "rgb");
    EXPECT_EQ(info.attributes[1].components, 3);
    EXPECT_EQ(info.attribute_max[0], std::vector<double>{65535.0});
    EXPECT_TRUE(info.attribute_max[1].empty());
    for (NodeId id = 0; id < cloud->node_count(); ++id) {
        const LayeredNode& node = cloud->node(id);
        EXPECT_EQ(node.spacing, 1.0 / (1 << node.key.level));
        EXPECT_EQ(node.error, node.child_count > 0 ? node.spacing : 0.0);
    }
    const LayeredNode& r5 = cloud->node(2);  // octant 5: high x, low y, high z
    EXPECT_EQ(node_name(r5.key), "r5");
    EXPECT_EQ(r5.bounds.min, Vec3d(500064.0, 5.3e6, 44.0));
    EXPECT_EQ(r5.bounds.max, Vec3d(500128.0, 5.3e6 + 64.0, 108.0));
}

TEST(PotreeCloud, OpensAFolderOrItsMetadata) {
    const std::string folder = testing::TempDir() + "potree_cloud_test";
    std::filesystem::create_directories(folder);
    test::write_potree_files(make_potree(chain(1, true)), folder);
    EXPECT_EQ(open_potree(folder)->node_count(), 3u);
    EXPECT_EQ(open_potree(folder + "/")->node_count(), 3u);
    EXPECT_EQ(open_potree(folder + "/metadata.json")->node_count(), 3u);
    std::filesystem::remove(folder + "/octree.bin");
    EXPECT_NE(message_of([&] { open_potree(folder); }, ErrorKind::not_found).find("octree.bin"), std::string::npos);
    std::filesystem::remove_all(folder);
}

// What PotreeConverter writes: inner nodes called leaves, and masks of 0 at proxies.
TEST(PotreeCloud, BelievesTheChildMaskNotTheType) {
    const PotreeSet set = chain(6, false);
    PotreeFiles files = make_potree(set);
    for (size_t i = 0; i < files.hierarchy.size() / 22; ++i) {
        uint8_t type;
        std::memcpy(&type, record(files, i).bytes, 1);
        if (type == 0) record(files, i).set_type(1);
        if (type == 2) record(files, i).set_mask(0), record(files, i).set_points(0);
    }
    const auto cloud = open_potree_files(files);
    expect_same(set.nodes, read_all(*cloud));
}

struct Lie {
    const char* name;
    std::function<void(PotreeFiles&)> tell;
    const char* expected;  // part of the message
};

// A chain of depth 6 in DEFAULT: records 0 to 8 are r, r2, r5, r52, r55, r552, r555, r5552 and the proxy r5555;
// its chunk, records 9 to 13, holds r5555, r55552, r55555, r555552 and r555555.
const Lie kLies[] = {
    {"a proxy that names the first chunk", [](PotreeFiles& f) { record(f, 8).set_offset(0), record(f, 8).set_size(22 * 9); },
     "node r5555: its chunk at byte 0 is part of another"},
    {"a proxy that names a part of its own chunk", [](PotreeFiles& f) { record(f, 8).set_offset(22 * 3); },
     "node r5555: its chunk at byte 66 is part of another"},
    {"a proxy below a proxy that goes back up", [](PotreeFiles& f) { record(f, 11).set_type(2), record(f, 11).set_offset(22 * 9), record(f, 11).set_size(22 * 5); },
     "r5555"},
    {"a chunk that begins with a proxy", [](PotreeFiles& f) { record(f, 9).set_type(2); }, "node r5555: a chunk that begins with a proxy"},
    {"the root as a proxy", [](PotreeFiles& f) { record(f, 0).set_type(2); }, "node r: "},
    {"a proxy beyond the file", [](PotreeFiles& f) { record(f, 8).set_offset(1 << 20); }, "node r5555: its chunk of 110 bytes at 1048576 lies beyond"},
    {"a proxy whose range overflows", [](PotreeFiles& f) { record(f, 8).set_offset(~uint64_t{0} - 50); }, "node r5555: its chunk"},
    {"a proxy of no bytes", [](PotreeFiles& f) { record(f, 8).set_size(0); }, "node r5555: a chunk of 22-byte records"},
    {"a proxy of half a record", [](PotreeFiles& f) { record(f, 8).set_size(22 * 4 + 11); }, "node r5555: a chunk of 22-byte records"},
    {"a chunk cut short", [](PotreeFiles& f) { record(f, 8).set_size(22 * 4); }, "more children than records"},
    {"a chunk longer than its tree", [](PotreeFiles& f) { record(f, 11).set_mask(1 << 2); }, "its child masks name"},
    {"children that are not there", [](PotreeFiles& f) { record(f, 4).set_mask(0xff); }, "more children than records"},
    {"an unknown type", [](PotreeFiles& f) { record(f, 3).set_type(7); }, "node r52: node type 0, 1 or 2 is expected, 7 found"},
    {"more points than bytes", [](PotreeFiles& f) { record(f, 3).set_points(1000000); }, "node r52: 1000000 points of 28 bytes expected, 140 bytes stated"},
    {"points without bytes", [](PotreeFiles& f) { record(f, 3).set_size(0); }, "node r52: 5 points in 0 bytes"},
    {"bytes beyond octree.bin", [](PotreeFiles& f) { record(f, 3).set_offset(f.octree.size() - 139); }, "node r52: its 140 bytes"},
    {"a byte range that overflows", [](PotreeFiles& f) { record(f, 3).set_offset(~uint64_t{0} - 3); }, "node r52: its 140 bytes"},
    {"two nodes in the same bytes", [](PotreeFiles& f) { std::memcpy(record(f, 3).bytes + 6, record(f, 1).bytes + 6, 8); },
     "overlap those of node"},
    {"fewer points than stated", [](PotreeFiles& f) { record(f, 3).set_points(0); }, "its nodes hold"},
    {"more points than stated", [](PotreeFiles& f) { f.metadata = replaced(f.metadata, "\"points\": ", "\"points\": 1, \"other\": "); },
     "more than the 1 points of metadata.json"},
    {"a first chunk beyond the file", [](PotreeFiles& f) { f.metadata = replaced(f.metadata, "firstChunkSize\": ", "firstChunkSize\": 9"); },
     "node r: its chunk of"},
    {"a first chunk of nothing", [](PotreeFiles& f) { f.metadata = replaced(f.metadata, "firstChunkSize\": 198", "firstChunkSize\": 0"); },
     "node r: a chunk of 22-byte records"},
    {"points outside their node", [](PotreeFiles& f) { const int32_t far = 1 << 30; std::memcpy(f.octree.data(), &far, 4); },
     "node r: point 0: x = 1073741.824 lies outside the node's 0 to 128"},
};

TEST(PotreeCloud, EveryLieInTheHierarchyIsNamed) {
    const PotreeFiles truth = make_potree(chain(6, false));
    ASSERT_EQ(truth.hierarchy.size(), 22u * 14);
    EXPECT_NO_THROW(open_and_validate(truth));
    for (const Lie& lie : kLies) {
        PotreeFiles files = truth;
        lie.tell(files);
        const std::string message = message_of([&] { open_and_validate(files); });
        EXPECT_NE(message.find(lie.expected), std::string::npos) << lie.name << ": " << message;
    }
}

TEST(PotreeCloud, AFailedLoadChangesNothing) {
    PotreeFiles files = make_potree(chain(6, false));
    record(files, 11).set_type(9);
    const auto cloud = open_potree_files(files);
    for (int attempt = 0; attempt < 2; ++attempt) {
        message_of([&] { cloud->load_children(8); });
        EXPECT_EQ(cloud->node_count(), 9u);
        EXPECT_TRUE(cloud->node(8).children_pending);
    }
}

TEST(PotreeCloud, EveryTruncationIsAnError) {
    for (const bool brotli : {false, true}) {
        const PotreeFiles truth = make_potree(chain(5, brotli));
        for (size_t size = 0; size < truth.hierarchy.size(); ++size) {
            PotreeFiles files = truth;
            files.hierarchy.resize(size);
            EXPECT_THROW(open_and_validate(files), Error) << "hierarchy.bin of " << size;
        }
        for (size_t size = 0; size < truth.octree.size(); ++size) {
            PotreeFiles files = truth;
            files.octree.resize(size);
            EXPECT_THROW(open_and_validate(files), Error) << "octree.bin of " << size;
        }
        for (size_t size = 0; size < truth.metadata.size(); ++size) {
            PotreeFiles files = truth;
            files.metadata.resize(size);
            EXPECT_THROW(open_and_validate(files), Error) << "metadata.json of " << size;
        }
    }
}

/// A BROTLI set of one node whose stream is `raw`, compressed, and which states `points` points.
PotreeFiles brotli_node(const std::vector<std::byte>& stream, uint32_t points) {
    PotreeSet set;
    set.brotli = true;
    set.nodes["r"] = {PotreePoint{}};
    PotreeFiles files = make_potree(set);
    files.octree = stream;
    record(files, 0).set_points(points);
    record(files, 0).set_size(stream.size());
    files.metadata = replaced(files.metadata, "\"points\": 1", "\"points\": " + std::to_string(points));
    return files;
}

TEST(PotreeCloud, BrotliStreamsMustHoldWhatTheyState) {
    constexpr size_t kPointBytes = 16 + 2 + 8 + 8;
    const auto stream = test::potree_detail::compressed(std::vector<std::byte>(10 * kPointBytes));
    EXPECT_NO_THROW(open_and_validate(brotli_node(stream, 10)));
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(stream, 9)); }).find("holds more than the 306 bytes"), std::string::npos);
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(stream, 11)); }).find("holds 340 bytes, 374 expected"), std::string::npos);
    // A count that lies costs no memory: the stream ends long before it is believed.
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(stream, 15'000'000)); }).find("holds 340 bytes"), std::string::npos);
    // A bomb is refused by what it states.
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(stream, 4'000'000'000u)); }, ErrorKind::limit).find("at most 512 MiB"), std::string::npos);
    auto trailing = stream;
    trailing.push_back(std::byte{0});
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(trailing, 10)); }).find("1 bytes after the Brotli stream"), std::string::npos);
    std::vector<std::byte> noise(200, std::byte{0xa7});
    EXPECT_NE(message_of([&] { open_and_validate(brotli_node(noise, 10)); }).find("node r: the Brotli stream is damaged"), std::string::npos);
}

TEST(PotreeCloud, TheFirstFaultIsTheSameForAnyThreads) {
    PotreeSet set;
    for (const char a : {'0', '3', '6'})
        for (const char b : {'0', '1', '5', '7'}) {
            const std::string name = std::string("r") + a + b;
            set.nodes[name] = points_in(name, set, 20, 7);
            set.nodes[name.substr(0, 2)] = {}, set.nodes["r"] = {};
        }
    PotreeFiles files = make_potree(set);
    for (std::byte& byte : files.octree) byte = std::byte{0x7f};  // every point of every node lies outside
    std::set<std::string> messages;
    for (const int threads : {1, 2, 7})
        messages.insert(message_of([&] { validate_layered(*open_potree_files(files), {.read_points = true, .threads = threads}); }));
    EXPECT_EQ(messages.size(), 1u);
    EXPECT_NE(messages.begin()->find("node r00: "), std::string::npos) << *messages.begin();
}

TEST(PotreeHierarchy, DepthIsBounded) {
    std::vector<std::byte> records;
    for (uint32_t level = 0; level <= kDeepestLevel + 1; ++level)
        test::potree_detail::put_record(records, 0, level <= kDeepestLevel ? 1 : 0, 0, 0, 0);
    EXPECT_NE(message_of([&] { parse_hierarchy_chunk(records, {}); }).find("deeper than 32 levels"), std::string::npos);
    records.resize(records.size() - 22);
    records[22 * kDeepestLevel + 1] = std::byte{0};
    EXPECT_EQ(parse_hierarchy_chunk(records, {}).size(), kDeepestLevel + 1);
}

// The threads that read nodes go on while another one loads more of the hierarchy.
TEST(PotreeCloud, NodesAreReadWhileTheHierarchyGrows) {
    PotreeSet set;
    set.step = 1;
    std::string name = "r";
    for (int32_t level = 0; level < 9; ++level, name += '0') set.nodes[name] = {{.quanta = {level, level, level}}};
    const std::unique_ptr<LayeredCloud> cloud = open_potree_files(make_potree(set));
    std::atomic<bool> done = false;
    std::atomic<uint64_t> reads = 0;
    std::vector<std::jthread> readers;
    for (int i = 0; i < 3; ++i)
        readers.emplace_back([&] {
            PointBatch batch;
            while (!done || reads < 100) {
                cloud->read_node(0, {}, batch);
                if (batch.size != 1 || batch.x[0] != 0) ADD_FAILURE() << "not the root";
                ++reads;
            }
        });
    for (NodeId id = 0; id < cloud->node_count(); ++id)
        cloud->load_children(id);
    done = true;
    readers.clear();
    EXPECT_EQ(cloud->node_count(), 9u);
}

}  // namespace
}  // namespace strata
