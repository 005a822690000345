#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "core/error.h"
#include "core/math/random.h"
#include "core/voxel/mesh_voxels.h"
#include "core/voxel/triangle_scan.h"
#include "tests/support/run_program.h"
#include "tests/support/test_meshes.h"
#include "tests/support/voxels_of_mesh.h"

namespace strata {
namespace {

using Point = std::array<Int128, 3>;
using Corners = std::array<Point, 3>;

Int128 dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Point cross(const Point& a, const Point& b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }

// The separating axis theorem, axis after axis, in whole numbers.
class Touch {
public:
    explicit Touch(const Corners& t) : t_(t) {
        axes_ = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, cross(minus(t[1], t[0]), minus(t[2], t[0]))};
        for (size_t k = 0; k < 3; ++k)
            for (size_t a = 0; a < 3; ++a) axes_.push_back(cross(minus(t[(k + 1) % 3], t[k]), axes_[a]));
    }

    bool box(const Point& low, const Point& high) const {
        for (const Point& axis : axes_) {
            const auto [tri_low, tri_high] = std::minmax({dot(axis, t_[0]), dot(axis, t_[1]), dot(axis, t_[2])});
            Int128 box_low = 0, box_high = 0;
            for (size_t a = 0; a < 3; ++a) {
                box_low += std::min(axis[a] * low[a], axis[a] * high[a]);
                box_high += std::max(axis[a] * low[a], axis[a] * high[a]);
            }
            if (tri_high < box_low || box_high < tri_low) return false;
        }
        return true;
    }

private:
    Corners t_;
    std::vector<Point> axes_;
};

struct Rational {
    Int128 above, below;  // below > 0
    bool operator<(const Rational& o) const { return above * o.below < o.above * below; }
};

// The triangle meets the segment from `low` to `high`, without `high`, along axis w: the least and the greatest point that the line
// through it has in common with the triangle, from the points it has in common with its edges and its inside.
bool meets_segment(const Corners& t, size_t w, const Point& low, Int128 length) {
    const size_t u = (w + 1) % 3, v = (w + 2) % 3;
    for (const size_t a : {u, v})
        if (low[a] < std::min({t[0][a], t[1][a], t[2][a]}) || low[a] > std::max({t[0][a], t[1][a], t[2][a]})) return false;
    std::vector<Rational> common;
    for (size_t k = 0; k < 3; ++k) {
        const Point &p = t[k], &q = t[(k + 1) % 3];
        if (p[u] == q[u] && p[v] == q[v]) {
            if (p[u] == low[u] && p[v] == low[v]) common.insert(common.end(), {{p[w], 1}, {q[w], 1}});
            continue;
        }
        if ((q[u] - p[u]) * (low[v] - p[v]) != (q[v] - p[v]) * (low[u] - p[u])) continue;
        const size_t a = p[u] != q[u] ? u : v;
        if (low[a] < std::min(p[a], q[a]) || low[a] > std::max(p[a], q[a])) continue;
        Rational at = {p[w] * (q[a] - p[a]) + (low[a] - p[a]) * (q[w] - p[w]), q[a] - p[a]};
        if (at.below < 0) at = {-at.above, -at.below};
        common.push_back(at);
    }
    const Point n = cross(minus(t[1], t[0]), minus(t[2], t[0]));
    if (n[w] != 0) {
        bool left = true, right = true;
        for (size_t k = 0; k < 3; ++k) {
            const Point &p = t[k], &q = t[(k + 1) % 3];
            const Int128 side = (q[u] - p[u]) * (low[v] - p[v]) - (q[v] - p[v]) * (low[u] - p[u]);
            left = left && side >= 0;
            right = right && side <= 0;
        }
        Rational at = {dot(n, t[0]) - n[u] * low[u] - n[v] * low[v], n[w]};
        if (at.below < 0) at = {-at.above, -at.below};
        if (left || right) common.push_back(at);
    }
    if (common.empty()) return false;
    const auto [least, most] = std::minmax_element(common.begin(), common.end());
    return *least < Rational{low[w] + length, 1} && !(*most < Rational{low[w], 1});
}

bool occupies(const Corners& t, const Touch& touch, VoxelKind kind, const std::array<uint32_t, 3>& voxel, Int128 unit) {
    const Point low = {voxel[0] * unit, voxel[1] * unit, voxel[2] * unit}, high = {low[0] + unit, low[1] + unit, low[2] + unit};
    if (kind == VoxelKind::conservative) return touch.box(low, high);
    for (size_t w = 0; w < 3; ++w) {
        Point start = {low[0] + unit / 2, low[1] + unit / 2, low[2] + unit / 2};
        start[w] = low[w];
        if (meets_segment(t, w, start, unit)) return true;
    }
    return false;
}

Corners corners_of(const TriangleMesh& mesh, size_t triangle, double unit) {
    Corners t;
    for (size_t k = 0; k < 3; ++k)
        for (int a = 0; a < 3; ++a) t[k][size_t(a)] = Int128(std::floor(mesh.positions[mesh.triangles[triangle][k]][a] * unit + 0.5));
    return t;
}

CellGrid brute_force(const TriangleMesh& mesh, const VoxelFrame& frame, VoxelKind kind) {
    CellGrid dense(frame.side());
    const double unit = std::ldexp(1.0, snapped_bits(frame));
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
        const Corners t = corners_of(mesh, i, unit);
        const Touch touch(t);
        for (uint32_t x = 0; x < dense.side; ++x)
            for (uint32_t y = 0; y < dense.side; ++y)
                for (uint32_t z = 0; z < dense.side; ++z)
                    if (!dense.at(x, y, z) && occupies(t, touch, kind, {x, y, z}, Int128(unit))) dense.at(x, y, z) = 1;
    }
    return dense;
}

TriangleMesh one_triangle(const Vec3d& p, const Vec3d& q, const Vec3d& r) {
    TriangleMesh mesh;
    mesh.positions = {p, q, r};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}

// Coordinates that like whole and half numbers, in a frame of 16 voxels.
double odd_coordinate(Random& random, int mood) {
    const double x = random.uniform(-2.0, 18.0);
    switch ((mood + int(random.bits() % 3)) % 6) {
        case 0: return std::floor(x);
        case 1: return std::floor(x) + 0.5;
        case 2: return std::floor(4.0 * x) / 4.0;
        case 3: return std::floor(x) + (random.bits() % 2 ? 0x1p-16 : -0x1p-16);
        default: return x;
    }
}

TriangleMesh odd_triangle(Random& random) {
    const int mood = int(random.bits() % 6);
    const auto point = [&] { return Vec3d(odd_coordinate(random, mood), odd_coordinate(random, mood), odd_coordinate(random, mood)); };
    const Vec3d p = point();
    Vec3d q = point(), r = point();
    switch (random.bits() % 10) {
        case 0: q[int(random.bits() % 3)] = p[int(random.bits() % 3)]; break;
        case 1: {  // in a plane along two axes
            const int a = int(random.bits() % 3);
            q[a] = r[a] = p[a];
            break;
        }
        case 2: r = p + std::floor(random.uniform(-3.0, 3.0)) * (q - p); break;                 // no area
        case 3: r = q; break;                                                                   // a segment
        case 4: r = q = p; break;                                                               // a point
        case 5: r = 0.5 * (p + q) + Vec3d::Constant(random.uniform(-1e-4, 1e-4)); break;        // a sliver
        case 6: q = p + 0.3 * (q - p).normalized(), r = p + 0.3 * (r - p).normalized(); break;  // small; a point stays one
        case 7: {                                                                               // edges along an axis
            const int a = int(random.bits() % 3);
            q = p;
            q[a] += std::floor(random.uniform(-5.0, 5.0));
            break;
        }
        case 8: q = 100.0 * q, r = -30.0 * r; break;  // far out of the frame
        default: break;
    }
    if (!q.allFinite()) q = p;
    if (!r.allFinite()) r = p;
    return one_triangle(p, q, r);
}

const VoxelFrame kSmallFrame = {.levels = 2};

TEST(MeshSurfaceVoxels, AreThoseOfExactBruteForce) {
    Random random(1);
    uint64_t occupied[2] = {};
    const int triangles = test::built_with_sanitizer() ? 1500 : 6000;
    for (int i = 0; i < triangles; ++i) {
        const TriangleMesh mesh = odd_triangle(random);
        for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin}) {
            const CellGrid expected = brute_force(mesh, kSmallFrame, kind), found = cells_of(mesh, kSmallFrame, kind);
            occupied[int(kind)] += found.count();
            ASSERT_TRUE(found == expected) << "triangle " << i << " kind " << int(kind) << ": " << found.count() << " voxels, not "
                                           << expected.count() << "\n"
                                           << mesh.positions[0].transpose() << "\n"
                                           << mesh.positions[1].transpose() << "\n"
                                           << mesh.positions[2].transpose();
        }
    }
    EXPECT_GT(occupied[0], 33u * unsigned(triangles));  // the triangles do go through the frame
    EXPECT_GT(occupied[1], 8u * unsigned(triangles));
}

TEST(MeshSurfaceVoxels, ConservativeOnesContainThinOnes) {
    Random random(2);
    for (int i = 0; i < 2000; ++i) {
        const TriangleMesh mesh = odd_triangle(random);
        const CellGrid all = cells_of(mesh, kSmallFrame, VoxelKind::conservative), thin = cells_of(mesh, kSmallFrame, VoxelKind::thin);
        for (size_t k = 0; k < all.cells.size(); ++k) ASSERT_LE(thin.cells[k], all.cells[k]);
    }
}

TEST(MeshSurfaceVoxels, DoNotDependOnTheOrderOfCorners) {
    Random random(3);
    for (int i = 0; i < 1000; ++i) {
        TriangleMesh mesh = odd_triangle(random);
        for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin}) {
            mesh.triangles = {{0, 1, 2}};
            const CellGrid first = cells_of(mesh, kSmallFrame, kind);
            for (const std::array<uint32_t, 3>& order : {std::array<uint32_t, 3>{1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}) {
                mesh.triangles = {order};
                ASSERT_TRUE(cells_of(mesh, kSmallFrame, kind) == first) << i;
            }
        }
    }
}

// By hand: a square of 4 x 4 voxels on faces of voxels touches both layers, and one more voxel at each side. Thin, it is the layer above.
TEST(MeshSurfaceVoxels, OfASquareOnFacesOfVoxels) {
    for (int axis = 0; axis < 3; ++axis) {
        TriangleMesh mesh;
        for (int k = 0; k < 4; ++k) {
            Vec3d p = Vec3d::Constant(6.0);
            p[(axis + 1) % 3] += k & 1 ? 2.0 : -2.0;
            p[(axis + 2) % 3] += k & 2 ? 2.0 : -2.0;
            mesh.positions.push_back(p);
        }
        mesh.triangles = {{0, 1, 3}, {0, 2, 3}};
        EXPECT_EQ(cells_of(mesh, kSmallFrame, VoxelKind::conservative).count(), 2u * 6 * 6);
        const CellGrid thin = cells_of(mesh, kSmallFrame, VoxelKind::thin);
        EXPECT_EQ(thin.count(), 16u);
        EXPECT_EQ(thin.at(6, 6, 6), 1);
    }
}

// Whether a path of empty cells, each beside the next (6) or touching it (26), leads from a corner of the frame to the cell.
bool flood_reaches(const CellGrid& voxels, int neighbors, const std::array<uint32_t, 3>& cell) {
    CellGrid reached(voxels.side);
    std::deque<std::array<uint32_t, 3>> front = {{0, 0, 0}};
    reached.at(0, 0, 0) = 1;
    while (!front.empty()) {
        const auto [x, y, z] = front.front();
        front.pop_front();
        for (int dx = -1; dx <= 1; ++dx)
            for (int dy = -1; dy <= 1; ++dy)
                for (int dz = -1; dz <= 1; ++dz) {
                    if (neighbors == 6 && std::abs(dx) + std::abs(dy) + std::abs(dz) != 1) continue;
                    const uint32_t nx = x + uint32_t(dx), ny = y + uint32_t(dy), nz = z + uint32_t(dz);
                    if (nx >= voxels.side || ny >= voxels.side || nz >= voxels.side || voxels.at(nx, ny, nz) || reached.at(nx, ny, nz))
                        continue;
                    reached.at(nx, ny, nz) = 1;
                    front.push_back({nx, ny, nz});
                }
    }
    return reached.at(cell[0], cell[1], cell[2]);
}

TEST(MeshSurfaceVoxels, SeparateInsideFromOutside) {
    const VoxelFrame frame = {.levels = 3};
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    struct Case {
        const char* name;
        TriangleMesh mesh;
        std::array<uint32_t, 3> inside;
        bool smooth;  // its thin voxels touch at corners somewhere
    };
    const std::vector<Case> cases = {
        {"sphere", sphere_mesh(Vec3d(32.1, 31.7, 32.4), 20.3, 17), {32, 32, 32}, true},
        {"torus", torus_mesh(Vec3d(32.1, 31.7, 32.4), 19.0, 7.0, 40), {51, 31, 32}, true},
        {"box", box_mesh(Vec3d::Constant(32.0), Vec3d(20.0, 15.5, 10.25)), {32, 32, 32}, false},
        {"turned box", box_mesh(Vec3d(32.1, 31.7, 32.4), Vec3d(20.0, 15.5, 10.25), turn), {32, 32, 32}, true},
        // Vertices and edges on centers, edges and corners of voxels.
        {"octahedron", sphere_mesh(Vec3d::Constant(32.0), 16.0, 2), {32, 32, 32}, true},
        {"octahedron on centers", sphere_mesh(Vec3d::Constant(32.5), 16.0, 2), {32, 32, 32}, true},
    };
    for (const Case& c : cases) {
        ASSERT_GT(volume_of(c.mesh), 0.0) << c.name;
        const CellGrid all = cells_of(c.mesh, frame, VoxelKind::conservative), thin = cells_of(c.mesh, frame, VoxelKind::thin);
        ASSERT_FALSE(all.at(c.inside[0], c.inside[1], c.inside[2])) << c.name;
        EXPECT_FALSE(flood_reaches(all, 26, c.inside)) << c.name;
        EXPECT_FALSE(flood_reaches(thin, 6, c.inside)) << c.name;
        if (c.smooth) {
            EXPECT_TRUE(flood_reaches(thin, 26, c.inside)) << c.name;  // no thicker than it must be
        }
    }
}

struct Statistics {
    double mean, error;  // of the mean
};
template <class Sample>
Statistics mean_of(int n, const Sample& sample) {
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < n; ++i) {
        const double x = sample();
        sum += x;
        squares += x * x;
    }
    const double mean = sum / n;
    return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1))};
}

// Over all offsets the mean number of voxels that a convex polygon touches is the volume of its Minkowski sum with a voxel:
// 1 + the sum of its extents + area * |n|_1. Thin: no less than area * |n|_inf, more by at most a voxel's width along its rim.
TEST(MeshSurfaceVoxels, OfAPlaneAreAsManyAsFollowsFromItsNormal) {
    Random random(4);
    const VoxelFrame frame = {.levels = 4};
    for (int i = 0; i < 6; ++i) {
        const Vec3d u = Vec3d(random.normal(), random.normal(), random.normal()).normalized(),
                    v = u.cross(Vec3d(random.normal(), random.normal(), random.normal())).normalized(), n = u.cross(v);
        const double a = random.uniform(20.0, 80.0), b = random.uniform(20.0, 80.0), area = a * b;
        const auto count = [&](VoxelKind kind) {
            return mean_of(40, [&] {
                const Vec3d center = Vec3d::Constant(128.0) + Vec3d(random.uniform(), random.uniform(), random.uniform());
                TriangleMesh mesh;
                for (int k = 0; k < 4; ++k) mesh.positions.push_back(center + (k & 1 ? 0.5 : -0.5) * a * u + (k & 2 ? 0.5 : -0.5) * b * v);
                mesh.triangles = {{0, 1, 3}, {0, 2, 3}};
                return double(count_voxels(blocks_of(mesh, frame, {.kind = kind})));
            });
        };
        const double extents = (a * u.cwiseAbs() + b * v.cwiseAbs()).sum();
        const Statistics all = count(VoxelKind::conservative), thin = count(VoxelKind::thin);
        EXPECT_NEAR(all.mean, area * n.cwiseAbs().sum() + extents + 1.0, 4.5 * all.error + 0.01);
        EXPECT_GT(thin.mean, area * n.cwiseAbs().maxCoeff() - 4.5 * thin.error);
        EXPECT_LT(thin.mean, area * n.cwiseAbs().maxCoeff() + 2.0 * (a + b) + 4.5 * thin.error);
    }
}

// 6 pi R^2; the terms left out grow as R: Steiner's formula has 6 R for what touches the ball, the voxels inside it at most as much.
TEST(MeshSurfaceVoxels, OfASphereAreSixPiRadiusSquared) {
    const double radius = 100.0;
    const auto blocks = blocks_of(sphere_mesh(Vec3d(128.3, 127.9, 128.6), radius, 400), {.levels = 4}, {});
    EXPECT_NEAR(double(count_voxels(blocks)), 6.0 * M_PI * radius * radius, 12.0 * radius);
    // Thin: the plane's |n|_inf over the sphere, 4 pi R^2 times its mean, 0.8312 (0.5 + ... over a face of the cube, by quadrature below).
    double weight = 0.0, sum = 0.0;
    constexpr int kSteps = 400;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < kSteps; ++j) {
            const double x = (i + 0.5) / kSteps, y = (j + 0.5) / kSteps, r2 = 1.0 + x * x + y * y;
            weight += std::pow(r2, -1.5);  // solid angle of a piece of the cube's face
            sum += std::pow(r2, -1.5) / std::sqrt(r2);
        }
    const auto thin = blocks_of(sphere_mesh(Vec3d(128.3, 127.9, 128.6), radius, 400), {.levels = 4}, {.kind = VoxelKind::thin});
    EXPECT_NEAR(double(count_voxels(thin)), 4.0 * M_PI * radius * radius * sum / weight, 12.0 * radius);
}

TEST(MeshSurfaceVoxels, DoNotDependOnThreadsAndTheOrderOfTriangles) {
    TriangleMesh mesh = sphere_mesh(Vec3d(130.0, 120.0, 125.0), 110.0, 60);
    append(mesh, box_mesh(Vec3d::Constant(100.0), Vec3d(30.0, 70.0, 90.0)));
    for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin}) {
        const auto expected = blocks_of(mesh, {.levels = 4}, {.kind = kind});
        for (const int threads : {2, 3, 8}) EXPECT_EQ(blocks_of(mesh, {.levels = 4}, {.kind = kind, .threads = threads}), expected);
        TriangleMesh reversed = mesh;
        std::reverse(reversed.triangles.begin(), reversed.triangles.end());
        EXPECT_EQ(blocks_of(reversed, {.levels = 4}, {.kind = kind, .threads = 2}), expected);
    }
}

TEST(MeshSurfaceVoxels, OutsideTheFrameAreCutOff) {
    const TriangleMesh mesh = sphere_mesh(Vec3d(8.0, 8.0, 8.0), 60.0, 40);
    const TriangleMesh moved = sphere_mesh(Vec3d(40.0, 40.0, 40.0), 60.0, 40);
    const CellGrid whole = cells_of(moved, {.origin = Vec3d::Constant(-96.0), .levels = 4}, VoxelKind::conservative);
    // A frame of 64 within one of 256, 96 from its corner.
    const CellGrid part = cells_of(moved, {.levels = 3}, VoxelKind::conservative);
    EXPECT_GT(part.count(), 400u);
    for (uint32_t x = 0; x < 64; ++x)
        for (uint32_t y = 0; y < 64; ++y)
            for (uint32_t z = 0; z < 64; ++z) ASSERT_EQ(part.at(x, y, z), whole.at(x + 96, y + 96, z + 96));
    EXPECT_TRUE(blocks_of(mesh, {.levels = 2}, {}).empty());  // the frame is inside the sphere
    EXPECT_TRUE(blocks_of(mesh, {.origin = Vec3d::Constant(1e6), .levels = 2}, {}).empty());
}

// A triangle as wide as the world in the plane x + y + z = 24: its parts are halved and halved, and lie where it lies.
TEST(MeshSurfaceVoxels, OfATriangleThatReachesFarOut) {
    for (const double reach : {1e3, 1e5, 1e7, 1e9, 1e11}) {
        const double r = std::floor(reach) * 6.0;  // a multiple of what keeps halves on the grid for a while
        const TriangleMesh mesh = one_triangle(Vec3d(8.0 + r, 8.0 - r, 8.0), Vec3d(8.0, 8.0 + r, 8.0 - r), Vec3d(8.0 - r, 8.0, 8.0 + r));
        const CellGrid found = cells_of(mesh, kSmallFrame, VoxelKind::conservative);
        for (uint32_t x = 0; x < 16; ++x)
            for (uint32_t y = 0; y < 16; ++y)
                for (uint32_t z = 0; z < 16; ++z) {
                    const uint32_t low =
                        x + y + z;  // of its corner; those that touch in a point may be lost or not where points were moved
                    if (low < 24 && low + 3 > 24) {
                        ASSERT_TRUE(found.at(x, y, z)) << reach;
                    } else if (low > 24 || low + 3 < 24) {
                        ASSERT_FALSE(found.at(x, y, z)) << reach;
                    }
                }
    }
}

TEST(MeshSurfaceVoxels, OfTheFinestFrame) {
    // A sphere of 3 voxels radius in the last corner of 2^20 voxels an axis is that in the first, moved.
    const VoxelFrame frame = {.levels = 10};
    const double side = 1048576.0;
    const TriangleMesh near = sphere_mesh(Vec3d::Constant(4.0), 3.0, 8), far = sphere_mesh(Vec3d::Constant(side - 4.0), 3.0, 8);
    const auto here = blocks_of(near, frame, {}), there = blocks_of(far, frame, {});
    ASSERT_EQ(here.size(), 8u);
    ASSERT_EQ(there.size(), 8u);
    const uint64_t moved = octant_code(262142, 262142, 262142);
    for (size_t i = 0; i < 8; ++i) {
        EXPECT_EQ(there[i].code, here[i].code + moved);
        EXPECT_EQ(there[i].mask, here[i].mask);
    }
    // A needle across the whole frame: more bricks than any table of them could hold.
    const auto needle = blocks_of(one_triangle(Vec3d(0.5, 0.5, 0.5), Vec3d(side - 0.5, side - 0.5, side - 0.5), Vec3d(0.5, 0.5, 0.5)),
                                  frame, {.threads = 2});
    EXPECT_EQ(count_voxels(needle),
              uint64_t(side) + 6 * (uint64_t(side) - 1));  // touches edges and faces of the six beside each corner it goes through
}

TEST(MeshSurfaceVoxels, OfGeoreferencedMeshes) {
    const Vec3d far(512345.25, 5312345.5, 431.75);
    const VoxelFrame here = {.origin = Vec3d::Zero(), .voxel_size = 0.125, .levels = 4},
                     there = {.origin = far, .voxel_size = 0.125, .levels = 4};
    TriangleMesh mesh = sphere_mesh(Vec3d::Constant(15.0), 12.0, 30), moved;
    for (Vec3d& p : mesh.positions) p = (p * 4096.0).array().round() / 4096.0;  // so that adding `far` does not round
    moved = mesh;
    for (Vec3d& p : moved.positions) p += far;
    EXPECT_EQ(blocks_of(moved, there, {}), blocks_of(mesh, here, {}));
}

TEST(MeshSurfaceVoxels, OfNothingAreNone) {
    for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin, VoxelKind::solid}) {
        EXPECT_TRUE(blocks_of({}, kSmallFrame, {.kind = kind, .threads = 2}).empty());
        TriangleMesh points;
        points.positions = {Vec3d::Zero(), Vec3d::Ones()};
        EXPECT_TRUE(blocks_of(points, kSmallFrame, {.kind = kind}).empty());
    }
}

std::string failure_of(const TriangleMesh& mesh, const MeshVoxelSettings& settings, ErrorKind kind) {
    try {
        blocks_of(mesh, kSmallFrame, settings);
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, kind);
        return error.what();
    }
    return "none";
}

TEST(MeshSurfaceVoxels, RefuseWhatIsNoMesh) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(failure_of(one_triangle(Vec3d::Zero(), Vec3d(0, nan, 0), Vec3d::Ones()), {}, ErrorKind::malformed), "vertex 1 is not finite");
    EXPECT_EQ(failure_of(one_triangle(Vec3d::Zero(), Vec3d::Ones(), Vec3d(0, 0, -inf)), {}, ErrorKind::malformed),
              "vertex 2 is not finite");
    EXPECT_EQ(failure_of(one_triangle(Vec3d(1e300, 0, 0), Vec3d::Ones(), Vec3d::Zero()), {}, ErrorKind::limit),
              "vertex 0 lies more than 2^40 voxels outside the frame");
    TriangleMesh mesh = one_triangle(Vec3d::Zero(), Vec3d::Ones(), Vec3d::UnitX());
    mesh.triangles = {{0, 1, 3}};
    EXPECT_EQ(failure_of(mesh, {}, ErrorKind::malformed), "triangle 0 has vertex 3, of 3");
}

// They are there in files, as marks of what is missing.
TEST(MeshSurfaceVoxels, VerticesThatNoTriangleUsesMayLieAnywhere) {
    const TriangleMesh closed = box_mesh(Vec3d::Constant(8.0), Vec3d::Constant(5.3));
    TriangleMesh open = closed;
    open.triangles.resize(open.triangles.size() - 2);  // its hole is looked at by places of vertices
    for (const TriangleMesh& mesh : {closed, open})
        for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin, VoxelKind::solid}) {
            TriangleMesh more = mesh;
            for (const double far : {1e30, -1e300, 1e9, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
                more.positions.push_back({far, 0, 0});
            EXPECT_EQ(blocks_of(more, kSmallFrame, {.kind = kind, .threads = 2}), blocks_of(mesh, kSmallFrame, {.kind = kind}));
            more.triangles.push_back({0, 1, uint32_t(mesh.positions.size())});
            EXPECT_THROW(blocks_of(more, kSmallFrame, {.kind = kind}), Error);
        }
}

TEST(MeshSurfaceVoxels, KeepTheirMemory) {
    const TriangleMesh mesh = sphere_mesh(Vec3d::Constant(8.0), 7.0, 300);  // 180,600 vertices of 12 bytes; 358,800 triangles of 24
    EXPECT_EQ(failure_of(mesh, {.memory_bytes = 1 << 20}, ErrorKind::limit), "snapped vertices take 3 MiB of memory, 1 MiB are left");
    EXPECT_EQ(failure_of(mesh, {.memory_bytes = 4 << 20}, ErrorKind::limit), "triangles by bricks take 9 MiB of memory, 1 MiB are left");
    EXPECT_EQ(failure_of(mesh, {.memory_bytes = 11 << 20}, ErrorKind::limit), "none");
}

TEST(MeshSurfaceVoxels, HandOnWhatTheSinkThrows) {
    const TriangleMesh mesh = sphere_mesh(Vec3d::Constant(128.0), 120.0, 30);
    for (const int threads : {1, 4}) {
        int calls = 0;
        EXPECT_THROW(voxelize_mesh(mesh, {.levels = 4}, {.threads = threads},
                                   [&](const VoxelBatch&) {
                                       if (++calls == 3) throw Error(ErrorKind::io, "full");
                                   }),
                     Error);
        EXPECT_EQ(calls, 3);
    }
}

}  // namespace
}  // namespace strata
