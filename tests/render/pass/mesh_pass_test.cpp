#include "render/pass/mesh_pass.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/math/random.h"
#include "render/colormap.h"
#include "render/pass/mesh_clip.h"
#include "render/pass/mesh_cut.h"
#include "render/pass/mesh_kernel.h"
#include "render/pass/mesh_shade.h"
#include "render/pass/points_pass.h"
#include "render/reference/mesh_reference.h"
#include "render/sky_light.h"
#include "render/srgb.h"
#include "tests/support/empty_gbuffer.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 96, kHeight = 80;

GBuffer empty_gbuffer(uint32_t first_row = 0, uint32_t rows = kHeight) { return test::empty_gbuffer(kWidth, first_row, rows); }

MeshModel model_of(const TriangleMesh& mesh, const MeshStyle& style = {}, std::string_view color = "plain") {
    return MeshModel(mesh, MeshColors(mesh, color, std::nullopt, {}), style);
}

MeshView view_of(const Camera& camera, std::span<const ClipBox> clips = {}, int threads = 2) { return {camera, kWidth, kHeight, Vec2f::Zero(), clips, threads}; }

GBuffer drawn(const TriangleMesh& mesh, const Camera& camera, const MeshStyle& style = {}, std::span<const ClipBox> clips = {}) {
    GBuffer gbuffer = empty_gbuffer();
    MeshPass().draw(model_of(mesh, style), 1, view_of(camera, clips), gbuffer);
    return gbuffer;
}

size_t covered(const GBuffer& gbuffer) { return size_t(std::count_if(gbuffer.depths.begin(), gbuffer.depths.end(), [](float depth) { return depth != kNoDepth; })); }

Camera camera_at(Projection projection, const Vec3d& eye, const Vec3d& forward, const Vec3d& up) {
    Camera camera;
    camera.projection = projection;
    camera.eye = eye;
    camera.view_from_world = look_along(forward, up);
    camera.fov_rad = 0.9;
    camera.height = 4.0;
    camera.near_depth = projection == Projection::perspective ? 0.01 : 0.0;
    camera.far_depth = 100;
    return camera;
}

Vec3d random_vector(Random& random) { return {random.normal(), random.normal(), random.normal()}; }

// Looks at the origin from around it.
Camera random_camera(Random& random, Projection projection, double distance) {
    const Vec3d away = random_vector(random).normalized();
    return camera_at(projection, distance * away, -away, random_vector(random));
}

// Whether a pixel's center is in a triangle when it is moved right by an infinitesimal, and down by a far smaller one: by the signs of exact determinants.
bool holds_moved_center(const RasterTriangle& t, int64_t column, int64_t row) {
    const int64_t x = column * kSubpixels + kSubpixels / 2, y = row * kSubpixels + kSubpixels / 2;
    const auto sign = [](int64_t value) { return value > 0 ? 1 : value < 0 ? -1 : 0; };  // coordinates have 30 bits at most
    const auto side = [&](size_t a, size_t b) {
        const int64_t dx = int64_t{t.x[b]} - t.x[a], dy = int64_t{t.y[b]} - t.y[a];
        if (const int on = sign(dx * (y - t.y[a]) - dy * (x - t.x[a])); on != 0) return on;
        return dy != 0 ? sign(-dy) : sign(dx);
    };
    const int first = side(0, 1);
    return first != 0 && side(1, 2) == first && side(2, 0) == first;
}

// Draws one triangle as the pass does: small ones by blocks, others by spans.
std::vector<uint64_t> words_of(const RasterTriangle& t, SimdLevel level, bool as_small, uint32_t first_row = 0, uint32_t rows = kHeight) {
    const MeshKernels& kernels = mesh_kernels(level);
    std::vector<uint64_t> words(size_t{kWidth} * rows, 0);
    const MeshTarget target = {words.data(), kWidth, first_row, rows};
    if (!as_small) {
        kernels.draw(t, target);
        return words;
    }
    const std::array<ProjectedVertex, 3> vertices = {{{t.x[0], t.y[0], t.key[0]}, {t.x[1], t.y[1], t.key[1]}, {t.x[2], t.y[2], t.key[2]}}};
    const std::array<uint32_t, 3> corners = {0, 1, 2};
    TriangleBlock block;
    block.first = 0;
    block.count = 1;
    kernels.sort({&corners, vertices.data()}, target, block);
    kernels.draw_small(target, block, Sharing::shared);
    return words;
}

// Corners on a grid that pixels' centers lie on, so that many edges go through them, or anywhere; of all sizes.
RasterTriangle random_triangle(Random& random, int64_t size, bool on_centers) {
    RasterTriangle t;
    const int64_t grid = on_centers ? kSubpixels / 2 : 1;
    const int64_t x = int64_t(random.bits() % (kWidth * kSubpixels)), y = int64_t(random.bits() % (kHeight * kSubpixels));
    for (size_t i = 0; i < 3; ++i) {
        t.x[i] = int32_t((x + int64_t(random.bits() % uint64_t(size)) - size / 2) / grid * grid);
        t.y[i] = int32_t((y + int64_t(random.bits() % uint64_t(size)) - size / 2) / grid * grid);
        t.key[i] = float(random.uniform(0.1, 1.0));
    }
    t.number = uint32_t(random.bits() % 1000);
    return t;
}

TEST(MeshKernel, CoversTheCentersThatExactArithmeticSays) {
    Random random(1);
    size_t pixels = 0, small = 0;
    for (int round = 0; round < 3000; ++round) {
        constexpr int64_t kSizes[] = {300, 1000, 1800, 6000, 40000, int64_t{1} << 28};
        const bool on_centers = round % 2 == 0;
        const RasterTriangle t = random_triangle(random, kSizes[round % 6], on_centers);
        const std::vector<uint64_t> spans = words_of(t, SimdLevel::baseline, false), blocks = words_of(t, SimdLevel::baseline, true);
        const bool is_small = std::any_of(blocks.begin(), blocks.end(), [](uint64_t word) { return word != 0; });
        small += is_small;
        const auto [least, most] = std::minmax({t.key[0], t.key[1], t.key[2]});
        for (uint32_t row = 0; row < kHeight; ++row)
            for (uint32_t column = 0; column < kWidth; ++column) {
                const size_t pixel = row * kWidth + column;
                const bool inside = holds_moved_center(t, column, row);
                ASSERT_EQ(spans[pixel] != 0, inside) << round << ' ' << column << ' ' << row;
                if (is_small) ASSERT_EQ(blocks[pixel] != 0, inside) << round << ' ' << column << ' ' << row;
                if (!inside) continue;
                ++pixels;
                for (const std::vector<uint64_t>* words : {&spans, &blocks}) {
                    if ((*words)[pixel] == 0) continue;
                    ASSERT_EQ(~uint32_t((*words)[pixel]), t.number * (words == &spans));
                    ASSERT_GE(key_of_word((*words)[pixel]), least * (1 - 1e-7f));
                    ASSERT_LE(key_of_word((*words)[pixel]), most * (1 + 1e-7f));
                }
                if (is_small) ASSERT_NEAR(key_of_word(spans[pixel]), key_of_word(blocks[pixel]), 2e-7f);
            }
        // Other instruction sets, other rows and other sides of it leave the same.
        for (const SimdLevel level : simd_levels()) {
            ASSERT_EQ(words_of(t, level, false), spans) << name_of(level);
            ASSERT_EQ(words_of(t, level, true), blocks) << name_of(level);
        }
        const std::vector<uint64_t> part = words_of(t, SimdLevel::baseline, false, 17, 30);
        ASSERT_TRUE(std::equal(part.begin(), part.end(), spans.begin() + 17 * kWidth));
        const std::vector<uint64_t> small_part = words_of(t, SimdLevel::baseline, true, 17, 30);
        ASSERT_TRUE(std::equal(small_part.begin(), small_part.end(), blocks.begin() + 17 * kWidth));
        std::vector<uint64_t> visited(spans.size(), 0);
        const MeshTarget target = {visited.data(), kWidth, 0, kHeight};
        visit_pixels(t, target, [&](int32_t column, int32_t row, float key) { visited[size_t(row) * kWidth + size_t(column)] = make_word(key, t.number); });
        ASSERT_EQ(visited, spans);
    }
    EXPECT_GT(pixels, 100000u);
    EXPECT_GT(small, 500u);
}

// The key is linear in the picture.
TEST(MeshKernel, KeysLieOnThePlaneOfTheCorners) {
    Random random(2);
    for (int round = 0; round < 300; ++round) {
        RasterTriangle t = random_triangle(random, round % 2 == 0 ? 1500 : 60000, false);
        const double a = 0.5, b = random.uniform(-1e-6, 1e-6), c = random.uniform(-1e-6, 1e-6);
        for (size_t i = 0; i < 3; ++i) t.key[i] = float(a + b * t.x[i] + c * t.y[i]);
        for (const bool as_small : {false, true}) {
            const std::vector<uint64_t> words = words_of(t, best_simd_level(), as_small);
            for (size_t pixel = 0; pixel < words.size(); ++pixel)
                if (words[pixel] != 0) {
                    const double x = double(pixel % kWidth) * kSubpixels + 128, y = double(pixel / kWidth) * kSubpixels + 128;
                    ASSERT_NEAR(key_of_word(words[pixel]), a + b * x + c * y, 1e-7);  // of rounded corners
                }
        }
    }
}

// A fan around a point: each pixel within its rim is covered by one triangle, and no other pixel by any, whichever way they turn.
TEST(MeshKernel, TrianglesOfAFanShareNoPixelAndLeaveNone) {
    Random random(3);
    for (int round = 0; round < 400; ++round) {
        const int sides = 3 + int(random.bits() % 30);
        const double radius = round % 4 == 0 ? 900 : round % 4 == 1 ? 2500 : 30000;
        const int64_t grid = round % 3 == 0 ? 128 : 1, x = 48 * kSubpixels + 128, y = 40 * kSubpixels + 128;
        std::vector<std::array<int32_t, 2>> rim;
        for (int i = 0; i < sides; ++i) {
            const double angle = 2 * M_PI * (i + random.uniform(0.0, 0.9)) / sides, r = radius * random.uniform(0.3, 1.0);
            const std::array<int32_t, 2> corner = {int32_t((x + int64_t(r * std::cos(angle))) / grid * grid), int32_t((y + int64_t(r * std::sin(angle))) / grid * grid)};
            if (rim.empty() || corner != rim.back()) rim.push_back(corner);
        }
        std::vector<int> hits(size_t{kWidth} * kHeight, 0), winding(hits.size(), 0);
        bool folded = false;  // around wide angles, and by rounding to a coarse grid
        for (size_t i = 0; i < rim.size(); ++i) {
            const auto &a = rim[i], &b = rim[(i + 1) % rim.size()];
            RasterTriangle t = {{int32_t(x), a[0], b[0]}, {int32_t(y), a[1], b[1]}, {0.5f, 0.5f, 0.5f}, 0};
            const int64_t area = (a[0] - x) * (b[1] - y) - (a[1] - y) * (b[0] - x);
            folded |= area < 0;
            if (i % 2 == 1) {
                std::swap(t.x[0], t.x[2]);
                std::swap(t.y[0], t.y[2]);
            }
            const std::vector<uint64_t> words = words_of(t, best_simd_level(), false);
            for (size_t pixel = 0; pixel < hits.size(); ++pixel) {
                hits[pixel] += words[pixel] != 0;
                winding[pixel] += words[pixel] == 0 ? 0 : area > 0 ? 1 : -1;
            }
        }
        // By an even-odd count of the rim's crossings to the right of the moved center.
        for (uint32_t row = 0; row < kHeight; ++row)
            for (uint32_t column = 0; column < kWidth; ++column) {
                const int64_t px = int64_t{column} * kSubpixels + 128, py = int64_t{row} * kSubpixels + 128;
                bool inside = false;
                for (size_t i = 0; i < rim.size(); ++i) {
                    const auto &a = rim[i], &b = rim[(i + 1) % rim.size()];
                    if ((a[1] > py) == (b[1] > py)) continue;
                    const int64_t cross = (int64_t{b[0]} - a[0]) * (py - a[1]) - (int64_t{b[1]} - a[1]) * (px - a[0]);
                    inside ^= b[1] > a[1] ? cross > 0 : cross < 0;
                }
                const size_t pixel = row * kWidth + column;
                ASSERT_EQ(winding[pixel] % 2 != 0, inside) << round << ' ' << column << ' ' << row;
                if (!folded) ASSERT_EQ(hits[pixel], inside ? 1 : 0) << round;
            }
    }
}

// A closed surface seen from a thousand places: from inside it hides all, and its fronts and backs cover each pixel as often, from outside too, also
// where it is cut by the near plane and reaches far beside the picture.
TEST(MeshPass, AClosedSurfaceHasNoHoles) {
    Random random(4);
    const TriangleMesh sphere = sphere_mesh(Vec3d::Zero(), 1.0, 9);
    for (int round = 0; round < 1000; ++round) {
        const bool inside = round % 2 == 0;
        const Projection projection = inside || round % 4 == 1 ? Projection::perspective : Projection::orthographic;
        Camera camera = inside ? camera_at(projection, 0.8 * random.uniform() * random_vector(random).normalized(), random_vector(random), random_vector(random))
                               : random_camera(random, projection, random.uniform(1.05, 3.0));
        camera.near_depth = inside ? 1e-6 : camera.near_depth;
        camera.fov_rad = random.uniform(0.3, 2.8);
        const GBuffer gbuffer = drawn(sphere, camera, {.shading = MeshShading::flat});
        if (inside) ASSERT_EQ(covered(gbuffer), size_t{kWidth} * kHeight) << round;

        std::vector<int> winding(size_t{kWidth} * kHeight, 0);
        const MeshProjection view(camera, kWidth, kHeight, Vec2f::Zero());
        std::vector<uint64_t> none(winding.size());
        const MeshTarget target = {none.data(), kWidth, 0, kHeight};
        for (uint32_t number = 0; number < sphere.triangles.size(); ++number) {
            std::array<Vec3d, 3> corners;
            std::array<ProjectedVertex, 3> v;
            for (size_t i = 0; i < 3; ++i) {
                corners[i] = sphere.positions[sphere.triangles[number][i]];
                v[i] = project_vertex(view, corners[i].x(), corners[i].y(), corners[i].z());
            }
            std::array<RasterTriangle, kMostPieces> pieces;
            size_t count = 1;
            if (v[0].x == kUnsnapped || v[1].x == kUnsnapped || v[2].x == kUnsnapped)
                count = cut_triangle(view, kWidth, kHeight, corners, v, number, pieces);
            else
                pieces[0] = {{v[0].x, v[1].x, v[2].x}, {v[0].y, v[1].y, v[2].y}, {v[0].key, v[1].key, v[2].key}, number};
            for (size_t i = 0; i < count; ++i) {
                const RasterTriangle& t = pieces[i];
                const int64_t area = (int64_t{t.x[1]} - t.x[0]) * (int64_t{t.y[2]} - t.y[0]) - (int64_t{t.y[1]} - t.y[0]) * (int64_t{t.x[2]} - t.x[0]);
                visit_pixels(t, target, [&](int32_t column, int32_t row, float) { winding[size_t(row) * kWidth + size_t(column)] += area > 0 ? 1 : -1; });
            }
        }
        for (const int turns : winding) ASSERT_EQ(turns, inside ? 1 : 0) << round;
    }
}

// The picture is that of rays asked of each triangle, but for pixels whose centers lie within a hundredth of a pixel of an edge.
TEST(MeshPass, AgreesWithBruteForce) {
    Random random(5);
    for (int round = 0; round < 12; ++round) {
        TriangleMesh mesh;
        const double size = round % 3 == 0 ? 0.1 : 0.6;
        for (int i = 0; i < 150; ++i) {
            const Vec3d middle(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
            for (int corner = 0; corner < 3; ++corner) mesh.positions.push_back(middle + size * random_vector(random));
            mesh.triangles.push_back({uint32_t(3 * i), uint32_t(3 * i + 1), uint32_t(3 * i + 2)});
        }
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, 6.0);
        const GBuffer gbuffer = drawn(mesh, camera);
        const MeshProjection view(camera, kWidth, kHeight, Vec2f::Zero());
        size_t judged = 0, covered_count = 0;
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const MeshTruth truth = first_in_mesh(mesh, view, x + 0.5, y + 0.5);
                if (truth.edge_px < 0.01) continue;
                ++judged;
                const float depth = gbuffer.depths[y * kWidth + x];
                ASSERT_EQ(depth != kNoDepth, truth.nearest.has_value()) << round << ' ' << x << ' ' << y;
                if (!truth.nearest) continue;
                ++covered_count;
                // Another triangle may show where they meet, as far as rounded corners shift it.
                if (primitive_of(gbuffer.ids[y * kWidth + x]) == truth.nearest->triangle)
                    ASSERT_NEAR(depth, truth.nearest->depth, 1e-6 * truth.nearest->depth);
                else
                    ASSERT_NEAR(depth, truth.nearest->depth, 0.02);
            }
        EXPECT_GT(judged, size_t{kWidth} * kHeight / 2);
        EXPECT_GT(covered_count, 150u);
    }
}

// Ground that reaches behind the eye and to the horizon is cut at the near plane; each pixel has the depth of its plane, to the last bit of a float or two.
TEST(MeshPass, DepthIsThatOfThePlaneUpToTheNearPlane) {
    Random random(6);
    size_t all_seen = 0;
    for (int round = 0; round < 60; ++round) {
        const Vec3d normal = random_vector(random).normalized(), along = normal.unitOrthogonal(), aside = normal.cross(along);
        const Vec3d origin(6.4e6, -1.2e5, 3.3e6);
        const double reach = round % 3 == 0 ? 1e6 : 30.0;
        TriangleMesh mesh;
        for (const auto& [u, v] : {std::pair(-1.0, -1.0), {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) mesh.positions.push_back(origin + reach * (u * along + v * aside));
        mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
        Camera camera = camera_at(round % 2 == 0 ? Projection::perspective : Projection::orthographic, origin + 0.5 * normal + 0.3 * along, random_vector(random), random_vector(random));
        camera.near_depth = 0.25;
        camera.far_depth = 1e7;
        const GBuffer gbuffer = drawn(mesh, camera);
        const MeshProjection view(camera, kWidth, kHeight, Vec2f::Zero());
        size_t seen = 0;
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const MeshProjection::Ray ray = view.ray(x + 0.5, y + 0.5);
                const double depth = normal.dot(origin - camera.eye - ray.origin) / normal.dot(ray.direction);
                const Vec3d p = camera.eye + ray.origin + depth * ray.direction - origin;
                const double u = std::abs(p.dot(along)) / reach, v = std::abs(p.dot(aside)) / reach;
                const float found = gbuffer.depths[y * kWidth + x];
                const double off_px = 0.02 * (depth * 0.02 + 0.05);  // more than rounded corners shift the rim and the near plane by, in world units
                if (depth < 0.25 - off_px || std::max(u, v) > 1.0 + off_px / reach || !std::isfinite(depth)) {
                    if (depth < 0.2 || std::max(u, v) > 1.01) ASSERT_EQ(found, kNoDepth) << round << ' ' << x << ' ' << y << ' ' << depth;
                    continue;
                }
                if (depth < 0.26 || std::max(u, v) > 0.99 || std::abs(normal.dot(ray.direction)) < 1e-2) continue;
                ++seen;
                ASSERT_NEAR(found, depth, 3e-7 * depth) << round << ' ' << x << ' ' << y;  // the world's numbers hold 1e-9 here
            }
        all_seen += seen;
    }
    EXPECT_GT(all_seen, 60000u);
}

// Points of a surface have the depth that the mesh has at their pixel, up to how far it falls over half a pixel each way.
TEST(MeshPass, DepthAgreesWithPointsOfTheSurface) {
    Random random(7);
    const Vec3d center(500000, 5300000, 100);
    const TriangleMesh mesh = sphere_mesh(center, 1.0, 40);
    const Quantization quantization = {.scale = Vec3d::Constant(1e-6), .offset = center};
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const Camera camera = camera_at(projection, center + Vec3d(2.5, -1.5, 1.0), Vec3d(-2.5, 1.5, -1.0), Vec3d::UnitZ());
        const GBuffer gbuffer = drawn(mesh, camera);
        const MeshProjection view(camera, kWidth, kHeight, Vec2f::Zero());
        size_t compared = 0;
        for (int i = 0; i < 4000; ++i) {
            const auto& [a, b, c] = mesh.triangles[random.bits() % mesh.triangles.size()];
            double u = random.uniform(), v = random.uniform();
            if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
            const Vec3d p = mesh.positions[a] + u * (mesh.positions[b] - mesh.positions[a]) + v * (mesh.positions[c] - mesh.positions[a]);
            ResidentNode node;
            const Vec3i quanta = ((p - center) / 1e-6).array().round().matrix().cast<int32_t>();
            node.x = {quanta.x()}, node.y = {quanta.y()}, node.z = {quanta.z()};
            node.colors = {make_rgba(1, 2, 3)};
            node.min_quanta = node.max_quanta = quanta;
            const std::vector<PointNode> nodes = {{&node, 0, 0.0f, float(kHeight)}};
            const PointProjection points(camera, quantization, kWidth, kHeight);
            PointsPass pass;
            GBuffer out;
            pass.clear(kWidth, 0, kHeight, 1);
            pass.draw(nodes, points, {.fixed_px = 1}, 1);
            pass.resolve(nodes, points, {.fixed_px = 1}, {}, 1, out);
            const auto hit = std::find_if(out.depths.begin(), out.depths.end(), [](float depth) { return depth != kNoDepth; });
            if (hit == out.depths.end()) continue;
            const size_t pixel = size_t(hit - out.depths.begin()), x = pixel % kWidth, y = pixel / kWidth;
            if (x == 0 || y == 0 || x + 1 == kWidth || y + 1 == kHeight) continue;
            double fall = 0.0;
            for (const size_t other : {pixel - 1, pixel + 1, pixel - kWidth, pixel + kWidth}) fall = std::max<double>(fall, std::abs(gbuffer.depths[other] - gbuffer.depths[pixel]));
            if (!(fall < 0.1)) continue;  // at its outline
            if (*hit > gbuffer.depths[pixel] + 0.3f) continue;  // on the far side
            ++compared;
            ASSERT_NEAR(*hit, gbuffer.depths[pixel], fall + 1e-5) << i;
        }
        EXPECT_GT(compared, 500u);
    }
}

bool same(const GBuffer& a, const GBuffer& b) { return a.colors == b.colors && a.depths == b.depths && a.ids == b.ids && a.splat_px == b.splat_px; }

// Millimeters on the ground are the same wherever on the earth they are: coordinates that doubles hold exactly give the same bytes.
TEST(MeshPass, FarFromZeroNothingJitters) {
    Random random(8);
    TriangleMesh near = torus_mesh(Vec3d::Zero(), 0.02, 0.008, 24);
    for (Vec3d& p : near.positions)
        for (double& part : p) part = std::round(part * 0x1p20) * 0x1p-20;
    const Vec3d offset(6400000.25, -3100000.5, 5300000.125);
    TriangleMesh far = near;
    for (Vec3d& p : far.positions) p += offset;
    for (int round = 0; round < 20; ++round) {
        Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, 0.08);
        for (double& part : camera.eye) part = std::round(part * 0x1p20) * 0x1p-20;
        camera.height = 0.08;
        camera.near_depth = round % 2 == 0 ? 1e-4 : 0.0;
        camera.far_depth = 1;
        const GBuffer here = drawn(near, camera);
        camera.eye += offset;
        const GBuffer there = drawn(far, camera);
        ASSERT_TRUE(same(here, there)) << round;
        EXPECT_GT(covered(here), 500u);
    }
}

// What many threads, rows by rows, another instruction set draw are the same bytes; clipped, wired, colored and with several meshes.
TEST(MeshPass, NeitherThreadsNorRowsNorInstructionsShow) {
    Random random(9);
    TriangleMesh mesh = torus_mesh(Vec3d::Zero(), 1.0, 0.4, 120);
    append(mesh, sphere_mesh(Vec3d(0.5, 0, 0), 0.6, 4));
    append(mesh, box_mesh(Vec3d(0, 0.9, 0.3), Vec3d(4.0, 0.02, 0.3)));
    for (size_t i = 0; i < mesh.positions.size(); ++i) mesh.colors.push_back({uint8_t(i * 7), uint8_t(i * 3), uint8_t(i), 255});
    const std::vector<ClipBox> clips = {{.box = {.min = Vec3d(-1, -1, -0.2), .max = Vec3d(1.2, 1, 1)}}, {.box = {.min = Vec3d(0, 0, 0), .max = Vec3d(0.3, 0.5, 9)}, .action = ClipBox::Action::remove}};
    for (int round = 0; round < 8; ++round) {
        Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, round == 6 ? 0.9 : 3.0);
        const MeshStyle style = {round % 3 == 0 ? MeshShading::flat : MeshShading::smooth, round % 2 == 1, round % 4 == 1};
        const MeshModel model = model_of(mesh, style, "rgb");
        const std::span<const ClipBox> boxes = round < 3 ? std::span<const ClipBox>() : std::span<const ClipBox>(clips);
        MeshPass pass;
        const auto whole = [&](int threads, SimdLevel level) {
            GBuffer gbuffer = empty_gbuffer();
            pass.draw(model, 3, view_of(camera, boxes, threads), gbuffer, level);
            return gbuffer;
        };
        const GBuffer expected = whole(1, SimdLevel::baseline);
        EXPECT_GT(covered(expected), 300u);
        for (int threads = 2; threads <= 5; ++threads) ASSERT_TRUE(same(whole(threads, best_simd_level()), expected)) << round << ' ' << threads;
        for (const SimdLevel level : simd_levels()) ASSERT_TRUE(same(whole(2, level), expected)) << name_of(level);
        for (const uint32_t rows : {1u, 7u, 33u})
            for (uint32_t row = 0; row < kHeight; row += rows) {
                GBuffer strip = empty_gbuffer(row, std::min(rows, kHeight - row));
                pass.draw(model, 3, view_of(camera, boxes, 2), strip);
                ASSERT_TRUE(std::equal(strip.ids.begin(), strip.ids.end(), expected.ids.begin() + row * kWidth)) << round << ' ' << row;
                ASSERT_TRUE(std::equal(strip.colors.begin(), strip.colors.end(), expected.colors.begin() + row * kWidth));
                ASSERT_TRUE(std::equal(strip.depths.begin(), strip.depths.end(), expected.depths.begin() + row * kWidth));
            }
    }
}

// Of what is equally near the lower triangle shows, and the drawable that was there before.
TEST(MeshPass, TiesGoToTheLowerNumber) {
    Random random(10);
    TriangleMesh mesh = torus_mesh(Vec3d::Zero(), 1.0, 0.4, 30);
    const uint32_t count = uint32_t(mesh.triangles.size());
    for (uint32_t i = 0; i < count; ++i) {
        const auto [a, b, c] = mesh.triangles[i];
        mesh.triangles.push_back({b, c, a});
        mesh.triangles.push_back({c, b, a});
    }
    for (int round = 0; round < 10; ++round) {
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, 3.0);
        GBuffer gbuffer = empty_gbuffer();
        MeshPass pass;
        EXPECT_TRUE(pass.draw(model_of(mesh), 1, view_of(camera), gbuffer));
        for (const PixelId id : gbuffer.ids)
            if (id != kNoPixelId) ASSERT_LT(primitive_of(id), count);
        const GBuffer before = gbuffer;
        EXPECT_FALSE(pass.draw(model_of(mesh), 2, view_of(camera), gbuffer));
        EXPECT_TRUE(same(before, gbuffer));
    }
}

// Triangles without area, needles, vertices at one place, and vertices at the ends of the numbers: nothing that is no number comes of them.
TEST(MeshPass, DegenerateTrianglesDoNoHarm) {
    Random random(11);
    TriangleMesh mesh;
    for (int i = 0; i < 400; ++i) {
        const Vec3d p = random_vector(random);
        mesh.positions.push_back(p);
        mesh.positions.push_back(p);
        mesh.positions.push_back(p + 1e-9 * random_vector(random));
        mesh.positions.push_back(p + Vec3d(0, 0, 1e-3 * random.normal()));
        mesh.positions.push_back(3.0 * random_vector(random));
    }
    mesh.positions.push_back(Vec3d::Constant(1e308));
    mesh.positions.push_back(Vec3d(-1e308, 1e300, 0));
    mesh.positions.push_back(Vec3d::Constant(1e-320));
    for (int i = 0; i < 6000; ++i) {
        const uint32_t around = uint32_t(random.bits() % (mesh.positions.size() - 5));
        mesh.triangles.push_back({around + uint32_t(random.bits() % 5), around + uint32_t(random.bits() % 5), i % 9 == 0 ? uint32_t(mesh.positions.size() - 1 - random.bits() % 3) : around + uint32_t(random.bits() % 5)});
        mesh.normals.assign(mesh.positions.size(), Vec3f::Zero());
    }
    for (size_t i = 0; i < mesh.normals.size(); i += 2) mesh.normals[i] = Vec3f(1e-30f, float(i % 3), 1e30f);
    for (int round = 0; round < 12; ++round) {
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, round < 6 ? 3.0 : 0.2);
        const MeshStyle style = {round % 4 < 2 ? MeshShading::flat : MeshShading::smooth, true, false};
        const GBuffer gbuffer = drawn(mesh, camera, style);
        for (size_t pixel = 0; pixel < gbuffer.depths.size(); ++pixel) {
            ASSERT_FALSE(std::isnan(gbuffer.depths[pixel]));
            if (gbuffer.depths[pixel] == kNoDepth) continue;
            ASSERT_GE(gbuffer.depths[pixel], float(camera.near_depth));
            ASSERT_EQ(alpha_of(gbuffer.colors[pixel]), 255);
        }
    }
}

TriangleMesh square_mesh(double z) {
    TriangleMesh mesh;
    mesh.positions = {{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

Camera from_above() { return camera_at(Projection::orthographic, {0, 0, 10}, {0, 0, -1}, {0, 1, 0}); }  // 20 pixels a unit

Rgba8 encoded(const Vec3f& light) { return make_rgba(srgb8_from_linear(light[0]), srgb8_from_linear(light[1]), srgb8_from_linear(light[2])); }

// By hand: a square of 2 units is 40 pixels wide, lit as the sky lights what looks up, from both sides.
TEST(MeshPass, ASquareIsLitByTheSkyFromBothSides) {
    for (const MeshShading shading : {MeshShading::flat, MeshShading::smooth}) {
        TriangleMesh mesh = square_mesh(3.0);
        for (const bool back : {false, true}) {
            if (back) turn_inside_out(mesh);
            const GBuffer gbuffer = drawn(mesh, from_above(), {.shading = shading});
            const Vec3f plain = linear_light(make_rgba(206, 200, 190));
            for (uint32_t y = 0; y < kHeight; ++y)
                for (uint32_t x = 0; x < kWidth; ++x) {
                    const size_t pixel = y * kWidth + x;
                    const bool in = x >= 28 && x < 68 && y >= 20 && y < 60;
                    ASSERT_EQ(gbuffer.depths[pixel], in ? 7.0f : kNoDepth) << x << ' ' << y;
                    ASSERT_EQ(gbuffer.splat_px[pixel], in ? 1 : 0);
                    if (!in) continue;
                    ASSERT_EQ(gbuffer.colors[pixel], encoded(plain * Sky().light(Vec3f::UnitZ())));
                    ASSERT_EQ(slot_of(gbuffer.ids[pixel]), back ? kBackSlot : kFrontSlot);
                    ASSERT_EQ(drawable_of(gbuffer.ids[pixel]), 1u);
                }
            const GBuffer marked = drawn(mesh, from_above(), {.shading = shading, .mark_backs = true});
            EXPECT_EQ(marked.colors[40 * kWidth + 48] != gbuffer.colors[40 * kWidth + 48], back);
        }
    }
}

// Between black and white light is half of white in the middle, not code 128.
TEST(MeshPass, ColorsOfVerticesMixInLinearLight) {
    TriangleMesh mesh = square_mesh(0.0);
    mesh.colors = {{0, 0, 0, 255}, {255, 255, 255, 255}, {255, 255, 255, 255}, {0, 0, 0, 255}};
    GBuffer gbuffer = empty_gbuffer();
    MeshPass().draw(model_of(mesh, {.shading = MeshShading::flat}, "rgb"), 1, view_of(from_above()), gbuffer);
    for (uint32_t x = 28; x < 68; ++x) {
        const float share = (float(x) + 0.5f - 28.0f) / 40.0f;
        EXPECT_NEAR(red_of(gbuffer.colors[40 * kWidth + x]), srgb8_from_linear(share * Sky().light(Vec3f::UnitZ())), 1) << x;
    }
}

// Wires are a pixel wide where triangles are large, and vanish where they are small.
TEST(MeshPass, WiresAreAPixelWideAtAnyDistance) {
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const double distance : {3.0, 12.0}) {
            TriangleMesh mesh = square_mesh(0.0);
            Camera camera = camera_at(projection, {0.013, 0.007, distance}, {0, 0, -1}, {0.3, 1, 0});  // turned, so that no side falls between pixels all along
            camera.height = distance;
            const GBuffer bare = drawn(mesh, camera), wired = drawn(mesh, camera, {.wireframe = true});
            const double side_px = 2.0 * pixels_per_unit(camera, distance, kHeight);
            double dark = 0.0;
            const float in_full = linear_from_srgb8()[red_of(bare.colors[40 * kWidth + 48])] * 0.75f;
            for (size_t pixel = 0; pixel < bare.colors.size(); ++pixel)
                if (bare.depths[pixel] != kNoDepth) dark += (linear_from_srgb8()[red_of(bare.colors[pixel])] - linear_from_srgb8()[red_of(wired.colors[pixel])]) / in_full;
            // Half of the rim's four sides lies outside; the diagonal is whole.
            EXPECT_NEAR(dark, 0.5 * 4 * side_px + std::sqrt(2.0) * side_px, 0.12 * side_px + 3) << distance;
        }
    const TriangleMesh fine = sphere_mesh(Vec3d::Zero(), 1.0, 200);
    Random random(12);
    const Camera camera = random_camera(random, Projection::perspective, 3.0);
    EXPECT_EQ(drawn(fine, camera).colors, drawn(fine, camera, {.wireframe = true}).colors);
}

// A box cuts where its faces are; what keeps and what removes are parts of one whole, also where the mesh lies on a face.
TEST(MeshPass, ClipBoxesCutThroughTriangles) {
    const TriangleMesh mesh = square_mesh(3.0);
    const auto covered_by = [&](const Box3d& box, ClipBox::Action action) {
        const std::vector<ClipBox> clips = {{box, action}};
        return drawn(mesh, from_above(), {}, clips);
    };
    const double inf = std::numeric_limits<double>::infinity();
    const Box3d left = {.min = Vec3d(-inf, -inf, 3.0), .max = Vec3d(0.2625, 0.5, inf)};  // 5.25 pixels right of the middle, 10 above it; on the mesh
    const GBuffer kept = covered_by(left, ClipBox::Action::keep), removed = covered_by(left, ClipBox::Action::remove);
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const size_t pixel = y * kWidth + x;
            const bool in = x >= 28 && x < 68 && y >= 20 && y < 60, in_box = x < 53 && y >= 30;
            ASSERT_EQ(kept.depths[pixel] != kNoDepth, in && in_box) << x << ' ' << y;
            ASSERT_EQ(removed.depths[pixel] != kNoDepth, in && !in_box) << x << ' ' << y;
        }
    EXPECT_EQ(covered(covered_by({.min = Vec3d(5, 5, 5), .max = Vec3d(6, 6, 6)}, ClipBox::Action::keep)), 0u);
    EXPECT_EQ(covered(covered_by({.min = Vec3d(5, 5, 5), .max = Vec3d(6, 6, 6)}, ClipBox::Action::remove)), 1600u);

    // Of a solid the far side shows through the cut.
    Random random(13);
    const TriangleMesh sphere = sphere_mesh(Vec3d::Zero(), 1.0, 20);
    for (int round = 0; round < 10; ++round) {
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, 3.0);
        const std::vector<ClipBox> keep = {{.box = {.min = Vec3d(-0.5, -0.6, -0.3), .max = Vec3d(0.9, 2, 0.4)}}}, remove = {{keep[0].box, ClipBox::Action::remove}};
        const GBuffer whole = drawn(sphere, camera), inner = drawn(sphere, camera, {}, keep), outer = drawn(sphere, camera, {}, remove);
        for (size_t pixel = 0; pixel < whole.depths.size(); ++pixel) {
            ASSERT_EQ(std::min(inner.depths[pixel], outer.depths[pixel]), whole.depths[pixel]) << round;
            if (inner.depths[pixel] != kNoDepth) {
                const MeshProjection view(camera, kWidth, kHeight, Vec2f::Zero());
                const MeshProjection::Ray ray = view.ray(double(pixel % kWidth) + 0.5, double(pixel / kWidth) + 0.5);
                const Vec3d p = camera.eye + ray.origin + double(inner.depths[pixel]) * ray.direction;
                ASSERT_TRUE((p.array() >= keep[0].box.min.array() - 1e-5).all() && (p.array() <= keep[0].box.max.array() + 1e-5).all());
            }
        }
    }
}

// A sample's picture is that of a camera whose pixels lie so much aside.
TEST(MeshPass, SamplesLieBesideThePixelsMiddle) {
    TriangleMesh mesh = square_mesh(3.0);
    const Camera camera = from_above();
    MeshView view = view_of(camera);
    view.offset_px = Vec2f(0.25f, -0.375f);
    GBuffer gbuffer = empty_gbuffer();
    MeshPass().draw(model_of(mesh), 1, view, gbuffer);
    for (Vec3d& p : mesh.positions) p += Vec3d(-0.25 / 20, -0.375 / 20, 0);
    const GBuffer moved = drawn(mesh, from_above());
    EXPECT_EQ(gbuffer.ids, moved.ids);
    EXPECT_EQ(gbuffer.colors, moved.colors);
}

// An attribute goes through the map as it is, evenly over a triangle; a value that is unknown at a corner is unknown in the whole triangle.
TEST(MeshColors, AttributesGoThroughTheMap) {
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    TriangleMesh mesh = square_mesh(0.0);
    ASSERT_EQ(mesh.positions.size(), 4u);
    mesh.scalars = {{"other", {9, 9, 9, 9}}, {"bone_density", {10, 20, 40, kUnknown}}};
    const MeshColors colors(mesh, "bone density", ColorRange{0, 40}, "ember");
    EXPECT_EQ(colors.rule(), MeshColors::Rule::ramp);
    EXPECT_EQ(colors.name(), "bone density");
    const Colormap map("ember");
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    const auto light = [&](uint32_t triangle, const Vec3f& weights) { return colors.light(mesh, triangle, weights, 123.0, Vec3f::UnitZ()); };
    EXPECT_EQ(light(0, {1, 0, 0}), linear_light(map.color(0.25)));
    EXPECT_EQ(light(0, {0, 0, 1}), linear_light(map.color(1.0)));
    EXPECT_EQ(light(0, {0.25f, 0.5f, 0.25f}), linear_light(map.color(22.5 / 40)));
    EXPECT_EQ(light(1, {1, 0, 0}), linear_light(make_rgba(128, 128, 128)));
    // Without a range that of what is known: 10 to 40.
    const MeshColors own(mesh, "bone_density", std::nullopt, "ember");
    EXPECT_EQ(own.light(mesh, 0, {1, 0, 0}, 0.0, Vec3f::UnitZ()), linear_light(map.color(0.0)));
    // The greater one may come first, and a single value is in the middle.
    EXPECT_EQ(MeshColors(mesh, "bone_density", ColorRange{40, 10}, "ember").light(mesh, 0, {1, 0, 0}, 0.0, Vec3f::UnitZ()), linear_light(map.color(1.0)));
    EXPECT_EQ(MeshColors(mesh, "other", std::nullopt, "ember").light(mesh, 0, {1, 0, 0}, 0.0, Vec3f::UnitZ()), linear_light(map.color(0.5)));
    mesh.scalars = {{"none", std::vector<float>(4, kUnknown)}};
    EXPECT_EQ(MeshColors(mesh, "none", std::nullopt, {}).light(mesh, 0, {1, 0, 0}, 0.0, Vec3f::UnitZ()), linear_light(make_rgba(128, 128, 128)));
}

// Numbers without an order are not mixed: a place has that of the corner that counts for most there, in the color that points have for it.
TEST(MeshColors, ClassesAndLabelsAreTheirNearestCorners) {
    TriangleMesh mesh = square_mesh(0.0);
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    mesh.scalars = {{"classification", {2, 6, 9, std::numeric_limits<float>::quiet_NaN()}}, {"label", {1, 257, 70'000, -1}}, {"return_number", {1, 2, 3, 4}}, {"intensity", {0, 5, 10, 10}}};
    const auto color = [&](const char* name, uint32_t triangle, const Vec3f& weights) { return MeshColors(mesh, name, std::nullopt, {}).light(mesh, triangle, weights, 0.0, Vec3f::UnitZ()); };
    EXPECT_EQ(MeshColors(mesh, "class", std::nullopt, {}).rule(), MeshColors::Rule::category);
    EXPECT_EQ(color("classification", 0, {0.3f, 0.4f, 0.3f}), linear_light(classification_colors()[6]));
    EXPECT_EQ(color("class", 0, {0.1f, 0.2f, 0.7f}), linear_light(classification_colors()[9]));
    EXPECT_EQ(color("classification", 1, {0.2f, 0.2f, 0.6f}), linear_light(make_rgba(128, 128, 128)));
    EXPECT_EQ(color("label", 0, {0.1f, 0.8f, 0.1f}), linear_light(category_color(257)));
    EXPECT_EQ(color("label", 0, {0.1f, 0.1f, 0.8f}), linear_light(category_color(70'000)));
    EXPECT_EQ(color("return", 1, {0.1f, 0.1f, 0.8f}), linear_light(category_color(4)));
    // Intensities are gray, as those of points.
    EXPECT_EQ(color("intensity", 0, {0, 1, 0}), linear_light(Colormap("gray").color(0.5)));
}

TEST(MeshColors, WhatAMeshDoesNotHaveIsRefused) {
    const TriangleMesh mesh = square_mesh(0.0);
    EXPECT_EQ(MeshColors(mesh, "", std::nullopt, {}).rule(), MeshColors::Rule::plain);
    for (const std::string_view name : {"rgb", "intensity", "lod"}) {
        try {
            MeshColors(mesh, name, std::nullopt, {});
            ADD_FAILURE() << name;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::usage);
        }
    }
}

}  // namespace
}  // namespace strata
