// Whether pixels stay open between the rectangles of a surface, by a rasterizer that does as GPUs do: positions and matrices in floats,
// corners snapped to 1/256 pixel, and a pixel filled where its center is inside or, on an edge, where that is a top or left one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/math/camera.h"
#include "core/math/random.h"
#include "core/surface/cube_surface.h"
#include "tests/support/surface_in_memory.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

constexpr int kPixels = 96, kSubpixels = 256;
constexpr double kFov = 30.0 * M_PI / 180.0;

struct Snapped {
    int64_t x, y;
};

std::vector<Snapped> project(const TriangleMesh& mesh, const Camera& camera) {
    const Eigen::Matrix3f view = camera.view_from_world.cast<float>();
    const auto scale = float(0.5 * kPixels / std::tan(0.5 * camera.fov_rad));
    std::vector<Snapped> out;
    for (const Vec3d& p : mesh.positions) {
        const Vec3f at = view * (p - camera.eye).cast<float>();
        EXPECT_LT(at.z(), 0.0f);  // all is in front of the eye: nothing to clip
        const float x = 0.5f * kPixels + scale * at.x() / -at.z(), y = 0.5f * kPixels - scale * at.y() / -at.z();
        out.push_back({std::llround(x * kSubpixels), std::llround(y * kSubpixels)});
    }
    return out;
}

void fill(const Snapped& a, const Snapped& b, const Snapped& c, std::vector<char>& covered) {
    // y grows downwards, so that what is counterclockwise in the world is clockwise here.
    const int64_t area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area >= 0) return;
    const auto least = [](int64_t v) { return std::max<int64_t>(0, v / kSubpixels - 1); };
    const auto most = [](int64_t v) { return std::min<int64_t>(kPixels - 1, v / kSubpixels + 1); };
    for (int64_t y = least(std::min({a.y, b.y, c.y})); y <= most(std::max({a.y, b.y, c.y})); ++y)
        for (int64_t x = least(std::min({a.x, b.x, c.x})); x <= most(std::max({a.x, b.x, c.x})); ++x) {
            const int64_t px = x * kSubpixels + kSubpixels / 2, py = y * kSubpixels + kSubpixels / 2;
            const auto inside = [&](const Snapped& from, const Snapped& to) {
                const int64_t side = (to.y - from.y) * (px - from.x) - (to.x - from.x) * (py - from.y);
                const bool top_left = to.y > from.y || (to.y == from.y && to.x < from.x);
                return side > 0 || (side == 0 && top_left);
            };
            if (inside(a, b) && inside(b, c) && inside(c, a)) covered[size_t(y * kPixels + x)] = 1;
        }
}

// Pixels that no face covers, of pictures taken from above rough ground that reaches beyond their sides.
size_t count_pinholes(const TriangleMesh& mesh, int cameras) {
    size_t pinholes = 0;
    for (int i = 0; i < cameras; ++i) {
        Random random(uint64_t(i) + 1);
        const auto draw = [&](double low, double high) { return low + (high - low) * random.uniform(); };
        const double turn = draw(0.0, 2.0 * M_PI), lean = draw(0.0, 15.0 * M_PI / 180.0), around = draw(0.0, 2.0 * M_PI);
        Camera camera{.eye = Vec3d(draw(90, 100), draw(90, 100), draw(60, 90)), .fov_rad = kFov};
        camera.view_from_world = look_along(Vec3d(std::sin(lean) * std::cos(turn), std::sin(lean) * std::sin(turn), -std::cos(lean)),
                                            Vec3d(std::cos(around), std::sin(around), 0.0));
        const std::vector<Snapped> corners = project(mesh, camera);
        std::vector<char> covered(size_t(kPixels) * kPixels);
        for (const auto& t : mesh.triangles) fill(corners[t[0]], corners[t[1]], corners[t[2]], covered);
        pinholes += size_t(std::count(covered.begin(), covered.end(), 0));
    }
    return pinholes;
}

TEST(CubePinholes, ClosedFacesLeaveNone) {
    // Steps of several widths, so that rectangles of all sizes meet, over nine bricks.
    VoxelCube voxels(4);
    Random random(7);
    std::vector<uint32_t> heights(256 * 256);
    for (const uint32_t width : {32u, 8u, 2u})
        for (uint32_t x = 0; x < 256; x += width)
            for (uint32_t y = 0; y < 256; y += width) {
                const auto more = uint32_t(random.uniform() * 3.0);
                for (uint32_t i = 0; i < width * width; ++i) heights[(x + i % width) * 256 + y + i / width] += more;
            }
    for (uint32_t x = 30; x < 160; ++x)
        for (uint32_t y = 30; y < 160; ++y)
            for (uint32_t z = 0; z <= heights[x * 256 + y]; ++z) voxels.set(x, y, z);
    const VoxelTree tree = tree_of(voxels);
    SurfaceInMemory closed, separate;
    mesh_cubes(tree, {}, closed);
    mesh_cubes(tree, {.joints = CubeSurfaceSettings::Joints::separate}, separate);
    EXPECT_EQ(count_pinholes(closed.mesh(), 1000), 0u);
    // What the test would see: the same rectangles as they are.
    EXPECT_GT(count_pinholes(separate.mesh(), 100), 20u);
}

}  // namespace
}  // namespace strata
