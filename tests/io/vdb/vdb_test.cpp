// OpenVDB writes, our reader reads: two programs that must agree on every voxel.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/format.h"
#include "io/vdb/vdb_voxels.h"
#include "io/vdb/vdb_writer.h"
#include "tests/support/las_file.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

VoxelTree tree_of(const VdbVoxels& voxels) {
    VoxelTreeInMemory memory(voxels.frame, {});
    VoxelTreeBuilder builder(voxels.frame, {}, memory);
    voxels.voxels.emit([&](const VoxelBatch& batch) { builder.add(batch); });
    builder.finish();
    return memory.take();
}

std::string message_of(const std::function<void()>& act, ErrorKind kind) {
    try {
        act();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, kind) << error.what();
        return error.what();
    }
    ADD_FAILURE() << "no error";
    return {};
}

// Scattered voxels, a full block of each height, and cells of a tall block of which some are full.
VoxelBatch some_voxels() {
    std::mt19937_64 random(11);
    std::map<std::pair<uint64_t, int>, uint64_t> blocks;  // by first block and minus height
    for (int i = 0; i < 300; ++i) blocks[{random() % 4096, 0}] |= random() & random() & random();
    blocks[{4100, 0}] = kFullMask;
    blocks[{uint64_t{70} << 6, -1}] = kFullMask;
    blocks[{uint64_t{71} << 6, -1}] = 0xFF00000000000101;
    blocks[{uint64_t{72} << 6, -1}] = 1;
    blocks[{(uint64_t{72} << 6) + 9, 0}] = 0x8000000000000001;
    blocks[{uint64_t{3} << 12, -2}] = 0x00000000FF000003;
    VoxelBatch batch;
    for (const auto& [key, mask] : blocks)
        if (mask != 0) batch.blocks.push_back({key.first >> 6 * -key.second, mask, -key.second});
    return batch;
}
const VoxelFrame kFrame{.origin = {1000.25, -3.5, 7.0}, .voxel_size = 0.125, .levels = 4};

VoxelTree tree_of(const VoxelBatch& batch) {
    VoxelTreeInMemory memory(kFrame, {});
    VoxelTreeBuilder builder(kFrame, {}, memory);
    builder.add(batch);
    builder.finish();
    return memory.take();
}

void expect_equal(const VoxelTree& a, const VoxelTree& b) {
    EXPECT_EQ(a.frame, b.frame);
    ASSERT_EQ(a.levels.size(), b.levels.size());
    for (size_t l = 0; l < a.levels.size(); ++l) {
        EXPECT_EQ(a.levels[l].masks, b.levels[l].masks) << l;
        EXPECT_EQ(a.levels[l].full, b.levels[l].full) << l;
    }
}

class Vdb : public ::testing::Test {
protected:
    void SetUp() override {
        if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write files with";
    }
    std::string write(const std::string& name, const VoxelBatch& batch, const VdbWriteSettings& settings = {}) {
        VdbWriter writer(folder_.file(name), true, kFrame, settings);
        writer.add(batch);
        const uint64_t bytes = writer.commit();
        EXPECT_EQ(bytes, std::filesystem::file_size(folder_.file(name)));
        return folder_.file(name);
    }
    TemporaryFolder folder_;
};

TEST_F(Vdb, VoxelsComeBackWithTheirFrame) {
    const VoxelTree truth = tree_of(some_voxels());
    for (const bool as_mask : {false, true})
        for (const bool half : {false, true})
            for (const VdbCompression compression : {VdbCompression::none, VdbCompression::zip, VdbCompression::blosc}) {
                SCOPED_TRACE(std::to_string(as_mask) + std::to_string(half) + std::to_string(int(compression)));
                const std::string path = write("a.vdb", some_voxels(), {.as_mask = as_mask, .half = half, .compression = compression});
                EXPECT_EQ(identify_format(path).name, "vdb");
                const VdbVoxels voxels = read_vdb_voxels(path);
                expect_equal(tree_of(voxels), truth);
                EXPECT_EQ(voxels.voxels.voxels(), count_voxels(truth));
                EXPECT_EQ(voxels.grid.type, as_mask ? "mask" : "float");
                EXPECT_EQ(voxels.grid.is_half, half && !as_mask);
            }
}

// Two runs, and two orders of the same batches.
TEST_F(Vdb, TheSameVoxelsAreTheSameBytes) {
    VoxelBatch backwards = some_voxels();
    std::reverse(backwards.blocks.begin(), backwards.blocks.end());
    const std::string a = write("a.vdb", some_voxels()), b = write("b.vdb", some_voxels()), c = write("c.vdb", backwards);
    EXPECT_EQ(test::file_contents(a), test::file_contents(b));
    EXPECT_EQ(test::file_contents(a), test::file_contents(c));
}

TEST_F(Vdb, AnOutputIsWholeOrAbsent) {
    const std::string path = folder_.file("a.vdb");
    {
        VdbWriter writer(path, false, kFrame);
        writer.add(some_voxels());
    }
    EXPECT_EQ(test::entries(folder_.path()), 0u);
    write("a.vdb", some_voxels());
    EXPECT_THROW(VdbWriter(path, false, kFrame), Error);
}

TEST_F(Vdb, MemoryIsCapped) {
    for (const bool as_mask : {false, true}) {
        VdbWriter writer(folder_.file("a.vdb"), false, kFrame, {.as_mask = as_mask, .memory_bytes = as_mask ? 2000u : 50'000u});
        const std::string line = message_of([&] { writer.add(some_voxels()); }, ErrorKind::limit);
        EXPECT_EQ(line.rfind(folder_.file("a.vdb") + ": its grids need more than ", 0), 0u) << line;
    }
}

TEST_F(Vdb, TheHeaderSaysWhatIsThere) {
    VoxelBatch batch;
    batch.blocks = {{0, 0x8001, 0}, {9, 1, 0}};
    batch.counts = {3, 0xFFFFFFFF, 5};
    batch.colors = {{255, 0, 0}, {0, 255, 0}, {51, 51, 51}};
    const std::string path = write("a.vdb", batch);
    const VdbFile file = read_vdb_info(path);
    EXPECT_EQ(file.version, 224u);
    ASSERT_EQ(file.grids.size(), 3u);
    const std::set<std::string> names = {file.grids[0].name + " " + file.grids[0].type, file.grids[1].name + " " + file.grids[1].type, file.grids[2].name + " " + file.grids[2].type};
    EXPECT_EQ(names, (std::set<std::string>{"occupancy float", "count int32", "color vec3s"}));
    for (const VdbGrid& grid : file.grids) {
        EXPECT_EQ(grid.active_voxels, 3u);
        EXPECT_EQ(grid.least_index, Vec3i(0, 0, 0));
        EXPECT_EQ(grid.greatest_index, Vec3i(1, 1, 12));  // code 9 is block (0, 0, 3); bit 15 of the first is (1, 1, 3)
        EXPECT_TRUE(grid.is_uniform());
        EXPECT_EQ(*grid.voxel_size, Vec3d::Constant(0.125));
        EXPECT_EQ(grid.place_of_0, kFrame.origin + Vec3d::Constant(0.0625));
        EXPECT_EQ(grid.strata_levels, 4);
    }
    EXPECT_EQ(read_vdb_voxels(path).voxels.voxels(), 3u);
    EXPECT_EQ(message_of([&] { read_vdb_voxels(path, {.grid = "color"}); }, ErrorKind::unsupported), path + ": grid color: values of float, double, bool or mask are expected, they are vec3s");
    const std::string other = message_of([&] { read_vdb_voxels(path, {.grid = "fire"}); }, ErrorKind::usage);
    EXPECT_EQ(other.rfind(path + ": no grid fire, there are ", 0), 0u) << other;
}

TriangleMesh box_mesh(const Vec3d& low, const Vec3d& high) {
    TriangleMesh mesh;
    for (int i = 0; i < 8; ++i) mesh.positions.push_back({i & 4 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 1 ? high.z() : low.z()});
    for (const auto& [a, b, c, d] : {std::array{0u, 1u, 3u, 2u}, {4u, 6u, 7u, 5u}, {0u, 4u, 5u, 1u}, {2u, 3u, 7u, 6u}, {0u, 2u, 6u, 4u}, {1u, 5u, 7u, 3u}}) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    }
    return mesh;
}

// Lattice points within a box are counted by its sides; the band of half width 3 leaves whole tiles inside a large one.
TEST_F(Vdb, ALevelSetOfABoxIsTheLatticePointsInside) {
    const Vec3d far(5'000'000.0, -400'000.0, 100.0);
    for (const int side : {10, 60}) {
        const MeshLevelSet level_set(box_mesh(far + Vec3d::Constant(0.25), far + Vec3d::Constant(side + 0.25)), {.voxel_size = 1.0});
        const VoxelTree tree = tree_of(level_set.voxels());
        EXPECT_EQ(count_voxels(tree), uint64_t(side * side * side));
        for (const int at : {1, side}) {
            const Vec3d p = tree.frame.voxel_from_world(far + Vec3d::Constant(at));
            EXPECT_TRUE(is_occupied(tree, uint32_t(p.x()), uint32_t(p.y()), uint32_t(p.z()))) << at;
            EXPECT_NEAR(p.x() - std::floor(p.x()), 0.5, 1e-6);  // a lattice point is a voxel's center
        }
        // A larger isovalue takes a layer more on each side.
        EXPECT_GE(count_voxels(tree_of(level_set.voxels(1.0))), uint64_t(side * side * side + 6 * side * side));
        for (const bool half : {false, true})
            for (const VdbCompression compression : {VdbCompression::none, VdbCompression::zip, VdbCompression::blosc}) {
                const std::string path = folder_.file("ls.vdb");
                level_set.write(path, true, {.half = half, .compression = compression});
                const VdbVoxels voxels = read_vdb_voxels(path);
                EXPECT_EQ(voxels.grid.grid_class, "level set");
                expect_equal(tree_of(voxels), tree);
                EXPECT_EQ(read_vdb_info(path).grids[0].active_voxels, level_set.active_voxels());
                EXPECT_EQ(read_vdb_info(path).grids[0].background, 3.0);
                const std::string refusal = message_of([&] { read_vdb_voxels(path, {.isovalue = 3.0}); }, ErrorKind::usage);
                EXPECT_NE(refusal.find("grid surface: what lies far outside has the value 3"), std::string::npos) << refusal;
            }
    }
}

TEST_F(Vdb, LevelSetsThatCannotBeAreRefused) {
    const TriangleMesh box = box_mesh({0, 0, 0}, {1, 1, 1});
    EXPECT_EQ(message_of([&] { MeshLevelSet(TriangleMesh{}, {}); }, ErrorKind::usage), "a level set needs triangles");
    for (const double size : {0.0, -1.0, std::nan("")}) message_of([&] { MeshLevelSet(box, {.voxel_size = size}); }, ErrorKind::usage);
    message_of([&] { MeshLevelSet(box, {.voxel_size = 1e-7}); }, ErrorKind::limit);
    message_of([&] { MeshLevelSet(box, {.voxel_size = 1e-3, .memory_bytes = 1 << 20}); }, ErrorKind::limit);
}

TEST_F(Vdb, ALevelSetDoesNotLookAtVerticesThatNoTriangleUses) {
    const TriangleMesh box = box_mesh({0.25, 0.25, 0.25}, {10.25, 10.25, 10.25});
    for (const double far : {1e30, -1e4, std::nan("")}) {
        TriangleMesh more = box;
        more.positions.push_back({far, 0, 0});
        expect_equal(tree_of(MeshLevelSet(more, {}).voxels()), tree_of(MeshLevelSet(box, {}).voxels()));
    }
}

TEST_F(Vdb, AFrameOfOneLevelComesBack) {
    const VoxelFrame frame{.origin = {1, 2, 3}, .voxel_size = 0.5, .levels = 1};
    VoxelBatch batch;
    batch.blocks = {{0, 0x8000000000000001, 0}};
    VdbWriter writer(folder_.file("a.vdb"), true, frame);
    writer.add(batch);
    writer.commit();
    const VdbVoxels voxels = read_vdb_voxels(folder_.file("a.vdb"));
    EXPECT_EQ(voxels.frame, frame);
    EXPECT_EQ(count_voxels(tree_of(voxels)), 2u);
}

// It takes a voxel of less than some 3e-15 cubic units for none.
TEST_F(Vdb, WhatOpenVdbRefusesIsAnError) {
    const std::string path = folder_.file("a.vdb");
    const std::string line = message_of([&] { VdbWriter(path, false, {.voxel_size = 1e-6}); }, ErrorKind::unsupported);
    EXPECT_EQ(line.rfind(path + ": OpenVDB: ", 0), 0u) << line;
    const std::string set = message_of([&] { MeshLevelSet(box_mesh({0, 0, 0}, {1e-5, 1e-5, 1e-5}), {.voxel_size = 1e-6}); }, ErrorKind::unsupported);
    EXPECT_EQ(set.rfind("OpenVDB: ", 0), 0u) << set;
    EXPECT_EQ(test::entries(folder_.path()), 0u);
}

class CountingSource : public ByteSource {
public:
    explicit CountingSource(const std::string& bytes) : source_(memory_source("counted", test::bytes_of(bytes))) {}
    const std::string& name() const override { return source_->name(); }
    uint64_t size() const override { return source_->size(); }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        bytes_read += out.size();
        source_->read(offset, out);
    }
    mutable uint64_t bytes_read = 0;

private:
    std::unique_ptr<ByteSource> source_;
};

// Grids behind the first, without counts of their own, that share its tree, which is larger than what a stream holds at once.
TEST_F(Vdb, ASharedTreeIsReadOnce) {
    VoxelBatch batch;
    for (uint64_t leaf = 0; leaf < 4096; ++leaf) batch.blocks.push_back({8 * leaf, 1, 0});
    std::string bytes = test::file_contents(write("a.vdb", batch, {.as_mask = true}));
    const size_t tree_size = bytes.size();
    ASSERT_GT(tree_size, 512u * 1024);
    const auto number = [](auto value) { return std::string(reinterpret_cast<const char*>(&value), sizeof value); };
    const auto text = [&](const std::string& words) { return number(uint32_t(words.size())) + words; };
    constexpr int kShares = 20;
    std::string scales;
    for (int i = 0; i < 15; ++i) scales += number(1.0);
    for (int i = 0; i < kShares; ++i) {
        const std::string names = text("share") + text("Tree_mask_5_4_3") + text("occupancy"), grid = number(uint32_t(2)) + number(uint32_t(0)) + text("UniformScaleMap") + scales;
        const uint64_t begin = bytes.size() + names.size() + 24;
        bytes += names + number(begin) + number(uint64_t(0)) + number(uint64_t(begin + grid.size())) + grid;
    }
    bytes.replace(61, 4, number(int32_t(1 + kShares)));  // grids, behind the signature, versions, a UUID and no metadata
    const CountingSource source(bytes);
    const VdbFile file = read_vdb_info(source);
    ASSERT_EQ(file.grids.size(), size_t(1 + kShares));
    for (const VdbGrid& grid : file.grids) {
        EXPECT_EQ(grid.active_voxels, 4096u);
        EXPECT_EQ(grid.greatest_index, file.grids[0].greatest_index);
    }
    EXPECT_LT(source.bytes_read, 4 * tree_size);
}

// Every length that cuts the header, and more of them beyond.
TEST_F(Vdb, EveryTruncationIsRefused) {
    for (const bool as_mask : {false, true}) {
        const std::string path = write("a.vdb", some_voxels(), {.as_mask = as_mask}), bytes = test::file_contents(path);
        for (size_t size = 0; size < bytes.size(); size += size < 1500 ? 1 : 97) {
            EXPECT_THROW(read_vdb_voxels(*memory_source("part", test::bytes_of(bytes.substr(0, size))), {}), Error) << size;
        }
    }
}

// Bits of the header and of the tree: an Error, or other voxels; OpenVDB has no checksums.
TEST_F(Vdb, FlippedBitsNeverCrash) {
    std::mt19937 random(1);
    for (const bool as_mask : {false, true})
        for (const VdbCompression compression : {VdbCompression::none, VdbCompression::zip, VdbCompression::blosc}) {
            const std::string bytes = test::file_contents(write("a.vdb", some_voxels(), {.as_mask = as_mask, .compression = compression}));
            size_t refused = 0;
            for (int i = 0; i < 300; ++i) {
                std::vector<std::byte> damaged = test::bytes_of(bytes);
                damaged[random() % (i % 2 ? bytes.size() : 1500)] ^= std::byte(1 << random() % 8);
                try {
                    tree_of(read_vdb_voxels(*memory_source("damaged", damaged), {.memory_bytes = 100 << 20}));
                } catch (const Error&) {
                    ++refused;
                }
            }
            EXPECT_GT(refused, 30u);
        }
}

// Files by OpenVDB with what our writer does not write: two grids that share a tree, double, inactive values beside the background.
TEST(VdbData, KeptFilesOfOtherKinds) {
    const std::string folder = STRATA_SOURCE_DIR "/tests/fuzz/corpus/vdb/";
    const VdbFile shared = read_vdb_info(folder + "bools");
    ASSERT_EQ(shared.grids.size(), 2u);
    EXPECT_EQ(shared.grids[1].name, "second");
    for (const VdbGrid& grid : shared.grids) EXPECT_EQ(grid.type + " " + std::to_string(grid.active_voxels.value_or(0)), "bool 513");
    for (const std::string name : {"", "second"}) {
        const VdbVoxels voxels = read_vdb_voxels(folder + "bools", {.grid = name});
        const VoxelTree tree = tree_of(voxels);  // a point at (1, 2, 3) and a tile from 8 to 15
        EXPECT_EQ(voxels.frame, (VoxelFrame{.origin = Vec3d::Constant(-0.5), .voxel_size = 1.0, .levels = 2}));
        EXPECT_EQ(count_voxels(tree), 513u);
        EXPECT_TRUE(is_occupied(tree, 1, 2, 3));
        EXPECT_TRUE(is_occupied(tree, 8, 15, 12));
    }
    for (const std::string name : {"double", "double_all"}) {
        const VdbVoxels voxels = read_vdb_voxels(folder + name);  // of three values one is active, at (1, -2, 3)
        EXPECT_EQ(voxels.voxels.voxels(), 1u) << name;
        EXPECT_EQ(voxels.frame.origin, Vec3d(0.5, -6.5, 2.5)) << name;
        EXPECT_TRUE(is_occupied(tree_of(voxels), 1, 6, 3)) << name;
        EXPECT_EQ(read_vdb_voxels(folder + name, {.isovalue = 1.0}).voxels.voxels(), 0u) << name;
    }
    // A sphere of radius 4: the lattice points with squares of at most 16, and those on it as float rounds.
    const uint64_t inside = read_vdb_voxels(folder + "level_set").voxels.voxels();
    EXPECT_GE(inside, 251u);
    EXPECT_LE(inside, 257u);
}

// The bytes of a map that is not known are stepped over, so its grid's tree cannot be found, unless it is another's.
TEST(VdbData, GridsOfUnknownMapsAreListed) {
    const std::string bytes = test::file_contents(STRATA_SOURCE_DIR "/tests/fuzz/corpus/vdb/bools"), known = "UniformScaleMap", unknown = "SomeFrustumsMap";
    const size_t first = bytes.find(known), second = bytes.find(known, first + 1);
    ASSERT_NE(second, std::string::npos);
    for (const bool own_tree : {true, false}) {
        std::string changed = bytes;
        changed.replace(own_tree ? first : second, known.size(), unknown);
        const std::unique_ptr<ByteSource> source = memory_source("file", test::bytes_of(changed));
        const VdbFile file = read_vdb_info(*source);
        ASSERT_EQ(file.grids.size(), 2u);
        const VdbGrid& grid = file.grids[own_tree ? 0 : 1];
        EXPECT_EQ(grid.map, unknown);
        EXPECT_FALSE(grid.voxel_size);
        for (const VdbGrid& each : file.grids) {  // the second shares the tree of the first
            EXPECT_EQ(is_readable(each), !own_tree);
            EXPECT_EQ(each.background.has_value(), !own_tree);
        }
        EXPECT_EQ(file.grids[1].active_voxels.has_value(), !own_tree);
        if (!own_tree) {
            EXPECT_EQ(read_vdb_voxels(*source, {}).voxels.voxels(), 513u);
            EXPECT_EQ(message_of([&] { read_vdb_voxels(*source, {.grid = "second"}); }, ErrorKind::unsupported),
                      "file: grid second: voxels that are cubes along the axes are expected, its transform is SomeFrustumsMap");
            continue;
        }
        const std::string none = message_of([&] { read_vdb_voxels(*source, {}); }, ErrorKind::unsupported);
        EXPECT_NE(none.find("(bool, SomeFrustumsMap)"), std::string::npos) << none;
        EXPECT_EQ(message_of([&] { read_vdb_voxels(*source, {.grid = "second"}); }, ErrorKind::unsupported),
                  "file: grid second: its tree stands behind a transform that is not read");
    }
}

TEST(VdbData, RealFilesAreWhatTheIndexSays) {
    const char* const folder = std::getenv("STRATA_DATA");
    const std::string data = folder ? folder : "";
    if (!std::filesystem::exists(data + "/volume/headsq_quarter.vdb")) GTEST_SKIP() << "STRATA_DATA has no volume/headsq_quarter.vdb";
    const std::string head = data + "/volume/headsq_quarter.vdb", points = data + "/volume/sphere_points.vdb";
    const VdbFile file = read_vdb_info(head);
    ASSERT_EQ(file.grids.size(), 1u);
    EXPECT_EQ(file.grids[0].name, "density");
    EXPECT_EQ(file.grids[0].grid_class, "fog volume");
    EXPECT_EQ(file.grids[0].active_voxels, 144947u);
    EXPECT_EQ(file.grids[0].greatest_index, Vec3i(63, 63, 92));
    // Its values are all over 500.
    const VdbVoxels all = read_vdb_voxels(head), none = read_vdb_voxels(head, {.isovalue = 1e9});
    EXPECT_EQ(all.voxels.voxels(), 144947u);
    EXPECT_EQ(count_voxels(tree_of(all)), 144947u);
    EXPECT_EQ(read_vdb_voxels(head, {.isovalue = 500.0}).voxels.voxels(), 144947u);
    EXPECT_LT(read_vdb_voxels(head, {.isovalue = 1000.0}).voxels.voxels(), 144947u);
    EXPECT_EQ(none.voxels.voxels(), 0u);
    EXPECT_EQ(message_of([&] { read_vdb_voxels(head, {.memory_bytes = 10'000}); }, ErrorKind::limit).rfind(head + ": grid density: its voxels need more than ", 0), 0u);
    EXPECT_EQ(message_of([&] { read_vdb_voxels(points); }, ErrorKind::unsupported),
              points + ": a grid of float, double, bool or mask is expected, there are points (ptdataidx32)");
    EXPECT_EQ(read_vdb_info(points).grids.size(), 1u);
    EXPECT_THROW(open_points({&head, 1}), Error);
}

}  // namespace
}  // namespace strata
