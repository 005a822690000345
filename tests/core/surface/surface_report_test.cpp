#include "core/surface/surface_report.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/math/random.h"
#include "tests/support/store_in_memory.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

using std::numbers::pi;
using test::StoreInMemory;

TriangleMesh tetrahedron() {
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}, {0, 0, 4}};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    return mesh;
}

// Rows of latitude between two poles that are one vertex each.
TriangleMesh sphere(const Vec3d& center, double radius, uint32_t n) {
    TriangleMesh mesh;
    mesh.positions.push_back(center + Vec3d(0, 0, radius));
    for (uint32_t i = 1; i < n; ++i)
        for (uint32_t j = 0; j < 2 * n; ++j) {
            const double theta = pi * i / n, phi = pi * j / n;
            mesh.positions.push_back(center + radius * Vec3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)));
        }
    mesh.positions.push_back(center - Vec3d(0, 0, radius));
    const auto last = uint32_t(mesh.positions.size() - 1);
    const auto vertex = [&](uint32_t i, uint32_t j) { return i == 0 ? 0 : i == n ? last : 1 + (i - 1) * 2 * n + j % (2 * n); };
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < 2 * n; ++j) {
            if (i + 1 < n) mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)});
            if (i > 0) mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
        }
    return mesh;
}

// A strip of 2 n triangles whose end is joined to its start, turned over.
TriangleMesh moebius_strip(uint32_t n) {
    TriangleMesh mesh;
    for (uint32_t i = 0; i < n; ++i)
        for (const double side : {-1.0, 1.0}) {
            const double around = 2.0 * pi * i / n, r = 3.0 + side * std::cos(around / 2.0);
            mesh.positions.emplace_back(r * std::cos(around), r * std::sin(around), side * std::sin(around / 2.0));
        }
    const auto vertex = [&](uint32_t i, uint32_t side) { return i == n ? 1 - side : 2 * i + side; };
    for (uint32_t i = 0; i < n; ++i) {
        mesh.triangles.push_back({vertex(i, 0), vertex(i, 1), vertex(i + 1, 1)});
        mesh.triangles.push_back({vertex(i, 0), vertex(i + 1, 1), vertex(i + 1, 0)});
    }
    return mesh;
}

TEST(SurfaceReport, Tetrahedron) {
    TriangleMesh mesh = tetrahedron();
    mesh.positions.emplace_back(1e30, 0, 0);  // no face has it
    const SurfaceReport report = measure_surface(mesh);
    EXPECT_EQ(report.vertices, 5u);
    EXPECT_EQ(report.unused_vertices, 1u);
    EXPECT_EQ(report.triangles, 4u);
    EXPECT_EQ(report.edges, 6u);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_TRUE(report.is_manifold());
    EXPECT_DOUBLE_EQ(report.volume, 2 * 3 * 4 / 6.0);
    // Half of |(2, 0, 0) x (0, 3, 0)| and so on; the last is spanned by (-2, 3, 0) and (-2, 0, 4), with the normal (12, 8, 6).
    EXPECT_DOUBLE_EQ(report.area, 3 + 4 + 6 + 0.5 * std::sqrt(144.0 + 64 + 36));
    EXPECT_EQ(report.bounds.max, Vec3d(2, 3, 4));
    turn_inside_out(mesh);
    EXPECT_DOUBLE_EQ(measure_surface(mesh).volume, -4.0);
    EXPECT_TRUE(measure_surface(mesh).is_closed());
}

// Far from 0 a millimetre of ours is a billionth of a coordinate: nothing of it may cancel.
TEST(SurfaceReport, VolumeIsExactFarFromTheOrigin) {
    const Vec3d far(500'000.0, 5'300'000.0, 300.0);
    const SurfaceReport box = measure_surface(box_mesh(far, {0.5, 0.25, 0.125}));  // all of it is exact in binary
    EXPECT_EQ(box.volume, 0.125);
    EXPECT_EQ(box.area, 2 * (1 * 0.5 + 0.5 * 0.25 + 1 * 0.25));
    EXPECT_EQ(box.euler_characteristic, 2);
}

// Pappus: a ring of n sides around of an m-gon; volumes and areas grow towards those of the torus with the square of n.
TEST(SurfaceReport, Torus) {
    double before = 1.0;
    for (const uint32_t n : {32u, 64u, 128u}) {
        const SurfaceReport report = measure_surface(torus_mesh({1, 2, 3}, 4.0, 1.0, n));
        EXPECT_EQ(report.euler_characteristic, 0);
        EXPECT_EQ(report.components, 1u);
        EXPECT_TRUE(report.is_closed());
        EXPECT_EQ(report.edges, 3u * n * n);
        const double error = std::abs(std::abs(report.volume) / (2 * pi * pi * 4.0) - 1.0);
        EXPECT_LT(error, before / 3.9);
        EXPECT_NEAR(report.area / (4 * pi * pi * 4.0), 1.0, 10.0 / (n * n));
        before = error;
    }
}

TEST(SurfaceReport, OneSphereAndTwo) {
    TriangleMesh mesh = sphere({0, 0, 0}, 2.0, 100);
    const SurfaceReport one = measure_surface(mesh);
    EXPECT_EQ(one.euler_characteristic, 2);
    EXPECT_TRUE(one.is_closed());
    EXPECT_NEAR(one.volume / (4.0 / 3.0 * pi * 8.0), 1.0, 1e-3);
    append(mesh, sphere({10, 0, 0}, 1.0, 50));
    const SurfaceReport two = measure_surface(mesh);
    EXPECT_EQ(two.components, 2u);
    EXPECT_EQ(two.euler_characteristic, 4);
    EXPECT_TRUE(two.is_closed());
    EXPECT_NEAR(two.volume / (4.0 / 3.0 * pi * 9.0), 1.0, 1e-3);
}

// 30 x 20 vertices: 29 x 19 cells, and all that is around them has one face.
TEST(SurfaceReport, OpenDisc) {
    const SurfaceReport report = measure_surface(grid_mesh(30, 20, false, false, [](uint32_t i, uint32_t j) { return Vec3d(i, j, 7.0); }));
    EXPECT_EQ(report.boundary_edges, 2u * (29 + 19));
    EXPECT_EQ(report.euler_characteristic, 1);
    EXPECT_EQ(report.components, 1u);
    EXPECT_DOUBLE_EQ(report.area, 29.0 * 19.0);
    EXPECT_FALSE(report.is_closed());
}

// One side, one border of 2 n edges, and a seam of one edge where faces turn opposite ways.
TEST(SurfaceReport, MoebiusStrip) {
    const SurfaceReport report = measure_surface(moebius_strip(24));
    EXPECT_EQ(report.boundary_edges, 48u);
    EXPECT_EQ(report.flipped_edges, 1u);
    EXPECT_EQ(report.nonmanifold_edges, 0u);
    EXPECT_EQ(report.euler_characteristic, 0);
    EXPECT_EQ(report.components, 1u);
}

// Three leaves of a book: their back is one edge. Two tetrahedra with one vertex in common are one part.
TEST(SurfaceReport, WhatIsNoManifold) {
    TriangleMesh book;
    book.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
    book.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {0, 0, 1}};
    const SurfaceReport leaves = measure_surface(book);
    EXPECT_FALSE(leaves.is_closed());
    EXPECT_EQ(leaves.nonmanifold_edges, 1u);
    EXPECT_EQ(leaves.boundary_edges, 6u);
    EXPECT_EQ(leaves.degenerate_faces, 1u);
    EXPECT_EQ(leaves.euler_characteristic, 5 - 7 + 3);
    TriangleMesh pair = tetrahedron();
    for (const Vec3d& p : {Vec3d(-1, 0, 0), Vec3d(0, -1, 0), Vec3d(0, 0, -1)}) pair.positions.push_back(p);
    for (const auto& [a, b, c] : {std::array<uint32_t, 3>{0, 4, 5}, {0, 5, 6}, {0, 6, 4}, {4, 6, 5}}) pair.triangles.push_back({a, b, c});
    const SurfaceReport joined = measure_surface(pair);
    EXPECT_EQ(joined.components, 1u);
    EXPECT_EQ(joined.euler_characteristic, 3);
    EXPECT_TRUE(joined.is_closed());
    // Two boxes that touch along an edge: four faces have it, as many one way as the other.
    TriangleMesh boxes = box_mesh({0.5, 0.5, 0.5}, {0.5, 0.5, 0.5});
    append(boxes, box_mesh({1.5, 1.5, 0.5}, {0.5, 0.5, 0.5}));
    for (auto& triangle : boxes.triangles)
        for (uint32_t& vertex : triangle)
            vertex = uint32_t(std::find(boxes.positions.begin(), boxes.positions.end(), boxes.positions[vertex]) - boxes.positions.begin());
    const SurfaceReport touching = measure_surface(boxes);
    EXPECT_EQ(touching.nonmanifold_edges, 1u);
    EXPECT_TRUE(touching.is_closed());
    EXPECT_FALSE(touching.is_manifold());
    EXPECT_DOUBLE_EQ(touching.volume, 2.0);
    EXPECT_EQ(touching.unused_vertices, 2u);
}

// A closed surface stays closed when faces at random corners are cut; what holds of it does, too.
TEST(SurfaceReport, RandomClosedMeshes) {
    Random random(20);
    for (int round = 0; round < 50; ++round) {
        TriangleMesh mesh = round % 2 ? torus_mesh({0, 0, 0}, 3, 1, 5) : tetrahedron();
        for (int cut = 0; cut < 40; ++cut) {  // a new vertex within a face makes three of it
            const size_t at = size_t(random.uniform() * double(mesh.triangles.size()));
            const auto [a, b, c] = mesh.triangles[at];
            const auto middle = uint32_t(mesh.positions.size());
            mesh.positions.push_back(0.2 * mesh.positions[a] + 0.3 * mesh.positions[b] + 0.5 * mesh.positions[c]);
            mesh.triangles[at] = {a, b, middle};
            mesh.triangles.push_back({b, c, middle});
            mesh.triangles.push_back({c, a, middle});
        }
        const SurfaceReport before = measure_surface(round % 2 ? torus_mesh({0, 0, 0}, 3, 1, 5) : tetrahedron()), after = measure_surface(mesh);
        EXPECT_EQ(after.euler_characteristic, before.euler_characteristic);
        EXPECT_TRUE(after.is_closed());
        EXPECT_NEAR(after.volume, before.volume, 1e-12 * std::abs(before.volume));
        EXPECT_NEAR(after.area, before.area, 1e-12 * before.area);
        mesh.triangles.erase(mesh.triangles.begin() + 7);
        EXPECT_EQ(measure_surface(mesh).boundary_edges, 3u);
    }
}

// A tall tube in pieces of one ring each, far more than pages and runs: what is said of it is as if it came at once.
TEST(MeasuredSurface, ASurfaceInPiecesIsMeasuredAsOne) {
    constexpr uint32_t kAround = 512, kRings = 1200;
    StoreInMemory scratch;
    MeasuredSurface measured(nullptr, &scratch, 0);
    for (uint32_t ring = 0; ring < kRings; ++ring) {
        std::vector<Vec3f> positions;
        std::vector<std::array<uint32_t, 4>> quads;
        for (uint32_t i = 0; i < kAround; ++i) {
            positions.emplace_back(float(std::cos(2 * pi * i / kAround)), float(std::sin(2 * pi * i / kAround)), 0.0f);
            const auto at = [&](uint32_t row, uint32_t column) { return row * kAround + column % kAround; };
            if (ring > 0) quads.push_back({at(ring - 1, i), at(ring - 1, i + 1), at(ring, i + 1), at(ring, i)});
        }
        measured.add({.origin = Vec3d(1000, 0, ring), .positions = positions, .quads = quads});
    }
    // The ends are closed by fans at last, whose corners were first and last.
    std::vector<std::array<uint32_t, 3>> fans;
    const uint32_t bottom = kAround * kRings, top = bottom + 1;
    for (uint32_t i = 0; i < kAround; ++i) {
        fans.push_back({bottom, (i + 1) % kAround, i});
        fans.push_back({top, kAround * (kRings - 1) + i, kAround * (kRings - 1) + (i + 1) % kAround});
    }
    EXPECT_EQ(measured.report().boundary_edges, 2u * kAround);
    const std::vector<Vec3f> ends = {Vec3f(0, 0, 0), Vec3f(0, 0, float(kRings - 1))};
    measured.add({.origin = Vec3d(1000, 0, 0), .positions = ends, .triangles = fans});

    const SurfaceReport report = measured.report();
    EXPECT_GT(scratch.size(), 0u);
    EXPECT_EQ(report.vertices, uint64_t{kAround} * kRings + 2);
    EXPECT_EQ(report.quads, uint64_t{kAround} * (kRings - 1));
    EXPECT_EQ(report.triangles, 2u * kAround);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_TRUE(report.is_closed());
    const double section = 0.5 * kAround * std::sin(2 * pi / kAround), around = 2 * kAround * std::sin(pi / kAround);
    EXPECT_NEAR(report.volume, section * (kRings - 1), 1e-5 * kRings);  // corners are rounded to float, 6e-8
    EXPECT_NEAR(report.area, around * (kRings - 1) + 2 * section, 1e-5 * kRings);
    EXPECT_EQ(measured.positions()[5 * kAround], Vec3d(1001, 0, 5)) << "from a page that was put away";
}

// A closed surface, then one with edges of one to nine faces as well, whose faces come in any order: what is put away in a little memory is
// joined to what it is in a large one. Of the closed one no edge has a third face, so that those with two may be forgotten.
TEST(MeasuredSurface, FacesInAnyOrderThroughLittleMemory) {
    Random random(7);
    for (const bool is_closed : {true, false}) {
        TriangleMesh mesh = torus_mesh({100, 0, 0}, 4, 1, 100);
        if (!is_closed)
            for (int n = 0; n < 20'000; ++n) {  // many at few vertices: edges of many faces
                const double few = n % 2 ? 12.0 : 8'000.0;
                const auto vertex = [&] { return uint32_t(random.uniform(0.0, few)); };
                mesh.triangles.push_back({vertex(), vertex(), vertex()});
            }
        for (size_t n = mesh.triangles.size(); n > 1; --n) std::swap(mesh.triangles[n - 1], mesh.triangles[size_t(random.uniform() * double(n))]);
        for (Vec3d& p : mesh.positions) p = p.cast<float>().cast<double>();
        const SurfaceReport whole = measure_surface(mesh);
        EXPECT_EQ(whole.is_closed(), is_closed);
        EXPECT_EQ(whole.nonmanifold_edges > 50, !is_closed);
        for (const bool keep_edges : {false, true}) {
            if (!keep_edges && !is_closed) continue;  // it may miss a third face
            StoreInMemory scratch;
            MeasuredSurface measured(nullptr, &scratch, 60'000, keep_edges);
            std::vector<Vec3f> positions;
            for (const Vec3d& p : mesh.positions) positions.push_back(p.cast<float>());
            for (size_t first = 0; first < positions.size(); first += 1000)
                measured.add({.positions = std::span(positions).subspan(first, std::min<size_t>(1000, positions.size() - first))});
            for (size_t first = 0; first < mesh.triangles.size(); first += 1000) {
                measured.add({.triangles = std::span(mesh.triangles).subspan(first, std::min<size_t>(1000, mesh.triangles.size() - first))});
                if (first == 9'000) EXPECT_EQ(measured.report().triangles, 10'000u);  // it goes on after a report
            }
            EXPECT_GT(scratch.size(), 100'000u);
            const SurfaceReport report = measured.report();
            EXPECT_EQ(report.vertices, whole.vertices);
            EXPECT_EQ(report.unused_vertices, whole.unused_vertices);
            EXPECT_EQ(report.triangles, whole.triangles);
            EXPECT_EQ(report.degenerate_faces, whole.degenerate_faces);
            EXPECT_EQ(report.components, whole.components);
            EXPECT_EQ(report.edges, whole.edges);
            EXPECT_EQ(report.boundary_edges, whole.boundary_edges);
            EXPECT_EQ(report.nonmanifold_edges, whole.nonmanifold_edges);
            EXPECT_EQ(report.flipped_edges, whole.flipped_edges);
            EXPECT_EQ(report.open_edges, whole.open_edges);
            EXPECT_EQ(report.euler_characteristic, whole.euler_characteristic);
            EXPECT_EQ(report.area, whole.area);
            EXPECT_EQ(report.volume, whole.volume);
        }
    }
}

// Roofs of two triangles, each with a gutter of two more that comes long after: the ridge has four faces then, as an edge along which two cubes
// touch.
TEST(MeasuredSurface, FacesThatComeLateToAnEdgeAreSeen) {
    StoreInMemory scratch;
    MeasuredSurface measured(nullptr, &scratch, 300'000, true);
    constexpr uint32_t kRoofs = 20'000;
    for (uint32_t roof = 0; roof < kRoofs; ++roof) {
        const float x = float(4 * roof);
        const std::vector<Vec3f> corners = {{x, 0, 0}, {x, 0, 1}, {x + 1, 0, 0}, {x, 1, 0}};
        const uint32_t a = 4 * roof;
        const std::vector<std::array<uint32_t, 3>> faces = {{a, a + 1, a + 2}, {a + 1, a, a + 3}};
        measured.add({.positions = corners, .triangles = faces});
    }
    EXPECT_EQ(measured.report().nonmanifold_edges, 0u);
    for (uint32_t roof = 0; roof < kRoofs; ++roof) {
        const float x = float(4 * roof);
        const std::vector<Vec3f> corners = {{x - 1, 0, 0}, {x, -1, 0}};
        const uint32_t a = 4 * roof, b = 4 * kRoofs + 2 * roof;
        const std::vector<std::array<uint32_t, 3>> faces = {{a, a + 1, b}, {a + 1, a, b + 1}};
        measured.add({.positions = corners, .triangles = faces});
    }
    const SurfaceReport report = measured.report();
    EXPECT_EQ(report.nonmanifold_edges, kRoofs);
    EXPECT_EQ(report.boundary_edges, 8u * kRoofs);
    EXPECT_EQ(report.edges, 9u * kRoofs);
    EXPECT_EQ(report.components, kRoofs);
    EXPECT_EQ(report.euler_characteristic, int64_t{kRoofs});  // 6 - 9 + 4 each
}

// A third face at an edge is seen while the edge is not forgotten.
TEST(MeasuredSurface, AThirdFaceOfTheNextPieceIsSeen) {
    MeasuredSurface measured(nullptr, nullptr, 0);
    const std::vector<Vec3f> corners = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, more = {{-1, 0, 0}};
    const std::vector<std::array<uint32_t, 3>> two = {{0, 1, 2}, {1, 0, 3}}, third = {{0, 1, 4}};
    measured.add({.positions = corners, .triangles = two});
    measured.add({.positions = more, .triangles = third});
    EXPECT_EQ(measured.report().nonmanifold_edges, 1u);
}

}  // namespace
}  // namespace strata
