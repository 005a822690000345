// Faces with known areas through the readers of OBJ and PLY: triangles within the polygon have areas that sum to its own.
#include "io/mesh/concave_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "core/math/random.h"
#include "tests/io/mesh/mesh_of.h"

namespace strata {
namespace {

using test::Triangles;
using Polygon = std::vector<Vec2d>;

double area_of(const Polygon& polygon) {
    double twice = 0.0;
    for (size_t i = 0; i < polygon.size(); ++i) {
        const Vec2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        twice += a.x() * b.y() - a.y() * b.x();
    }
    return std::abs(twice) / 2.0;
}

double area_of(const TriangleMesh& mesh) {
    double twice = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) twice += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm();
    return twice / 2.0;
}

enum class Order { vertices_first, faces_first };

std::string text_of(const Vec3d& p) {
    char text[100];
    snprintf(text, sizeof text, "%.17g %.17g %.17g\n", p.x(), p.y(), p.z());
    return text;
}

test::MeshOf obj(const std::vector<Vec3d>& corners, Order order = Order::vertices_first) {
    std::string vertices, face = "f";
    for (size_t i = 0; i < corners.size(); ++i) {
        vertices += "v " + text_of(corners[i]);
        face += " " + std::to_string(i + 1);
    }
    return test::mesh_of(read_obj, order == Order::vertices_first ? vertices + face + "\n" : face + "\n" + vertices);
}

test::MeshOf ply(const std::vector<Vec3d>& corners, Order order = Order::vertices_first) {
    const std::string count = std::to_string(corners.size()), vertex = "element vertex " + count + "\nproperty double x\nproperty double y\nproperty double z\n",
                      list = "element face 1\nproperty list int int vertex_indices\n";
    std::string vertices, face = count;
    for (size_t i = 0; i < corners.size(); ++i) {
        vertices += text_of(corners[i]);
        face += " " + std::to_string(i);
    }
    const bool first = order == Order::vertices_first;
    return test::mesh_of(read_ply, "ply\nformat ascii 1.0\n" + (first ? vertex + list : list + vertex) + "end_header\n" + (first ? vertices + face + "\n" : face + "\n" + vertices));
}

std::vector<Vec3d> in_space(const Polygon& polygon, const Eigen::Isometry3d& place = Eigen::Isometry3d::Identity()) {
    std::vector<Vec3d> corners;
    for (const Vec2d& p : polygon) corners.push_back(place * Vec3d(p.x(), p.y(), 0.0));
    return corners;
}

// Every edge of the outline is one triangle's, and every other edge two's, in both directions: the triangles are the polygon.
void expect_outline(const TriangleMesh& mesh, size_t corners) {
    ASSERT_EQ(mesh.triangles.size(), corners - 2);
    std::multiset<std::array<uint32_t, 2>> open;
    for (const auto& t : mesh.triangles)
        for (size_t k = 0; k < 3; ++k) {
            const auto back = open.find({t[(k + 1) % 3], t[k]});
            if (back != open.end())
                open.erase(back);
            else
                open.insert({t[k], t[(k + 1) % 3]});
        }
    std::multiset<std::array<uint32_t, 2>> outline;
    for (uint32_t i = 0; i < corners; ++i) outline.insert({i, uint32_t((i + 1) % corners)});
    EXPECT_EQ(open, outline);
}

// From each of its corners, both ways round, tilted, at map coordinates, by each reader, whatever comes first in the file.
void expect_area(Polygon polygon) {
    const double area = area_of(polygon);
    Eigen::Isometry3d tilted = Eigen::Translation3d(500'000, 5'000'000, 300) * Eigen::Isometry3d(Eigen::AngleAxisd(2.1, Vec3d(1, -2, 0.5).normalized()));
    for (size_t first = 0; first < polygon.size(); ++first) {
        std::rotate(polygon.begin(), polygon.begin() + 1, polygon.end());
        for (const Polygon& turned : {polygon, Polygon(polygon.rbegin(), polygon.rend())})
            for (const auto& place : {Eigen::Isometry3d::Identity(), tilted})
                for (const Order order : {Order::vertices_first, Order::faces_first}) {
                    const std::vector<Vec3d> corners = in_space(turned, place);
                    const TriangleMesh mesh = obj(corners, order).mesh;
                    EXPECT_NEAR(area_of(mesh), area, 1e-6 * area) << first;
                    expect_outline(mesh, corners.size());
                    EXPECT_EQ(ply(corners, order).mesh.triangles, mesh.triangles) << first;
                }
    }
}

const Polygon kL = {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}};

TEST(ConcaveFaces, TrianglesStayWithin) {
    ASSERT_DOUBLE_EQ(area_of(kL), 5.0);
    expect_area(kL);
    expect_area({{0, 0}, {2, 0}, {2, 2}, {1, 0.5}, {0, 2}});                                            // a notch
    expect_area({{0, 0}, {4, 1}, {0, 2}, {1, 1}});                                                      // a quad
    expect_area({{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}});                      // a U
    expect_area({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {2, 1}, {1, 1}, {1, 2}, {1, 3}, {0, 3}, {0, 1}});  // corners in line
    expect_area({{0, 0}, {5, 0}, {5, 5}, {0, 5}, {0, 0}, {1, 1}, {1, 4}, {4, 4}, {4, 1}, {1, 1}});      // a hole, joined to the outline by a cut
}

// A spiral of twelve turns and stars of many points at chance radii.
TEST(ConcaveFaces, OfManyCorners) {
    Polygon spiral;
    for (int i = 0; i <= 300; ++i) spiral.push_back((i + 30) * Vec2d(std::cos(0.25 * i), std::sin(0.25 * i)));
    for (int i = 300; i >= 0; --i) spiral.push_back((i + 20) * Vec2d(std::cos(0.25 * i), std::sin(0.25 * i)));
    Random random(3);
    Polygon star;
    for (int i = 0; i < 1000; ++i) star.push_back((0.1 + random.uniform()) * Vec2d(std::cos(2 * M_PI * i / 1000), std::sin(2 * M_PI * i / 1000)));
    for (const Polygon& polygon : {spiral, star}) {
        const TriangleMesh mesh = obj(in_space(polygon)).mesh;
        EXPECT_NEAR(area_of(mesh), area_of(polygon), 1e-9 * area_of(polygon));
        expect_outline(mesh, polygon.size());
    }
}

// Convex quads, bent ones and those whose first corner is the reflex one keep their fan; another is split at its reflex corner.
TEST(ConcaveFaces, FansThatFitAreKept) {
    const Triangles fan = {{0, 1, 2}, {0, 2, 3}};
    EXPECT_EQ(obj({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}}).mesh.triangles, fan);
    EXPECT_EQ(obj({{0, 0, 0}, {2, 0, 1}, {2, 1, 0}, {0, 1, 1}}).mesh.triangles, fan);
    EXPECT_EQ(obj({{1, 1, 0}, {0, 0, 0}, {4, 1, 0}, {0, 2, 0}}).mesh.triangles, fan);
    EXPECT_EQ(obj({{0, 0, 0}, {1, 1e-9, 0}, {2, 0, 0}, {2, 2, 0}}).mesh.triangles, fan);  // in line but for rounding
    EXPECT_EQ(obj({{0, 0, 0}, {4, 1, 0}, {0, 2, 0}, {1, 1, 0}}).mesh.triangles, (Triangles{{1, 2, 3}, {1, 3, 0}}));
}

// Whatever crosses itself or has no area gives as many triangles, the same each time, of its own corners.
TEST(ConcaveFaces, WhatIsNoPolygonIsStillCut) {
    const double far = 1e300, nan = std::numeric_limits<double>::quiet_NaN();
    Random random(7);
    std::vector<std::vector<Vec3d>> polygons = {
        {{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}},                                  // a bow tie
        {{0, 0, 0}, {3, 3, 0}, {3, 0, 0}, {0, 1, 0}},                                  // of unequal halves
        {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}},                       // a place
        {{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {2, 0, 0}},                                  // a line
        {{0, 0, 0}, {1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}},            // there and back
        {{0, 0, 0}, {far, 0, 0}, {far, far, 0}, {far / 2, far / 4, 0}, {0, far, 0}},   // areas beyond numbers
        {{0, 0, 0}, {4e-160, 1e-160, 0}, {0, 2e-160, 0}, {1e-160, 1e-160, 0}},         // and below
        {{-1, -1, 1}, {1, -1, -1}, {1, 1, 1}, {-1, 1, -1}, {0, 0, 5}},
    };
    for (int i = 0; i < 300; ++i) {
        std::vector<Vec3d>& polygon = polygons.emplace_back();
        for (uint64_t n = 4 + random.bits() % 20; n > 0; --n) polygon.push_back(i % 2 ? Vec3d(random.normal(), random.normal(), 0.1 * random.normal()) : Vec3d(double(random.bits() % 3), double(random.bits() % 3), 0));
    }
    Polygon pentagram;
    for (int i = 0; i < 5; ++i) pentagram.emplace_back(std::cos(i * 4 * M_PI / 5), std::sin(i * 4 * M_PI / 5));
    polygons.push_back(in_space(pentagram));
    for (const std::vector<Vec3d>& polygon : polygons) {
        const TriangleMesh mesh = obj(polygon).mesh;
        expect_outline(mesh, polygon.size());
        EXPECT_EQ(ply(polygon).mesh.triangles, mesh.triangles);
    }
    EXPECT_TRUE(obj({{0, 0, 0}, {4, 1, 0}, {nan, 2, 0}, {1, 1, 0}}).mesh.triangles.empty());
}

// A comb, whose teeth all hinder each other, at the limit; beyond it stays a fan, and a note says so.
TEST(ConcaveFaces, LongOnesStayFans) {
    for (const int teeth : {4'999, 5'000}) {
        Polygon comb = {{0, -1}, {double(teeth), -1}};
        for (int i = teeth; i-- > 0;) {
            comb.emplace_back(i + 0.5, 1.0);
            comb.emplace_back(i, 0.0);
        }
        comb.pop_back();  // 2 + 2 * teeth - 1 corners
        const auto [mesh, report] = obj(in_space(comb));
        ASSERT_EQ(mesh.triangles.size(), comb.size() - 2);
        if (comb.size() <= 10'000) {
            EXPECT_NEAR(area_of(mesh), area_of(comb), 1e-9 * area_of(comb));
            EXPECT_TRUE(report.notes.empty());
        } else {
            EXPECT_GT(area_of(mesh), 1.1 * area_of(comb));
            EXPECT_EQ(report.notes, (std::vector<std::string>{"1 concave faces of more than 10000 corners are cut as if they were convex"}));
            EXPECT_EQ(ply(in_space(comb)).report.notes, report.notes);
        }
    }
}

// Faces that wait for their vertices are counted as memory.
TEST(ConcaveFaces, WaitingOnesAreWithinTheMemory) {
    std::string text;
    for (int i = 0; i < 10'000; ++i) text += "f 1 2 3 4\n";
    text += "v 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\n";
    const uint64_t triangles = 20'000 * 12, waiting = 10'000 * 8;
    EXPECT_EQ(test::mesh_of(read_obj, text, {.most_bytes = 3 * (triangles + waiting)}).mesh.triangles.size(), 20'000u);
    EXPECT_FALSE(test::refusal_of(read_obj, test::bytes_of(text), {.most_bytes = triangles + waiting}, ErrorKind::limit).empty());
}

}  // namespace
}  // namespace strata
