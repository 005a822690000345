// Grids that OpenVDB writes as fields of bricks.
#include "io/vdb/vdb_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "core/error.h"
#include "io/vdb/vdb_writer.h"
#include "io/volume/volume_source.h"
#include "tests/support/store_in_memory.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

/// Values by index: those of bricks that are given, and of the others what is said of them.
class Values {
public:
    explicit Values(VdbField& field) : field_(field) {
        FieldBrickLayer layer;
        while (field.next_layer(layer)) {
            EXPECT_TRUE(bricks_.empty() || layer.k > bricks_.rbegin()->first[0]) << "layers ascend";
            std::array<int32_t, 2> before{};
            for (size_t i = 0; i < layer.corners.size(); ++i) {
                const auto [x, y] = layer.corners[i];
                if (i > 0) EXPECT_TRUE(std::pair(y, x) > std::pair(before[1], before[0])) << "corners ascend by j, then i";
                before = layer.corners[i];
                EXPECT_EQ((x | y | layer.k) & 7, 0);
                bricks_[{layer.k, y, x}].assign(layer.values.begin() + ptrdiff_t(i * 512), layer.values.begin() + ptrdiff_t(i * 512 + 512));
            }
        }
    }
    size_t bricks() const { return bricks_.size(); }
    const auto& all() const { return bricks_; }
    bool is_given(const Vec3i& corner) const { return bricks_.count({corner.z(), corner.y(), corner.x()}) > 0; }
    float at(const Vec3i& p) const {
        const Vec3i corner(p.x() & ~7, p.y() & ~7, p.z() & ~7), in = p - corner;
        const auto found = bricks_.find({corner.z(), corner.y(), corner.x()});
        return found == bricks_.end() ? field_.absent_value({corner.x(), corner.y(), corner.z()}) : found->second[size_t(in.x() + 8 * in.y() + 64 * in.z())];
    }
    // Of two bricks that touch and have different values, one is given.
    void expect_whole() const {
        for (const auto& [key, values] : bricks_)
            for (int i = 0; i < 27; ++i) {
                const Vec3i near(key[2] + 8 * (i % 3 - 1), key[1] + 8 * (i / 3 % 3 - 1), key[0] + 8 * (i / 9 - 1));
                if (is_given(near)) continue;
                for (int j = 0; j < 27; ++j) {
                    const Vec3i next = near + 8 * Vec3i(j % 3 - 1, j / 3 % 3 - 1, j / 9 - 1);
                    if (!is_given(next)) EXPECT_EQ(at(near), at(next)) << near.transpose() << " and " << next.transpose();
                }
            }
    }

private:
    VdbField& field_;
    std::map<std::array<int32_t, 3>, std::vector<float>> bricks_;
};

// Distances to a sphere that reaches over negative indices, whose inside is tiles of 8^3 points: each value is the distance, or that of the band's ends.
TEST(VdbField, LevelSetOfASphere) {
    if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write a file with";
    const TemporaryFolder folder;
    const Vec3d center(10, -5, 3);
    const double radius = 8.0, h = 0.125;
    MeshLevelSet(sphere_mesh(center, radius, 400), {.voxel_size = h}).write(folder.file("a.vdb"), false);
    const auto field = open_vdb_field(folder.file("a.vdb"), {});
    EXPECT_EQ(field->grid().grid_class, "level set");
    EXPECT_FLOAT_EQ(field->background(), float(3 * h));
    EXPECT_FLOAT_EQ(field->least(), float(-3 * h));
    const Values values(*field);
    EXPECT_GT(values.bricks(), 500u);
    values.expect_whole();
    const Vec3i middle = ((center - field->placement().origin) / h).array().round().cast<int>();
    for (int z = -70; z <= 70; z += 3)
        for (int y = -70; y <= 70; y += 5)
            for (int x = -70; x <= 70; ++x) {
                const Vec3i p = middle + Vec3i(x, y, z);
                const double distance = (field->placement().world_from_index(p.cast<double>()) - center).norm() - radius;
                // The mesh lies within 16 (1 - cos(pi / 800)) = 1.2e-4 of the sphere; away from it OpenVDB takes a triangle nearby for the nearest.
                EXPECT_NEAR(values.at(p), std::clamp(distance, -3 * h, 3 * h), std::abs(distance) < h ? 1.3e-4 : 0.25 * h) << p.transpose();
                if (std::abs(distance) < 3 * h) EXPECT_TRUE(values.is_given(Vec3i(p.x() & ~7, p.y() & ~7, p.z() & ~7)));
            }
    EXPECT_LT((field->bounds().max - center).maxCoeff(), radius + 1.5);
    EXPECT_GT((field->bounds().max - center).minCoeff(), radius);
}

// What does not fit in memory is read back from the scratch store, the same.
TEST(VdbField, ScratchStoreHoldsWhatDoesNotFit) {
    if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write a file with";
    const TemporaryFolder folder;
    MeshLevelSet(sphere_mesh({0, 0, 0}, 5.0, 100), {.voxel_size = 0.0625}).write(folder.file("a.vdb"), false);
    const auto whole = open_vdb_field(folder.file("a.vdb"), {});
    test::StoreInMemory scratch;
    const auto part = open_vdb_field(folder.file("a.vdb"), {.memory_bytes = 4 << 20, .scratch = &scratch});
    EXPECT_GT(scratch.size(), 0u);
    EXPECT_EQ(Values(*part).all(), Values(*whole).all());
    try {
        open_vdb_field(folder.file("a.vdb"), {.memory_bytes = 1 << 20});
        ADD_FAILURE() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_NE(std::string(error.what()).find("a.vdb: grid surface: its values need more than"), std::string::npos) << error.what();
    }
}

// Voxels as a grid of truth: 1 in cubes of every size, 0 outside, and a brick wherever the two touch.
TEST(VdbField, TilesHaveARimWhereTheyTouchWhatIsOutside) {
    if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write a file with";
    const TemporaryFolder folder;
    const VoxelFrame frame{.origin = {100, 200, 300}, .voxel_size = 0.5, .levels = 5};
    VdbWriter writer(folder.file("a.vdb"), false, frame, {});
    VoxelBatch batch;
    batch.blocks = {{.code = 0, .mask = ~uint64_t{0}, .height = 3}, {.code = uint64_t{1} << 23, .mask = 5}};  // 256^3 voxels at the corner, and two more
    writer.add(batch);
    writer.commit(Durability::unsynced);
    const auto field = open_vdb_field(folder.file("a.vdb"), {});
    const Values values(*field);
    values.expect_whole();
    EXPECT_EQ(field->background(), 0.0f);
    EXPECT_EQ(field->placement().world_from_index(Vec3d(0, 0, 0)), Vec3d(100.25, 200.25, 300.25));
    const auto expected = [](const Vec3i& p) { return p.minCoeff() >= 0 && p.maxCoeff() < 256 ? 1.0f : 0.0f; };
    for (int i = 0; i < 4096; ++i) {
        const Vec3i p = 17 * Vec3i(i & 15, i >> 4 & 15, i >> 8) - Vec3i::Constant(3);
        EXPECT_EQ(values.at(p), expected(p)) << p.transpose();
    }
    EXPECT_TRUE(values.is_given({0, 80, 80}));
    EXPECT_TRUE(values.is_given({248, 248, 248}));
    EXPECT_FALSE(values.is_given({80, 80, 80}));
    EXPECT_LE(values.bricks(), 32u * 32 * 32 - 30 * 30 * 30 + 16);
}

// The grid was made of the other file's values over 500, one after the other with z running fastest, as a picture of it shows.
TEST(VdbField, RealGridHasTheValuesOfItsVolume) {
    const char* const data = std::getenv("STRATA_DATA");
    if (data == nullptr || !std::filesystem::exists(std::string(data) + "/volume/headsq_quarter.vdb")) GTEST_SKIP() << "the folder STRATA_DATA with real volumes is not there";
    const auto field = open_vdb_field(std::string(data) + "/volume/headsq_quarter.vdb", {});
    const auto volume = open_volume(std::string(data) + "/volume/headsq_quarter.mha");
    std::vector<float> samples(size_t(volume->header().samples()));
    volume->read(volume->size()[2], 0.0, samples);
    const Values values(*field);
    values.expect_whole();
    size_t over = 0, wrong = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
        if (samples[i] <= 500) continue;
        ++over;
        wrong += values.at(Vec3i(int(i / 93 / 64), int(i / 93 % 64), int(i % 93))) != samples[i];
    }
    EXPECT_EQ(wrong, 0u);
    EXPECT_EQ(over, 144'947u);
    EXPECT_EQ(field->greatest(), 3926.0f);
}

}  // namespace
}  // namespace strata
