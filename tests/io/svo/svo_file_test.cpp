#include "io/svo/svo_file.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <fstream>
#include <random>

#include "core/error.h"
#include "core/voxel/voxel_dag.h"
#include "io/svo/svo_dag_coding.h"
#include "io/svo/svo_layout.h"
#include "tests/support/dense_voxels.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

constexpr VoxelAttributes kAll = {.count = true, .color = true, .normal = true, .opacity = true};

VoxelBatch with_attributes(VoxelBatch batch, uint32_t seed) {
    std::mt19937 random(seed);
    for (const VoxelBlock& block : batch.blocks)
        for (int voxel = std::popcount(block.mask); voxel > 0; --voxel) {
            batch.counts.push_back(1 + random() % 100);
            batch.colors.push_back({uint8_t(random()), uint8_t(random()), uint8_t(random())});
            batch.normals.push_back({int8_t(random()), 3, int8_t(random())});
        }
    return batch;
}

void write_svo(const std::string& path, const DenseVoxels& grid, const VoxelAttributes& attributes) {
    SvoWriter writer(path, false, grid.frame(), {"solid", "EPSG:25832"});
    VoxelTreeBuilder builder(grid.frame(), attributes, writer);
    builder.add(with_attributes(grid.batch(), 2));
    writer.commit(builder.finish().voxels, Durability::unsynced);
}

VoxelTree built(const DenseVoxels& grid, const VoxelAttributes& attributes) {
    VoxelTreeInMemory memory(grid.frame(), attributes);
    VoxelTreeBuilder builder(grid.frame(), attributes, memory);
    builder.add(with_attributes(grid.batch(), 2));
    builder.finish();
    return memory.take();
}

void expect_equal(const VoxelTree& tree, const VoxelTree& other, size_t levels) {
    ASSERT_EQ(tree.levels.size(), levels);
    for (size_t level = 0; level < levels; ++level) {
        EXPECT_EQ(tree.levels[level].masks, other.levels[level].masks);
        EXPECT_EQ(tree.levels[level].full, other.levels[level].full);
    }
    ASSERT_EQ(tree.attributes.size(), other.attributes.empty() || tree.empty() ? 0 : 2 * levels + 1);
    for (size_t depth = 0; depth < tree.attributes.size(); ++depth) {
        EXPECT_EQ(tree.attributes[depth].counts, other.attributes[depth].counts);
        EXPECT_EQ(tree.attributes[depth].colors, other.attributes[depth].colors);
        EXPECT_EQ(tree.attributes[depth].normals, other.attributes[depth].normals);
        EXPECT_EQ(tree.attributes[depth].opacities, other.attributes[depth].opacities);
    }
}

std::vector<std::byte> bytes_of(const std::string& path) {
    const std::unique_ptr<ByteSource> file = open_file(path);
    std::vector<std::byte> bytes(file->size());
    file->read(0, bytes);
    return bytes;
}

// The whole tree, refused or equal to what was written: nothing else.
void open_and_load(std::vector<std::byte> bytes) {
    const SvoFile file(memory_source("damaged.svo", std::move(bytes)));
    file.load(file.levels_within(uint64_t{64} << 20, true), true, 1);
}

TEST(SvoFile, GivesBackWhatWasWritten) {
    const TemporaryFolder folder;
    const DenseVoxels grids[] = {random_grid(3, 0.3, 1), ball_grid(4, 0.45), random_grid(1, 0.5, 4), DenseVoxels(2)};
    int number = 0;
    for (const DenseVoxels& grid : grids)
        for (const VoxelAttributes& attributes : {VoxelAttributes{}, kAll, VoxelAttributes{.color = true}, VoxelAttributes{.opacity = true}}) {
            const std::string path = folder.file(std::to_string(number++) + ".svo");
            write_svo(path, grid, attributes);
            const SvoFile file = open_svo(path);
            EXPECT_EQ(file.frame(), grid.frame());
            EXPECT_EQ(file.labels().kind, "solid");
            EXPECT_EQ(file.labels().crs, "EPSG:25832");
            EXPECT_EQ(file.voxels(), uint64_t(std::count(grid.solid.begin(), grid.solid.end(), 1)));
            if (file.voxels() > 0) EXPECT_EQ(file.attributes(), attributes);
            expect_equal(file.load(kMostVoxelLevels, true, 2), built(grid, attributes), size_t(grid.levels));
        }
}

void write_dag(const std::string& path, const DenseVoxels& grid) {
    const VoxelDag dag = dag_of(tree_of(grid));
    SvoWriter writer(path, false, grid.frame(), {"thin", ""}, svo::Layout::dag);
    write_svo_dag(dag, writer);
    writer.commit(count_voxels(dag), Durability::unsynced);
}

TEST(SvoFile, DagsGiveBackTheirTree) {
    const TemporaryFolder folder;
    int number = 0;
    DenseVoxels whole(2);
    std::fill(whole.solid.begin(), whole.solid.end(), char(1));
    for (const DenseVoxels& grid : {random_grid(3, 0.02, 1), ball_grid(4, 0.45), random_grid(1, 0.5, 4), DenseVoxels(2), whole}) {
        const std::string path = folder.file(std::to_string(number++) + ".svo");
        write_dag(path, grid);
        const SvoFile file = open_svo(path);
        const VoxelTree tree = tree_of(grid);
        ASSERT_NE(file.dag(), nullptr);
        for (int levels = 1; levels <= grid.levels; ++levels) {
            expect_equal(file.load(levels, true, 1), tree, size_t(levels));
            EXPECT_EQ(file.nodes(levels - 1), tree.levels[size_t(levels) - 1].masks.size());
        }
    }
}

TEST(SvoDagCoding, MasksKeepTheirBytes) {
    const std::vector<uint64_t> masks = {1, 0x8000000000000000, 0x00ff000000120000, kFullMask};
    const std::vector<uint8_t> bytes = svo::encode_masks(masks);
    EXPECT_EQ(std::vector<uint8_t>(bytes.begin(), bytes.begin() + 7), (std::vector<uint8_t>{1, 1, 0x80, 0x80, 0x44, 0x12, 0xff}));
    EXPECT_EQ(bytes.size(), 2 + 2 + 3 + 9u);
    EXPECT_EQ(svo::decode_masks(bytes, "x"), masks);
    EXPECT_THROW(svo::decode_masks(std::span(bytes).first(6), "x"), Error);
    EXPECT_THROW(svo::decode_masks(std::vector<uint8_t>{1, 0}, "x"), Error);
}

// Worked by hand: nodes 0, 0, 1, 2, 0, 2 are new (1), 0 of one (0), new (1), new (1), 0 of three (0 00), 2 of three (0 10 -> 0 0 1).
TEST(SvoDagCoding, PointersOfASmallLevel) {
    const std::vector<uint32_t> pointers = {0, 0, 1, 2, 0, 2};
    const std::vector<uint8_t> bytes = svo::encode_pointers(pointers);
    EXPECT_EQ(bytes, (std::vector<uint8_t>{0b00001101, 0b10}));
    EXPECT_EQ(svo::decode_pointers(bytes, 6, "x"), pointers);
    EXPECT_THROW(svo::decode_pointers(bytes, 9, "x"), Error);
    EXPECT_THROW(svo::decode_pointers(bytes, 5, "x"), Error);
    EXPECT_THROW(svo::decode_pointers(std::vector<uint8_t>{0b11101101, 0b11}, 6, "x"), Error);  // node 3 of three
    EXPECT_TRUE(svo::encode_pointers({}).empty());
    EXPECT_TRUE(svo::decode_pointers({}, 0, "x").empty());
}

// Each level is a model, and reading it touches no other.
TEST(SvoFile, CoarserLevelsComeAlone) {
    const TemporaryFolder folder;
    const DenseVoxels grid = random_grid(3, 0.2, 9);
    write_svo(folder.file("a.svo"), grid, kAll);
    const SvoFile file = open_svo(folder.file("a.svo"));
    const VoxelTree whole = built(grid, kAll);
    for (int levels = 1; levels <= 3; ++levels) {
        expect_equal(file.load(levels, true, 1), whole, size_t(levels));
        EXPECT_EQ(file.levels_within(file.memory_bytes(levels, true), true), levels);
        EXPECT_EQ(file.levels_within(file.memory_bytes(levels, true) - 1, true), std::max(levels - 1, 1));
    }
    EXPECT_TRUE(file.load(3, false, 1).attributes.empty());
}

TEST(SvoFile, ReadsPartsOfStreams) {
    const TemporaryFolder folder;
    const DenseVoxels grid = random_grid(3, 0.3, 5);  // 78,000 voxels: several blocks of colors
    write_svo(folder.file("a.svo"), grid, kAll);
    const SvoFile file = open_svo(folder.file("a.svo"));
    const std::vector<VoxelColor> colors = built(grid, kAll).attributes[6].colors;
    ASSERT_GT(colors.size() * sizeof colors[0], 2 * svo::kBlockBytes);
    std::mt19937 random(1);
    for (int i = 0; i < 200; ++i) {
        const uint64_t first = random() % colors.size(), count = random() % (colors.size() - first);
        std::vector<VoxelColor> part(count);
        file.read({VoxelStream::Kind::color, 6}, first, std::as_writable_bytes(std::span(part)));
        ASSERT_TRUE(std::equal(part.begin(), part.end(), colors.begin() + std::ptrdiff_t(first)));
    }
    std::vector<VoxelColor> beyond(2);
    EXPECT_THROW(file.read({VoxelStream::Kind::color, 6}, colors.size() - 1, std::as_writable_bytes(std::span(beyond))), Error);
    EXPECT_THROW(file.read({VoxelStream::Kind::opacity, 6}, 0, std::as_writable_bytes(std::span(beyond))), Error);
}

TEST(SvoFile, WritesTheSameBytesWhateverTheBatches) {
    const TemporaryFolder folder;
    const DenseVoxels grid = random_grid(3, 0.3, 8);  // 78,000 voxels: several blocks of each stream
    write_svo(folder.file("a.svo"), grid, kAll);
    SvoWriter writer(folder.file("b.svo"), false, grid.frame(), {"solid", "EPSG:25832"});
    VoxelTreeBuilder builder(grid.frame(), kAll, writer);
    const VoxelBatch all = with_attributes(grid.batch(), 2);
    size_t voxel = 0;
    for (const VoxelBlock& block : all.blocks) {
        const std::ptrdiff_t first = std::ptrdiff_t(voxel), end = first + std::popcount(block.mask);
        builder.add({.blocks = {block},
                     .counts = {all.counts.begin() + first, all.counts.begin() + end},
                     .colors = {all.colors.begin() + first, all.colors.begin() + end},
                     .normals = {all.normals.begin() + first, all.normals.begin() + end}});
        voxel = size_t(end);
    }
    writer.commit(builder.finish().voxels, Durability::unsynced);
    EXPECT_EQ(bytes_of(folder.file("a.svo")), bytes_of(folder.file("b.svo")));
}

TEST(SvoFile, NothingStaysOfWhatWasNotFinished) {
    const TemporaryFolder folder;
    {
        SvoWriter writer(folder.file("a.svo"), false, VoxelFrame(), {});
        writer.append({VoxelStream::Kind::mask, 0}, std::vector<std::byte>(200000));
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// Of a damaged file every bit is checked by one of the checksums, or is padding between what is read.
TEST(SvoFile, EveryTruncationAndFlippedBitIsFound) {
    const TemporaryFolder folder;
    const DenseVoxels grid = ball_grid(2, 0.4);
    write_svo(folder.file("a.svo"), grid, {.opacity = true});
    const std::vector<std::byte> whole = bytes_of(folder.file("a.svo"));
    EXPECT_NO_THROW(open_and_load(whole));
    for (size_t size = 0; size < whole.size(); ++size) EXPECT_THROW(open_and_load({whole.begin(), whole.begin() + std::ptrdiff_t(size)}), Error) << size;
    for (size_t bit = 0; bit < 8 * whole.size(); ++bit) {
        std::vector<std::byte> damaged = whole;
        damaged[bit / 8] ^= std::byte(1 << bit % 8);
        EXPECT_THROW(open_and_load(damaged), Error) << "bit " << bit;
    }
    write_dag(folder.file("b.svo"), random_grid(2, 0.05, 6));
    const std::vector<std::byte> dag = bytes_of(folder.file("b.svo"));
    EXPECT_NO_THROW(open_and_load(dag));
    for (size_t size = 0; size < dag.size(); ++size) EXPECT_THROW(open_and_load({dag.begin(), dag.begin() + std::ptrdiff_t(size)}), Error) << size;
    for (size_t bit = 0; bit < 8 * dag.size(); ++bit) {
        std::vector<std::byte> damaged = dag;
        damaged[bit / 8] ^= std::byte(1 << bit % 8);
        EXPECT_THROW(open_and_load(damaged), Error) << "bit " << bit;
    }
}

// A hostile file has checksums that fit. Whatever it says, it is refused or read within its own size.
TEST(SvoFile, LiesThatCheckOutAreRefusedOrHarmless) {
    const TemporaryFolder folder;
    write_svo(folder.file("a.svo"), random_grid(2, 0.1, 3), kAll);
    write_dag(folder.file("b.svo"), random_grid(3, 0.01, 3));
    for (const char* const name : {"a.svo", "b.svo"}) {
        const std::vector<std::byte> whole = bytes_of(folder.file(name));
        uint64_t offset = 0, size = 0;
        std::memcpy(&offset, whole.data() + 64, 8);
        std::memcpy(&size, whole.data() + 72, 8);
        ASSERT_EQ(offset + size, whole.size());
        std::mt19937 random(17);
        int refused = 0;
        for (int i = 0; i < 20000; ++i) {
            std::vector<std::byte> lie = whole;
            // A number of the header or the directory becomes another, often an extreme one.
            const bool in_header = i % 4 == 0;
            const size_t at = in_header ? 8 + random() % 76 : size_t(offset) + random() % size;
            const size_t bytes = std::min<size_t>(size_t{1} << random() % 4, lie.size() - at);
            const uint64_t value = random() % 3 == 0 ? ~uint64_t{0} >> random() % 64 : random() % 3 == 0 ? random() : (uint64_t{1} << random() % 64);
            std::memcpy(lie.data() + at, &value, bytes);
            const auto put = [&](size_t place, uint32_t number) { std::memcpy(lie.data() + place, &number, 4); };
            put(80, svo::checksum(lie.data() + offset, size));
            put(124, svo::checksum(lie.data(), 124));
            try {
                open_and_load(lie);
            } catch (const Error&) {
                ++refused;
            }
        }
        EXPECT_GT(refused, 10000);
    }
}

TEST(SvoFile, SaysWhatItIsNot) {
    const auto message = [](std::vector<std::byte> bytes) {
        try {
            open_and_load(std::move(bytes));
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message({}), "damaged.svo: header: 128 bytes needed, 0 there");
    EXPECT_EQ(message(std::vector<std::byte>(200)), "damaged.svo: header: not a voxel file, or one whose line ends were changed on its way");
}

}  // namespace
}  // namespace strata
