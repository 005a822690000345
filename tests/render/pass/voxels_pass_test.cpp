#include "render/pass/voxels_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/math/random.h"
#include "core/voxel/voxel_tree_builder.h"
#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_coverage.h"
#include "render/pass/voxel_rays.h"
#include "render/reference/voxel_reference.h"
#include "tests/support/empty_gbuffer.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 96, kHeight = 80;

GBuffer empty_gbuffer(uint32_t first_row = 0, uint32_t rows = kHeight) { return test::empty_gbuffer(kWidth, first_row, rows); }

VoxelModel model_of(const VoxelTree& tree, VoxelShading shading = VoxelShading::flat, std::string_view color = "plain") {
    return VoxelModel(tree, VoxelColors(tree, color, std::nullopt, {}), shading);
}

VoxelView view_of(const Camera& camera, double error_px = 1e-9, std::span<const ClipBox> clips = {}) {
    return {camera, kWidth, kHeight, Vec2f::Zero(), error_px, clips, 2};
}

GBuffer drawn(const VoxelModel& model, const Camera& camera, double error_px = 1e-9, std::span<const ClipBox> clips = {}) {
    GBuffer gbuffer = empty_gbuffer();
    draw_voxels(model, 1, view_of(camera, error_px, clips), gbuffer);
    return gbuffer;
}

// From far enough to see all of a cube of that side at the origin, or from inside.
Camera random_camera(Random& random, Projection projection, double side, bool inside) {
    Camera camera;
    camera.projection = projection;
    const Vec3d middle = Vec3d::Constant(0.5 * side);
    const Vec3d away(random.normal(), random.normal(), random.normal());
    const Vec3d place = inside ? Vec3d(random.uniform(0, side), random.uniform(0, side), random.uniform(0, side)) : Vec3d(middle + (1.2 + random.uniform()) * side * away.normalized());
    camera.eye = place;
    camera.view_from_world = look_along(inside ? away : Vec3d(middle - place), Vec3d(random.normal(), random.normal(), random.normal()));
    camera.fov_rad = 0.9;
    camera.height = 1.7 * side;
    camera.near_depth = 1e-3;
    camera.far_depth = 10 * side;
    return camera;
}

std::vector<Box3d> boxes_of(const VoxelCube& voxels) {
    std::vector<Box3d> boxes;
    for (uint32_t x = 0; x < voxels.side(); ++x)
        for (uint32_t y = 0; y < voxels.side(); ++y)
            for (uint32_t z = 0; z < voxels.side(); ++z)
                if (voxels.at(x, y, z)) boxes.push_back({.min = Vec3d(x, y, z), .max = Vec3d(x + 1, y + 1, z + 1)});
    return boxes;
}

int depth_of_slot(PixelId id) {
    const uint32_t slot = slot_of(id);
    return int(2 * (slot >> 10) + ((slot >> 9 & 1) ? 1 : 2));
}
CellFace face_of_slot(PixelId id) { return CellFace(slot_of(id) & 7); }

// One voxel of two units, eight pixels wide, seen from above: 64 pixels, all as deep as its upper face, darker at the border.
TEST(VoxelsPass, AVoxelInOrthographicProjectionCoversItsPixels) {
    VoxelCube voxels(1);
    voxels.set(2, 1, 3);
    VoxelTree tree = tree_of(voxels);
    tree.frame.origin = Vec3d(-4, -4, -4);
    tree.frame.voxel_size = 2.0;  // from (0, -2, 2) to (2, 0, 4)
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 20;  // 4 pixels a unit
    camera.eye = {0, 0, 10};
    camera.near_depth = 0;
    const GBuffer gbuffer = drawn(model_of(tree), camera);
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const size_t pixel = y * kWidth + x;
            const bool covered = x >= 48 && x < 56 && y >= 40 && y < 48;
            ASSERT_EQ(gbuffer.depths[pixel], covered ? 6.0f : kNoDepth) << x << ' ' << y;
            ASSERT_EQ(gbuffer.ids[pixel] != kNoPixelId, covered);
            ASSERT_EQ(gbuffer.splat_px[pixel], covered ? 1 : 0);
            if (!covered) continue;
            EXPECT_EQ(drawable_of(gbuffer.ids[pixel]), 1u);
            EXPECT_EQ(face_of_slot(gbuffer.ids[pixel]), CellFace::max_z);
            EXPECT_EQ(slot_of(gbuffer.ids[pixel]) >> 3 & 63, uint32_t(mask_bit(2, 1, 3)));
            const bool border = x == 48 || x == 55 || y == 40 || y == 47;
            const Rgba8 inner = gbuffer.colors[44 * kWidth + 52];
            EXPECT_EQ(red_of(gbuffer.colors[pixel]) < red_of(inner), border) << x << ' ' << y;
        }
}

// Every picture lies between that of voxels a little larger and that of ones a little smaller, whatever the view. Rays may
// take the neighbor of an edge that they pass within 2^-13.
TEST(VoxelsPass, AgreesWithBruteForce) {
    Random random(5);
    for (int round = 0; round < 6; ++round) {
        const VoxelCube voxels = random_boxes(2, 4, uint64_t(round));
        const VoxelTree tree = tree_of(voxels, round % 2 == 1);
        const std::vector<Box3d> boxes = boxes_of(voxels);
        for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
            const Camera camera = random_camera(random, projection, voxels.side(), round % 3 == 2);
            const GBuffer gbuffer = drawn(model_of(tree), camera);
            const VoxelRays rays(camera, tree.frame, kWidth, kHeight, Vec2f::Zero());
            size_t covered = 0;
            for (uint32_t y = 0; y < kHeight; ++y)
                for (uint32_t x = y % 3; x < kWidth; x += 3) {
                    const VoxelRay ray = rays.picture().ray(int(x), int(y));
                    const auto larger = first_in_boxes(boxes, ray, camera.near_depth, 0x1p-12), smaller = first_in_boxes(boxes, ray, camera.near_depth, -0x1p-12);
                    const float depth = gbuffer.depths[y * kWidth + x];
                    if (larger)
                        ASSERT_GE(depth, float(*larger)) << round << ' ' << x << ' ' << y;
                    else
                        ASSERT_EQ(depth, kNoDepth);
                    if (smaller) ASSERT_LE(depth, float(*smaller)) << round << ' ' << x << ' ' << y;
                    covered += smaller.has_value();
                }
            EXPECT_GT(covered, 100u);
        }
    }
}

// The ray of a pixel goes through the point that the camera shows there, and t along it is the eye depth.
TEST(VoxelRays, AreThoseOfTheCamera) {
    Random random(8);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (int round = 0; round < 20; ++round) {
            Camera camera = random_camera(random, projection, 64, false);
            VoxelFrame frame;
            frame.levels = 3;
            frame.voxel_size = 0.37;
            frame.origin = Vec3d(5, -7, 3);
            const Vec2f offset(0.25f, -0.375f);
            const VoxelRays rays(camera, frame, kWidth, kHeight, offset);
            const int x = int(random.uniform(0, kWidth)), y = int(random.uniform(0, kHeight));
            const VoxelRay ray = rays.tile(uint32_t(x), uint32_t(y), 1, 1).ray(0, 0);
            const double depth = random.uniform(1, 100);
            const Vec3d p = frame.world_from_voxel(ray.origin + depth * ray.direction);
            const Vec3d q = camera.view_from_world * (p - camera.eye);
            EXPECT_NEAR(-q.z(), depth, 1e-8);
            const double unit = pixels_per_unit(camera, depth, kHeight);
            EXPECT_NEAR(0.5 * kWidth + q.x() * unit, x + 0.5 + offset.x(), 1e-7);
            EXPECT_NEAR(0.5 * kHeight - q.y() * unit, y + 0.5 + offset.y(), 1e-7);
            EXPECT_NEAR(rays.pixel_size(depth), 1.0 / unit / frame.voxel_size, 1e-9);
            // Exact sums: the same ray from any tile.
            const VoxelRay other = rays.tile(uint32_t(x / 2), uint32_t(y / 3), kWidth, kHeight).ray(x - x / 2, y - y / 3);
            EXPECT_EQ(ray.origin, other.origin);
            EXPECT_EQ(ray.direction, other.direction);
        }
}

// Rays of a picture are cast in groups, which must not show: where cells of many pixels may stop them, the way to a cell of
// one ray's neighbor can begin below a cell that stops this one.
TEST(VoxelsPass, CoarseCellsAreThoseOfEachRayByItself) {
    Random random(9);
    const VoxelTree tree = tree_of(random_boxes(3, 40, 5));
    size_t covered = 0;
    for (int round = 0; round < 30; ++round) {
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::orthographic : Projection::perspective, 64, false);
        const VoxelRays rays(camera, tree.frame, kWidth, kHeight, Vec2f::Zero());
        const double error_px = std::exp2(1 + round % 5);
        const RayLimits limits = {.least_t = rays.near_depth(), .spread = error_px * rays.spread(), .footprint = error_px * rays.footprint()};
        std::vector<VoxelHit> hits(size_t{kWidth} * kHeight);
        cast_tile(tree, rays.picture(), limits, hits);
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const VoxelHit alone = cast_ray(tree, rays.picture().ray(int(x), int(y)), limits).value_or(VoxelHit{});
                ASSERT_EQ(hits[y * kWidth + x], alone) << round << ' ' << x << ' ' << y;
                covered += alone.depth > 0;
            }
    }
    EXPECT_GT(covered, 30'000u);
}

// Cells stop at the first size that looks no larger than error_px, and only voxels may look larger.
TEST(VoxelsPass, CellsAreAsLargeAsTheErrorAllows) {
    Random random(3);
    const VoxelCube voxels = random_boxes(3, 40, 1);
    const VoxelTree tree = tree_of(voxels);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const double error_px : {0.5, 3.0, 9.0}) {
            const Camera camera = random_camera(random, projection, voxels.side(), false);
            GBuffer gbuffer = empty_gbuffer();
            const VoxelsDrawn drawn = draw_voxels(model_of(tree), 1, view_of(camera, error_px), gbuffer);
            const VoxelRays rays(camera, tree.frame, kWidth, kHeight, Vec2f::Zero());
            double largest = 0.0;
            std::set<int> depths;
            for (size_t pixel = 0; pixel < gbuffer.ids.size(); ++pixel) {
                if (gbuffer.ids[pixel] == kNoPixelId) continue;
                const int depth = depth_of_slot(gbuffer.ids[pixel]);
                depths.insert(depth);
                const double cell_px = double(1u << (tree.frame.depth() - depth)) / rays.pixel_size(gbuffer.depths[pixel]);
                if (depth < tree.frame.depth()) {
                    EXPECT_LE(cell_px, error_px * (1 + 1e-6));
                    largest = std::max(largest, cell_px);
                }
                if (depth > 1) EXPECT_GT(2 * cell_px, 0.5 * error_px);
            }
            EXPECT_NEAR(drawn.error_px, largest, 1e-5 * error_px);
            EXPECT_EQ(drawn.finest_depth, *depths.rbegin());
            EXPECT_FALSE(drawn.short_of_memory);
        }
}

// A tree that holds fewer levels than its frame says so where its cells are larger than wanted.
TEST(VoxelsPass, MissingLevelsAreReported) {
    const VoxelCube voxels = random_boxes(3, 40, 1);
    VoxelTree tree = tree_of(voxels);
    tree.levels.pop_back();
    tree.levels.back().first_child.clear();
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 80;  // a pixel a voxel
    camera.eye = Vec3d(32, 32, 100);
    GBuffer gbuffer = empty_gbuffer();
    const VoxelsDrawn coarse = draw_voxels(model_of(tree), 1, view_of(camera, 1.0), gbuffer);
    EXPECT_EQ(coarse.finest_depth, 4);
    EXPECT_EQ(coarse.error_px, 4.0);
    EXPECT_TRUE(coarse.short_of_memory);
    EXPECT_FALSE(draw_voxels(model_of(tree), 1, view_of(camera, 4.0), gbuffer).short_of_memory);
}

// World and camera moved by 2^20 units give the same bits.
TEST(VoxelsPass, PlaceInTheWorldDoesNotShow) {
    Random random(2);
    VoxelTree tree = tree_of(random_boxes(3, 40, 9));
    tree.frame.voxel_size = 0.125;
    tree.frame.origin = Vec3d(0.5, -3.25, 7);
    for (const VoxelShading shading : {VoxelShading::flat, VoxelShading::smooth})
        for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
            Camera camera = random_camera(random, projection, 8.0, false);
            for (int axis = 0; axis < 3; ++axis) camera.eye[axis] = std::round(camera.eye[axis] * 1024) / 1024;
            const GBuffer here = drawn(model_of(tree, shading), camera, 1.0);
            VoxelTree moved = tree;
            const Vec3d far(0x1p20, -0x1p20, 0x1p20);
            moved.frame.origin += far;
            camera.eye += far;
            const GBuffer there = drawn(model_of(moved, shading), camera, 1.0);
            EXPECT_EQ(here.colors, there.colors);
            EXPECT_EQ(here.depths, there.depths);
            EXPECT_EQ(here.ids, there.ids);
            EXPECT_GT(std::count_if(here.ids.begin(), here.ids.end(), [](PixelId id) { return id != kNoPixelId; }), 200);
        }
}

// What is there and nearer stays; what is equally near stays, too.
TEST(VoxelsPass, NearerPixelsStay) {
    VoxelCube voxels(1);
    voxels.set(0, 0, 0);
    const VoxelTree tree = tree_of(voxels);
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 1;
    camera.eye = Vec3d(0.5, 0.5, 3);  // the upper face is 2 deep
    GBuffer gbuffer = empty_gbuffer();
    const size_t middle = kHeight / 2 * kWidth + kWidth / 2;
    const std::vector<float> before = {1.5f, 2.0f, std::nextafter(2.0f, 3.0f), kNoDepth};
    for (size_t i = 0; i < before.size(); ++i) {
        gbuffer.depths[middle + i] = before[i];
        gbuffer.ids[middle + i] = 77;
    }
    draw_voxels(model_of(tree), 3, view_of(camera), gbuffer);
    const std::vector<float> after(gbuffer.depths.begin() + ptrdiff_t(middle), gbuffer.depths.begin() + ptrdiff_t(middle) + 4);
    EXPECT_EQ(after, (std::vector<float>{1.5f, 2.0f, 2.0f, 2.0f}));
    EXPECT_EQ(gbuffer.ids[middle], 77u);
    EXPECT_EQ(gbuffer.ids[middle + 1], 77u);
    EXPECT_EQ(drawable_of(gbuffer.ids[middle + 2]), 3u);
}

// The nearer of what a box keeps and what it leaves is the whole picture, where the cut is not nearer still.
TEST(VoxelsPass, BoxesPartThePicture) {
    Random random(4);
    const VoxelCube voxels = random_boxes(2, 8, 3);
    const VoxelTree tree = tree_of(voxels);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (int round = 0; round < 6; ++round) {
            const Camera camera = random_camera(random, projection, voxels.side(), round == 5);
            // Faces on those of voxels in half of the rounds.
            const auto face = [&] { return round % 2 == 0 ? std::floor(random.uniform(0, 16)) : random.uniform(0, 16); };
            Box3d box;
            for (int corner = 0; corner < 2; ++corner) box.extend(Vec3d(face(), face(), face()));
            const ClipBox keep[] = {{.box = box}}, remove[] = {{.box = box, .action = ClipBox::Action::remove}};
            const GBuffer whole = drawn(model_of(tree), camera), kept = drawn(model_of(tree), camera, 1e-9, keep), left = drawn(model_of(tree), camera, 1e-9, remove);
            for (size_t pixel = 0; pixel < whole.depths.size(); ++pixel) {
                const float nearest = std::min(kept.depths[pixel], left.depths[pixel]);
                if (whole.depths[pixel] == kNoDepth)
                    ASSERT_EQ(nearest, kNoDepth);
                else
                    ASSERT_NEAR(nearest, whole.depths[pixel], 1e-4) << pixel;
            }
        }
}

// A solid block cut aslant to its voxels and on their faces: the cut is a plane at the box's depth, and shows the box's face.
TEST(VoxelsPass, CutsAreFaces) {
    const VoxelTree tree = tree_of(cube_where(2, [](uint32_t, uint32_t, uint32_t) { return true; }), true);
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 20;
    camera.eye = Vec3d(8, 8, 30);
    for (const double top : {10.0, 9.6}) {
        Box3d box = {.min = Vec3d(2, 2, -1), .max = Vec3d(14, 14, top)};
        const ClipBox clips[] = {{.box = box}};
        const GBuffer gbuffer = drawn(model_of(tree), camera, 1e-9, clips);
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const size_t pixel = y * kWidth + x;
                const bool covered = x >= 24 && x < 72 && y >= 16 && y < 64;  // 4 pixels a voxel
                ASSERT_EQ(gbuffer.ids[pixel] != kNoPixelId, covered) << x << ' ' << y;
                if (!covered) continue;
                ASSERT_NEAR(gbuffer.depths[pixel], 30.0 - top, 1e-5);
                ASSERT_EQ(face_of_slot(gbuffer.ids[pixel]), CellFace::max_z);
            }
    }
    // Two boxes that keep, one that removes between: three spans of a ray down.
    const ClipBox clips[] = {{.box = {.min = Vec3d(0, 0, 0), .max = Vec3d(16, 16, 4)}},
                             {.box = {.min = Vec3d(0, 0, 8), .max = Vec3d(16, 16, 16)}},
                             {.box = {.min = Vec3d(0, 0, 10), .max = Vec3d(16, 16, 12)}, .action = ClipBox::Action::remove}};
    std::vector<RaySpan> spans;
    VoxelClip(clips, tree.frame).spans({Vec3d(8, 8, 30), Vec3d(0, 0, -1)}, 0.0, 1e9, spans);
    ASSERT_EQ(spans.size(), 3u);
    const double expected[3][2] = {{14, 18}, {20, 22}, {26, 30}};
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(spans[i].from, expected[i][0], 1e-9);
        EXPECT_NEAR(spans[i].to, expected[i][1], 1e-9);
        EXPECT_EQ(spans[i].face, CellFace::max_z);
    }
}

// Blocks of any depth, by brute force.
TEST(CellBlocks, HoldTheCellsOfADepth) {
    for (const bool with_full : {false, true}) {
        const VoxelCube voxels = random_boxes(2, 5, 12);
        const VoxelTree tree = tree_of(voxels, with_full);
        CellBlocks blocks(tree);
        for (int depth = 1; depth <= 4; ++depth) {
            const int shift = 4 - depth;
            const VoxelCube cells = coarsened(voxels, shift);
            const int64_t side = int64_t{1} << depth;
            for (int64_t x = -4; x < side + 4; ++x)
                for (int64_t y = -4; y < side + 4; ++y)
                    for (int64_t z = -4; z < side + 4; ++z) {
                        const bool inside = std::min({x, y, z}) >= 0 && std::max({x, y, z}) < side;
                        const bool occupied = inside && cells.at(uint32_t(x << shift), uint32_t(y << shift), uint32_t(z << shift));
                        const uint64_t mask = blocks.mask(depth, {x >> 2, y >> 2, z >> 2});
                        ASSERT_EQ(mask >> mask_bit(uint32_t(x & 3), uint32_t(y & 3), uint32_t(z & 3)) & 1, uint64_t(occupied)) << depth << ' ' << x << ' ' << y << ' ' << z;
                    }
        }
    }
}

// Above level ground the middle of what is around lies straight below; a cell before a sphere's shell it lies towards the center, 3
// degrees off in the mean, though the faces of its cells are up to 55 degrees off.
TEST(RiseOverCells, FollowsTheSurface) {
    const VoxelTree ground = tree_of(cube_where(2, [](uint32_t, uint32_t, uint32_t z) { return z < 6; }));
    CellBlocks blocks(ground);
    const Vec3f up = rise_over_cells(blocks, 4, Vec3d(8.0, 8.0, 6.0), 4.0);
    EXPECT_EQ(up.x(), 0.0f);
    EXPECT_EQ(up.y(), 0.0f);
    EXPECT_GT(up.z(), 0.5f);
    EXPECT_TRUE(rise_over_cells(blocks, 4, Vec3d(8.0, 8.0, 12.0), 4.0).isZero());

    const Vec3d center(32, 32, 32);
    const auto distance = [&](uint32_t x, uint32_t y, uint32_t z) { return (Vec3d(x + 0.5, y + 0.5, z + 0.5) - center).norm(); };
    const VoxelTree shell = tree_of(cube_where(3, [&](uint32_t x, uint32_t y, uint32_t z) { return std::abs(distance(x, y, z) - 25.0) <= 0.8; }));
    Random random(6);
    double sum = 0.0;
    CellBlocks cells(shell);
    for (int i = 0; i < 500; ++i) {
        const Vec3d out = Vec3d(random.normal(), random.normal(), random.normal()).normalized();
        const double cosine = rise_over_cells(cells, 6, center + 26.8 * out, 4.0).cast<double>().normalized().dot(out);
        EXPECT_GT(cosine, std::cos(15.0 * 3.14159265 / 180.0));
        sum += std::acos(std::min(cosine, 1.0));
    }
    EXPECT_LT(sum / 500 * 180.0 / 3.14159265, 3.0);
}

// The sum over all cells of the depth, one by one.
TEST(RiseOverCells, IsTheSumOverAllCells) {
    const VoxelCube voxels = random_cube(2, 0.2, 3);
    const VoxelTree tree = tree_of(voxels);
    CellBlocks blocks(tree);
    Random random(9);
    for (int i = 0; i < 300; ++i) {
        const Vec3d p(random.uniform(-4, 20), random.uniform(-4, 20), random.uniform(-4, 20));
        const double radius = i % 2 == 0 ? 2.5 : 4.0;
        double sum = 0.0;
        Vec3d moment = Vec3d::Zero();
        for (const Box3d& box : boxes_of(voxels)) {
            const Vec3d d = p - box.center();
            const double weight = std::max(0.0, 1.0 - d.squaredNorm() / (radius * radius));
            sum += weight;
            moment += weight * d;
        }
        const Vec3f rise = rise_over_cells(blocks, 4, p, radius);
        if (sum > 1e-3) EXPECT_LT((rise.cast<double>() - moment / sum).norm(), 1e-4 / std::min(sum, 1.0));
        if (sum == 0.0) EXPECT_TRUE(rise.isZero());
    }
}

// Smooth voxels of a slope lie on a plane within a cell of theirs, where the cubes' depths jump.
TEST(VoxelsPass, SmoothDepthsAreThoseOfTheSurface) {
    const VoxelTree tree = tree_of(cube_where(3, [](uint32_t x, uint32_t, uint32_t z) { return std::abs(z + 0.5 - (10 + 0.3 * (x + 0.5))) < 0.6; }));
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 32;
    camera.eye = Vec3d(32, 32, 100);
    const GBuffer flat = drawn(model_of(tree), camera), smooth = drawn(model_of(tree, VoxelShading::smooth), camera);
    double flat_off = 0.0, smooth_off = 0.0;
    for (uint32_t y = 8; y < kHeight - 8; ++y)
        for (uint32_t x = 8; x < kWidth - 8; ++x) {
            const double place = 32 + (x + 0.5 - 0.5 * kWidth) * 0.4;
            const double truth = 100 - (10 + 0.3 * place) - 0.5;  // half a voxel over the middle of its cells
            flat_off = std::max(flat_off, std::abs(flat.depths[y * kWidth + x] - truth));
            smooth_off = std::max(smooth_off, std::abs(smooth.depths[y * kWidth + x] - truth));
        }
    EXPECT_GT(flat_off, 0.6);
    EXPECT_LT(smooth_off, 0.6 * flat_off);
    EXPECT_EQ(flat.ids, smooth.ids);
}

// Blocks of one voxel each, in Morton order, with what is known of them.
VoxelTree painted_tree() {
    VoxelFrame frame;
    frame.levels = 2;
    const VoxelAttributes attributes = {.count = true, .color = true, .normal = true};
    VoxelTreeInMemory memory(frame, attributes);
    VoxelTreeBuilder builder(frame, attributes, memory);
    VoxelBatch batch;
    batch.blocks = {{.code = 0, .mask = 1}, {.code = 63, .mask = uint64_t{1} << 63}};
    batch.counts = {4, 64};
    batch.colors = {{250, 10, 20}, {30, 240, 50}};
    batch.normals = {{0, 0, 127}, {127, 0, 0}};
    builder.add(batch);
    builder.finish();
    return memory.take();
}

TEST(VoxelColors, ShowWhatTheCellsHave) {
    const VoxelTree tree = painted_tree();
    const auto hit_from = [&](const Vec3d& origin, int depth) { return *cast_ray(tree, {origin, Vec3d(0, 0, -1)}, {.depth = depth}); };
    const VoxelHit low = hit_from({0.5, 0.5, 20}, 4), high = hit_from({15.5, 15.5, 20}, 4), whole = hit_from({15.5, 15.5, 20}, 1);
    const Vec3f up(0, 0, 1);
    const VoxelColors colors(tree, "", std::nullopt, {});
    EXPECT_EQ(colors.name(), "rgb");
    EXPECT_EQ(colors.color(tree, low, up), make_rgba(250, 10, 20));
    EXPECT_EQ(colors.color(tree, high, up), make_rgba(30, 240, 50));
    EXPECT_EQ(colors.color(tree, whole, up), make_rgba(30, 240, 50));
    EXPECT_EQ(stored_normal(tree, low), Vec3f(0, 0, 127));
    EXPECT_EQ(stored_normal(tree, whole), Vec3f(127, 0, 0));

    // Ends of a color map's range show its ends; a count of a coarser cell counts as if spread over a surface.
    const VoxelColors elevation(tree, "elevation", ColorRange{0.5, 15.5}, "gray"), count(tree, "count", ColorRange{4, 64}, "gray");
    const VoxelColors plain(tree, "plain", std::nullopt, {});
    const auto gray = [&](const VoxelColors& by, const VoxelHit& hit) { return int(red_of(by.color(tree, hit, up))); };
    EXPECT_LT(gray(elevation, low), gray(elevation, whole));
    EXPECT_LT(gray(elevation, whole), gray(elevation, high));
    EXPECT_LT(gray(count, low), gray(count, high));
    EXPECT_LT(gray(count, whole), gray(count, high));  // 64 of 8 x 8 faces: 1 each, below the range
    EXPECT_EQ(gray(count, whole), gray(count, low));
    EXPECT_EQ(plain.color(tree, low, up), plain.color(tree, high, up));
    EXPECT_NE(VoxelColors(tree, "lod", std::nullopt, {}).color(tree, low, up), VoxelColors(tree, "lod", std::nullopt, {}).color(tree, whole, up));
    EXPECT_EQ(VoxelColors(tree, "normal", std::nullopt, {}).color(tree, low, up), make_rgba(128, 128, 255));

    const VoxelTree bare = tree_of(random_boxes(2, 3, 1));
    for (const char* name : {"rgb", "count", "intensity"}) EXPECT_THROW(VoxelColors(bare, name, std::nullopt, {}), Error) << name;
    EXPECT_EQ(VoxelColors(bare, "", std::nullopt, {}).name(), "plain");
}

// Faces to the six sides have six lights, and the normal's color has none.
TEST(VoxelsPass, SidesOfACubeDiffer) {
    VoxelCube voxels(1);
    voxels.set(1, 1, 1);
    const VoxelTree tree = tree_of(voxels);
    std::set<Rgba8> lights;
    const Vec3d middle(1.5, 1.5, 1.5);
    for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {-1.0, 1.0}) {
            Camera camera;
            camera.projection = Projection::orthographic;
            camera.height = 0.5;
            camera.eye = middle + 5 * sign * Vec3d::Unit(axis);
            camera.view_from_world = look_along(middle - camera.eye, axis == 2 ? Vec3d::UnitY() : Vec3d::UnitZ());
            lights.insert(drawn(model_of(tree), camera).colors[kHeight / 2 * kWidth + kWidth / 2]);
            const Rgba8 normal = drawn(model_of(tree, VoxelShading::flat, "normal"), camera).colors[kHeight / 2 * kWidth + kWidth / 2];
            const int codes[3] = {red_of(normal), green_of(normal), blue_of(normal)};
            for (int other = 0; other < 3; ++other) EXPECT_EQ(codes[other], other != axis ? 128 : sign > 0 ? 255 : 0);
        }
    EXPECT_EQ(lights.size(), 6u);
}

}  // namespace
}  // namespace strata
