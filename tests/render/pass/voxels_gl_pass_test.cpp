#include "render/pass/voxels_gl_pass.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "core/voxel/voxel_tree_builder.h"
#include "render/gl/egl_context.h"
#include "tests/support/empty_gbuffer.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 96, kHeight = 80;
constexpr uint64_t kAmple = uint64_t{1} << 30;

GBuffer empty_gbuffer(uint32_t first_row = 0, uint32_t rows = kHeight) { return test::empty_gbuffer(kWidth, first_row, rows); }

// What differs between the pictures of the two, in shares of the covered pixels.
struct Differences {
    double covered = 0.0, cells = 0.0, depths = 0.0, colors = 0.0;
};

Differences compare(const GBuffer& cpu, const GBuffer& gpu, int color_steps, double depth_error) {
    Differences differ;
    for (size_t pixel = 0; pixel < cpu.ids.size(); ++pixel) {
        if (cpu.ids[pixel] == kNoPixelId && gpu.ids[pixel] == kNoPixelId) continue;
        differ.covered += 1.0;
        if (cpu.ids[pixel] != gpu.ids[pixel]) {
            differ.cells += 1.0;
            continue;
        }
        differ.depths += !(std::abs(cpu.depths[pixel] - gpu.depths[pixel]) <= depth_error);
        int step = std::abs(int(cpu.splat_px[pixel]) - int(gpu.splat_px[pixel]));
        for (const auto channel : {red_of, green_of, blue_of, alpha_of})
            step = std::max(step, std::abs(int(channel(cpu.colors[pixel])) - int(channel(gpu.colors[pixel]))));
        differ.colors += step > color_steps;
    }
    differ.cells /= std::max(differ.covered, 1.0);
    differ.depths /= std::max(differ.covered, 1.0);
    differ.colors /= std::max(differ.covered, 1.0);
    return differ;
}

// From far enough to see all of a cube of that side at the origin, or from inside.
Camera random_camera(Random& random, Projection projection, double side, bool inside) {
    Camera camera;
    camera.projection = projection;
    const Vec3d middle = Vec3d::Constant(0.5 * side), away(random.normal(), random.normal(), random.normal());
    camera.eye = inside ? Vec3d(random.uniform(0, side), random.uniform(0, side), random.uniform(0, side))
                        : Vec3d(middle + (1.2 + random.uniform()) * side * away.normalized());
    camera.view_from_world =
        look_along(inside ? away : Vec3d(middle - camera.eye), Vec3d(random.normal(), random.normal(), random.normal()));
    camera.fov_rad = 0.9;
    camera.height = 1.7 * side;
    camera.near_depth = 1e-3;
    camera.far_depth = 10 * side;
    return camera;
}

// Random voxels with random attributes, some normals unknown.
VoxelTree painted_tree(int levels, uint64_t seed) {
    const VoxelCube voxels = random_boxes(levels, 40, seed);
    VoxelFrame frame;
    frame.levels = levels;
    const VoxelAttributes attributes = {.count = true, .color = true, .normal = true};
    VoxelTreeInMemory memory(frame, attributes);
    VoxelTreeBuilder builder(frame, attributes, memory);
    Random random(seed);
    VoxelBatch batch;
    const uint32_t blocks = voxels.side() / 4;
    for (uint64_t code = 0; code < uint64_t{blocks} * blocks * blocks; ++code) {
        const std::array<uint32_t, 3> place = coordinates_of_code(code);
        uint64_t mask = 0;
        for (uint64_t bit = 0; bit < 64; ++bit) {
            const std::array<uint32_t, 3> cell = coordinates_of_code(bit);
            if (!voxels.at(4 * place[0] + cell[0], 4 * place[1] + cell[1], 4 * place[2] + cell[2])) continue;
            mask |= uint64_t{1} << bit;
            batch.counts.push_back(uint32_t(random.bits() % 100) + 1);
            batch.colors.push_back({uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits())});
            const Vec3d normal = 127.0 * Vec3d(random.normal(), random.normal(), random.normal()).normalized();
            batch.normals.push_back(random.uniform() < 0.1 ? VoxelNormal{}
                                                           : VoxelNormal{int8_t(normal.x()), int8_t(normal.y()), int8_t(normal.z())});
        }
        if (mask != 0) batch.blocks.push_back({.code = code, .mask = mask});
    }
    builder.add(batch);
    builder.finish();
    return memory.take();
}

// One context and program for all tests: llvmpipe takes a second to compile it.
class VoxelsGl : public testing::Test {
protected:
    static void SetUpTestSuite() {
        try {
            context_ = new EglContext(2);
        } catch (const Error& error) {
            problem_ = new std::string(error.what());
            return;
        }
        gpu_ = new VoxelsGlPass(*context_);
    }
    static void TearDownTestSuite() {
        delete gpu_;
        delete context_;
        delete problem_;
    }
    void SetUp() override {
        if (problem_ != nullptr) GTEST_SKIP() << "no EGL with OpenGL 4.5 here: " << *problem_;
        ASSERT_NE(gpu_, nullptr);
    }

    // Draws with both. Software GL divides as the CPU does, so rays find the same; lengths and cosines may be rounded otherwise.
    void expect_alike(const VoxelModel& model, const Camera& camera, double error_px, std::span<const ClipBox> clips,
                      const std::string& what) {
        const UpAxis up = camera.projection == Projection::orthographic ? UpAxis::y : UpAxis::z;
        const VoxelView view = {camera, kWidth, kHeight, Vec2f(0.25f, -0.375f), error_px, clips, 2, up};
        GBuffer cpu = empty_gbuffer(), gpu = empty_gbuffer();
        const VoxelsDrawn cpu_drawn = draw_voxels(model, 3, view, cpu);
        VoxelsDrawn gpu_drawn;
        ASSERT_TRUE(gpu_->draw(model, 3, view, kAmple, gpu, gpu_drawn));
        const bool smooth = model.shading == VoxelShading::smooth;
        const double depth_error = smooth ? 1e-4 * model.tree->frame.side() : 0.0;
        const Differences differ = compare(cpu, gpu, 2, depth_error);
        covered_ += differ.covered;
        EXPECT_LE(differ.cells, context_->is_software() ? 0.0 : 0.002) << what;
        EXPECT_LE(differ.depths, context_->is_software() ? 0.0 : 0.005) << what;
        // A normal across the ray has either sign.
        EXPECT_LE(differ.colors, 0.003) << what;
        EXPECT_EQ(cpu_drawn.finest_depth, gpu_drawn.finest_depth) << what;
        EXPECT_NEAR(cpu_drawn.error_px, gpu_drawn.error_px, 1e-5 * cpu_drawn.error_px) << what;
        EXPECT_EQ(cpu_drawn.short_of_memory, gpu_drawn.short_of_memory) << what;
    }

    static inline EglContext* context_ = nullptr;
    static inline VoxelsGlPass* gpu_ = nullptr;
    static inline std::string* problem_ = nullptr;
    double covered_ = 0.0;
};

TEST_F(VoxelsGl, DrawsWhatTheCpuDraws) {
    Random random(7);
    for (int round = 0; round < 8; ++round) {
        const int levels = 2 + round % 2;
        VoxelTree tree = tree_of(random_boxes(levels, 20, uint64_t(round)), round % 4 >= 2);
        tree.frame.origin = Vec3d(500000, 5300000, -12.5);
        tree.frame.voxel_size = 0.375;
        if (round == 7) {  // a tree that ends early
            tree.levels.pop_back();
            tree.levels.back().first_child.clear();
        }
        for (const Projection projection : {Projection::perspective, Projection::orthographic})
            for (const VoxelShading shading : {VoxelShading::flat, VoxelShading::smooth}) {
                Camera camera = random_camera(random, projection, 0.375 * tree.frame.side(), round % 3 == 2);
                camera.eye += tree.frame.origin;
                const double error_px = round % 2 == 0 ? 1.0 : 6.0;
                const VoxelModel model(tree, VoxelColors(tree, round % 2 == 0 ? "plain" : "elevation", std::nullopt, {}), shading);
                expect_alike(model, camera, error_px, {}, std::to_string(round) + (shading == VoxelShading::flat ? " flat" : " smooth"));
            }
    }
    EXPECT_GT(covered_, 20000.0);
}

TEST_F(VoxelsGl, ColorsAndNormalsAreThoseOfTheTree) {
    const VoxelTree tree = painted_tree(3, 5);
    Random random(9);
    for (const char* color : {"rgb", "count", "normal", "lod", "elevation"})
        for (const VoxelShading shading : {VoxelShading::flat, VoxelShading::smooth})
            for (const double error_px : {0.5, 5.0, 12.0})
                expect_alike(VoxelModel(tree, VoxelColors(tree, color, std::nullopt, {}), shading),
                             random_camera(random, Projection::perspective, 64, false), error_px, {},
                             std::string(color) + ' ' + std::to_string(error_px));
    EXPECT_GT(covered_, 20000.0);
}

TEST_F(VoxelsGl, ClipBoxesCutAlike) {
    const VoxelTree tree = tree_of(random_boxes(3, 60, 3));
    const VoxelModel model(tree, VoxelColors(tree, "plain", std::nullopt, {}));
    Random random(2);
    for (int round = 0; round < 24; ++round) {
        // Faces on those of voxels in half of the rounds.
        std::vector<ClipBox> clips(size_t(1 + round % 5));
        for (size_t i = 0; i < clips.size(); ++i) {
            const Vec3d middle(random.uniform(0, 64), random.uniform(0, 64), random.uniform(0, 64)),
                half(random.uniform(4, 30), random.uniform(4, 30), random.uniform(4, 30));
            clips[i].box = {.min = middle - half, .max = middle + half};
            if (round % 2 == 0)
                for (int axis = 0; axis < 3; ++axis)
                    clips[i].box.min[axis] = std::floor(clips[i].box.min[axis]), clips[i].box.max[axis] = std::ceil(clips[i].box.max[axis]);
            if (i % 2 == size_t(round / 2) % 2) clips[i].action = ClipBox::Action::remove;
        }
        expect_alike(model, random_camera(random, round % 3 == 0 ? Projection::orthographic : Projection::perspective, 64, round % 4 == 3),
                     1.0, clips, std::to_string(round));
    }
    EXPECT_GT(covered_, 20000.0);
}

// Rows by themselves are those of the whole picture, and what is nearer stays.
TEST_F(VoxelsGl, StripsAndWhatIsThereCountAsOnTheCpu) {
    const VoxelTree tree = tree_of(random_boxes(3, 60, 4));
    const VoxelModel model(tree, VoxelColors(tree, "plain", std::nullopt, {}), VoxelShading::smooth);
    Random random(3);
    const Camera camera = random_camera(random, Projection::perspective, 64, false);
    const VoxelView view = {camera, kWidth, kHeight, Vec2f::Zero(), 1.0, {}, 2};
    VoxelsDrawn drawn;
    GBuffer whole = empty_gbuffer(), strip = empty_gbuffer(30, 20);
    ASSERT_TRUE(gpu_->draw(model, 1, view, kAmple, whole, drawn));
    const std::vector<float> depths = whole.depths;
    for (size_t i = 0; i < strip.depths.size(); i += 3) strip.depths[i] = depths[30 * kWidth + i] * (i % 2 == 0 ? 0.5f : 2.0f);
    const std::vector<float> before = strip.depths;
    ASSERT_TRUE(gpu_->draw(model, 1, view, kAmple, strip, drawn));
    size_t kept = 0;
    for (size_t i = 0; i < strip.depths.size(); ++i) {
        const bool stays = i % 3 == 0 && i % 2 == 0 && depths[30 * kWidth + i] != kNoDepth;
        ASSERT_EQ(strip.depths[i], stays ? before[i] : depths[30 * kWidth + i]);
        ASSERT_EQ(strip.colors[i], stays ? 0 : whole.colors[30 * kWidth + i]);
        kept += stays;
    }
    EXPECT_GT(kept, 50u);
}

// Without room nothing is drawn; with room for one tree, one makes room for another.
TEST_F(VoxelsGl, MemoryIsCapped) {
    const VoxelTree one = tree_of(random_boxes(3, 60, 4)), other = tree_of(random_boxes(3, 60, 5));
    uint64_t nodes = 0;
    for (const VoxelTree* tree : {&one, &other}) {
        uint64_t of_tree = 0;
        for (const VoxelLevel& level : tree->levels) of_tree += level.masks.size();
        nodes = std::max(nodes, of_tree);
    }
    Random random(3);
    const Camera camera = random_camera(random, Projection::perspective, 64, false);
    const VoxelView view = {camera, kWidth, kHeight, Vec2f::Zero(), 1.0, {}, 2};
    const VoxelModel first(one, VoxelColors(one, "plain", std::nullopt, {})), second(other, VoxelColors(other, "plain", std::nullopt, {}));
    VoxelsDrawn drawn;
    GBuffer gbuffer = empty_gbuffer();
    EXPECT_FALSE(gpu_->draw(first, 1, view, 100, gbuffer, drawn));
    EXPECT_EQ(drawn.finest_depth, 0);
    for (const VoxelModel* model : {&first, &second, &first}) {
        GBuffer gpu = empty_gbuffer(), cpu = empty_gbuffer();
        ASSERT_TRUE(gpu_->draw(*model, 1, view, 16 * nodes, gpu, drawn));
        draw_voxels(*model, 1, view, cpu);
        EXPECT_LE(compare(cpu, gpu, 2, 0.0).cells, 0.002);
    }
}

// A tree that comes to lie where another one was is not taken for it, and a copy of a model that is to be lit otherwise gets its normals.
TEST_F(VoxelsGl, ModelsAreToldApart) {
    Random random(6);
    VoxelTree tree;
    for (const uint64_t seed : {11, 12, 13}) {
        tree = painted_tree(3, seed);
        VoxelModel model(tree, VoxelColors(tree, "plain", std::nullopt, {}));
        const Camera camera = random_camera(random, Projection::perspective, 64, false);
        expect_alike(model, camera, 1.0, {}, std::to_string(seed) + " flat");
        model.shading = VoxelShading::smooth;
        expect_alike(model, camera, 1.0, {}, std::to_string(seed) + " smooth");
    }
    EXPECT_GT(covered_, 5000.0);
}

// A tree that the GPU has no room for is not taken for one that is there when it is drawn again. An error that is pending stands in for the lack of room.
TEST_F(VoxelsGl, ATreeThatFoundNoRoomIsBroughtAgain) {
    const VoxelTree tree = tree_of(random_boxes(3, 60, 6));
    const VoxelModel model(tree, VoxelColors(tree, "plain", std::nullopt, {}));
    Random random(4);
    const Camera camera = random_camera(random, Projection::perspective, 64, false);
    const VoxelView view = {camera, kWidth, kHeight, Vec2f::Zero(), 1.0, {}, 2};
    VoxelsDrawn drawn;
    GBuffer gbuffer = empty_gbuffer();
    glEnable(GL_NONE);
    try {
        gpu_->draw(model, 1, view, kAmple, gbuffer, drawn);
        ADD_FAILURE() << "it was drawn";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::device);
    }
    EXPECT_EQ(gbuffer.depths, empty_gbuffer().depths);
    expect_alike(model, camera, 1.0, {}, "after the failure");
    EXPECT_GT(covered_, 1000.0);
}

}  // namespace
}  // namespace strata
