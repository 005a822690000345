#include "core/surface/point_paint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "core/error.h"
#include "core/surface/contour.h"
#include "core/surface/point_balls.h"
#include "core/surface/point_surface.h"
#include "tests/support/scanned_points.h"
#include "tests/support/store_in_memory.h"

namespace strata {
namespace {

// Keeps what pieces say of vertices.
struct Painted : SurfaceSink {
    std::vector<Vec3d> positions;
    std::vector<std::array<uint8_t, 4>> colors;
    std::vector<std::string> names;
    std::vector<std::vector<float>> scalars;

    void add(const SurfacePiece& piece) override {
        for (const Vec3f& p : piece.positions) positions.push_back(piece.origin + p.cast<double>());
        colors.insert(colors.end(), piece.colors.begin(), piece.colors.end());
        names.clear();
        scalars.resize(piece.scalars.size());
        for (size_t s = 0; s < piece.scalars.size(); ++s) {
            names.emplace_back(piece.scalars[s].name);
            scalars[s].insert(scalars[s].end(), piece.scalars[s].values.begin(), piece.scalars[s].values.end());
        }
    }
};

PointForm form_of() {
    PointForm form;
    form.colors = true;
    form.scalars = {{.name = "number", .attribute = 1}, {.name = "kind", .attribute = 2, .is_class = true}};
    return form;
}

// A sphere whose color and number rise with height, and whose kind changes at the equator.
std::vector<ScannedPoint> colored_sphere(int top) {
    std::vector<ScannedPoint> points = sphere_points(20'000, 1.0);
    for (ScannedPoint& p : points) {
        const double height = 0.5 + 0.5 * p.place.z();
        p.color = {uint16_t(std::lround(height * top)), uint16_t(top), 0};
        p.number = float(height * 1000.0);
        p.kind = p.place.z() > 0.0 ? 6 : 2;
    }
    return points;
}

template <typename Field>
Painted paint(Field& field, int color_bits, double radius, int threads) {
    Painted painted;
    PointPaint sink({.grid = field.grid(), .form = form_of(), .color_bits = color_bits, .radius = radius, .threads = threads}, field.window(), painted);
    ContourSettings contour;
    contour.inside = ContourInside::below;
    contour.open_at_nan = true;
    contour.threads = threads;
    contour_bricks(field, contour, sink);
    EXPECT_EQ(sink.unknown(), 0u);
    return painted;
}

void check(const Painted& painted, double radius, double reach) {
    ASSERT_GT(painted.positions.size(), 1000u);
    ASSERT_EQ(painted.colors.size(), painted.positions.size());
    ASSERT_EQ(painted.names, (std::vector<std::string>{"number", "kind"}));
    for (size_t v = 0; v < painted.positions.size(); ++v) {
        // The mean of the height over a cap around the place is less than that by a square of its size.
        const double height = 0.5 + 0.5 * painted.positions[v].z() / radius;
        EXPECT_NEAR(painted.colors[v][0], 255.0 * height, 255.0 * reach * reach + 2.0);
        EXPECT_EQ(painted.colors[v][1], 255);
        EXPECT_EQ(painted.colors[v][2], 0);
        EXPECT_EQ(painted.colors[v][3], 255);
        EXPECT_NEAR(painted.scalars[0][v], 1000.0 * height, 1000.0 * reach * reach + 8.0);
        const float kind = painted.scalars[1][v];
        if (std::abs(painted.positions[v].z()) > 0.3 * reach) EXPECT_EQ(kind, painted.positions[v].z() > 0.0 ? 6.0f : 2.0f);
        else EXPECT_TRUE(kind == 6.0f || kind == 2.0f);  // never what is between
    }
}

TEST(PointPaint, OfASmoothSurface) {
    for (const auto& [top, bits] : {std::pair(255, 8), std::pair(65535, 16)}) {
        const ScannedPoints points(colored_sphere(top));
        const auto make = [&](int threads) {
            PointSurface field(points, points.info().bounds, {.spacing = 0.03, .radius = 0.09, .form = form_of(), .keep_points = true, .threads = threads});
            return paint(field, bits, 0.09, threads);
        };
        const Painted one = make(1), several = make(4);
        check(one, 1.0, 0.09);
        EXPECT_EQ(one.colors, several.colors);
        EXPECT_EQ(one.scalars, several.scalars);
        EXPECT_EQ(one.positions, several.positions);
    }
}

TEST(PointPaint, OfBalls) {
    std::vector<ScannedPoint> cloud = colored_sphere(255);
    const ScannedPoints points(cloud);
    PointBalls field(points, points.info().bounds, {.spacing = 0.04, .radius = 0.1, .threads = 2, .form = form_of(), .keep_points = true});
    Painted painted = paint(field, 8, 0.125, 2);
    // The outer side; the inner one likewise, by points on another radius.
    std::vector<size_t> outer;
    Painted out;
    out.names = painted.names;
    out.scalars.resize(2);
    for (size_t v = 0; v < painted.positions.size(); ++v) {
        if (painted.positions[v].norm() < 1.0) continue;
        out.positions.push_back(painted.positions[v].normalized());
        out.colors.push_back(painted.colors[v]);
        for (size_t s = 0; s < 2; ++s) out.scalars[s].push_back(painted.scalars[s][v]);
    }
    check(out, 1.0, 0.125);
}

// Points that do not know a number leave it to others; where none does, it is NaN. Where no point is near, there is no color.
TEST(PointPaint, WhatIsUnknown) {
    std::vector<ScannedPoint> cloud = colored_sphere(255);
    for (size_t i = 0; i < cloud.size(); ++i) cloud[i].number = cloud[i].place.x() > 0.0 ? std::nanf("") : 7.0f;
    const ScannedPoints points(cloud);
    PointSurface field(points, points.info().bounds, {.spacing = 0.03, .radius = 0.09, .form = form_of(), .keep_points = true, .threads = 2});
    const Painted painted = paint(field, 8, 0.09, 2);
    for (size_t v = 0; v < painted.positions.size(); ++v) {
        if (painted.positions[v].x() > 0.09) EXPECT_TRUE(std::isnan(painted.scalars[0][v]));
        if (painted.positions[v].x() < 0.0) EXPECT_EQ(painted.scalars[0][v], 7.0f);
    }
    PointWindow none;
    Painted nothing;
    PointPaint sink({.grid = field.grid(), .form = form_of(), .radius = 0.09, .threads = 1}, none, nothing);
    const std::vector<Vec3f> places = {{1.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}};
    sink.add({.positions = places});
    EXPECT_EQ(sink.unknown(), 2u);
    EXPECT_EQ(nothing.colors[0], (std::array<uint8_t, 4>{128, 128, 128, 255}));
    EXPECT_TRUE(std::isnan(nothing.scalars[1][1]));
}

// A piece is handed on in parts, its faces with the last.
TEST(PointPaint, LargePiecesComeInParts) {
    const ScannedPoints points(colored_sphere(255));
    PointSurface field(points, points.info().bounds, {.spacing = 0.03, .radius = 0.09, .form = form_of(), .keep_points = true, .threads = 2});
    struct Parts : SurfaceSink {
        std::vector<size_t> vertices, triangles;
        std::vector<Vec3f> positions, normals;
        std::vector<float> numbers;
        void add(const SurfacePiece& piece) override {
            vertices.push_back(piece.positions.size());
            triangles.push_back(piece.triangles.size());
            positions.insert(positions.end(), piece.positions.begin(), piece.positions.end());
            normals.insert(normals.end(), piece.normals.begin(), piece.normals.end());
            ASSERT_EQ(piece.scalars.size(), 3u);
            EXPECT_EQ(piece.colors.size(), piece.positions.size());
            for (const VertexScalars& scalar : piece.scalars) EXPECT_EQ(scalar.values.size(), piece.positions.size());
            numbers.insert(numbers.end(), piece.scalars[0].values.begin(), piece.scalars[0].values.end());
        }
    } parts;
    PointPaint sink({.grid = field.grid(), .form = form_of(), .radius = 0.09, .threads = 2}, field.window(), parts);
    std::vector<Vec3f> places(40'000), normals(40'000);
    std::vector<float> numbers(40'000);
    for (size_t v = 0; v < places.size(); ++v) places[v] = Vec3f(float(v), 0.0f, 0.0f), normals[v] = Vec3f(0.0f, float(v), 0.0f), numbers[v] = float(v);
    const std::vector<std::array<uint32_t, 3>> triangles = {{0, 1, 39'999}, {2, 20'000, 3}};
    const std::vector<VertexScalars> own = {{"own", numbers}};
    sink.add({.positions = places, .normals = normals, .scalars = own, .triangles = triangles});
    EXPECT_EQ(parts.vertices, (std::vector<size_t>{16'384, 16'384, 7'232}));
    EXPECT_EQ(parts.triangles, (std::vector<size_t>{0, 0, 2}));
    EXPECT_EQ(parts.positions, places);
    EXPECT_EQ(parts.normals, normals);
    EXPECT_EQ(parts.numbers, numbers);
}

// The least memory that a field does with is the same, whoever makes pieces of it at what time: all that it counts it knows from the points.
template <typename Field, typename Settings>
void expect_one_limit(const ScannedPoints& points, Settings settings) {
    settings.form = form_of();
    settings.keep_points = true;
    settings.threads = 2;
    const auto fits = [&](uint64_t memory, int threads, bool painted) {
        test::StoreInMemory store;
        settings.memory_bytes = memory;
        settings.scratch = &store;
        try {
            Field field(points, points.info().bounds, settings);
            if (painted) {
                paint(field, 8, settings.radius * 1.25, threads);
            } else {
                FieldBrickLayer layer;
                while (field.next_layer(layer)) {}
            }
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::limit);
            return false;
        }
        return true;
    };
    uint64_t too_little = 1000, enough = 100'000'000;
    ASSERT_TRUE(fits(enough, 1, false));
    while (enough - too_little > 1) {
        const uint64_t middle = (too_little + enough) / 2;
        (fits(middle, 1, false) ? enough : too_little) = middle;
    }
    for (const int threads : {1, 3, 3}) {
        EXPECT_TRUE(fits(enough, threads, true));
        EXPECT_FALSE(fits(too_little, threads, true));
    }
}

TEST(PointPaint, TheLimitOfMemoryIsOne) {
    const ScannedPoints points(colored_sphere(255));
    expect_one_limit<PointSurface, PointSurfaceSettings>(points, {.spacing = 0.04, .radius = 0.1});
    expect_one_limit<PointBalls, PointBallsSettings>(points, {.spacing = 0.04, .radius = 0.1});
}

}  // namespace
}  // namespace strata
