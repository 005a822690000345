#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <tuple>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "tests/support/surface_collector.h"
#include "tests/support/surface_shape.h"

namespace strata {
namespace {

using Place = std::array<int32_t, 3>;

int32_t brick_of(int32_t c) { return c & ~(kFieldBrickSide - 1); }

// Bricks of a function; those that `wanted` does not name are constant.
class FunctionBricks : public FieldBrickSource {
public:
    FunctionBricks(GridPlacement placement, Place least, Place end, std::function<float(const Place&)> value,
                   std::function<bool(const Place&)> wanted, std::function<float(const Place&)> absent)
        : placement_(placement),
          least_(least),
          end_(end),
          value_(std::move(value)),
          wanted_(std::move(wanted)),
          absent_(std::move(absent)),
          k_(least[2]) {}

    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return absent_(least_); }
    float absent_value(const Place& corner) const override { return absent_(corner); }
    bool next_layer(FieldBrickLayer& out) override {
        for (; k_ < end_[2]; k_ += kFieldBrickSide) {
            out = {.k = k_, .corners = {}, .values = {}};
            for (int32_t j = least_[1]; j < end_[1]; j += kFieldBrickSide)
                for (int32_t i = least_[0]; i < end_[0]; i += kFieldBrickSide) {
                    if (!wanted_({i, j, k_})) continue;
                    out.corners.push_back({i, j});
                    for (int32_t z = 0; z < 8; ++z)
                        for (int32_t y = 0; y < 8; ++y)
                            for (int32_t x = 0; x < 8; ++x) out.values.push_back(value_({i + x, j + y, k_ + z}));
                }
            if (out.corners.empty()) continue;
            k_ += kFieldBrickSide;
            return true;
        }
        return false;
    }

private:
    GridPlacement placement_;
    Place least_, end_;
    std::function<float(const Place&)> value_;
    std::function<bool(const Place&)> wanted_;
    std::function<float(const Place&)> absent_;
    int32_t k_;
};

GridPlacement leaning_placement(bool mirrored) {
    GridPlacement placement{.origin = {1000.0, -20.0, 7.0}, .axes = Mat3d::Identity()};
    placement.axes.col(0) = Vec3d(0.8, 0.1, 0.0);
    placement.axes.col(1) = Vec3d(-0.2, 1.3, 0.3);
    placement.axes.col(2) = Vec3d(0.1, 0.0, mirrored ? -0.5 : 0.5);
    return placement;
}

// A narrow band of distances to a sphere: bricks that hold a sample of it, constants of half the band's width elsewhere.
FunctionBricks sphere_band(const GridPlacement& placement, const Vec3d& center, double radius, double half_width, const Place& least,
                           const Place& end) {
    const auto distance = [=](const Place& p) { return (placement.world_from_index(Vec3d(p[0], p[1], p[2])) - center).norm() - radius; };
    const auto wanted = [=](const Place& corner) {
        for (int32_t z = 0; z < 8; ++z)
            for (int32_t y = 0; y < 8; ++y)
                for (int32_t x = 0; x < 8; ++x)
                    if (std::abs(distance({corner[0] + x, corner[1] + y, corner[2] + z})) < half_width) return true;
        return false;
    };
    return FunctionBricks(
        placement, least, end, [=](const Place& p) { return float(std::clamp(distance(p), -half_width, half_width)); }, wanted,
        [=](const Place& corner) { return float(distance(corner) < 0.0 ? -half_width : half_width); });
}

// The same surface as that of the whole grid: the same vertices, the same triangles by their places, in another order.
std::map<std::array<float, 3>, int> places_of(std::span<const Vec3f> positions) {
    std::map<std::array<float, 3>, int> places;
    for (const Vec3f& p : positions) ++places[{p.x(), p.y(), p.z()}];
    return places;
}
std::map<std::array<std::array<float, 3>, 3>, int> triangles_of(std::span<const Vec3f> positions,
                                                                std::span<const std::array<uint32_t, 3>> triangles) {
    std::map<std::array<std::array<float, 3>, 3>, int> found;
    for (const auto& t : triangles) {
        std::array<std::array<float, 3>, 3> corners;
        for (size_t n = 0; n < 3; ++n) corners[n] = {positions[t[n]].x(), positions[t[n]].y(), positions[t[n]].z()};
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
        ++found[corners];
    }
    return found;
}

TEST(ContourBricks, SphereInANarrowBand) {
    for (const bool mirrored : {false, true}) {
        const GridPlacement placement = leaning_placement(mirrored);
        const Vec3d center = placement.world_from_index({3.0, -5.0, 11.0});
        FunctionBricks source = sphere_band(placement, center, 9.0, 2.5, {-64, -64, -64}, {64, 64, 64});
        SurfaceCollector sink;
        const ContourReport report =
            contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below, .normals = true, .threads = 2}, sink);
        const SurfaceShape shape = shape_of(sink.positions, sink.triangles);
        EXPECT_EQ(shape.fault, "");
        EXPECT_EQ(shape.boundary_edges, 0u);
        EXPECT_EQ(shape.euler, 2);
        EXPECT_EQ(shape.components, 1u);
        EXPECT_NEAR(shape.volume / (4.0 / 3.0 * 3.14159265 * 729.0), 1.0, 0.02);
        EXPECT_EQ(report.vertices, sink.positions.size());
        EXPECT_EQ(report.triangles, sink.triangles.size());
        EXPECT_GT(sink.pieces, 3);
        for (size_t v = 0; v < sink.positions.size(); ++v) {
            const Vec3d ray = sink.origin + sink.positions[v].cast<double>() - center;
            ASSERT_NEAR(ray.norm(), 9.0, 1.4 * 1.4 / (8.0 * 7.6) + 1e-4);
            ASSERT_GT(ray.normalized().dot(sink.normals[v].cast<double>()), 0.99);
        }
    }
}

// Random samples in a block of bricks, the rest outside: what the whole grid's contour is, closed by a rim of outside samples.
TEST(ContourBricks, SameSurfaceAsTheWholeGrid) {
    for (const uint64_t seed : {1, 2}) {
        const auto value = [=](const Place& p) {
            Random random(mix_bits(seed) ^ uint64_t(uint32_t(p[0])) ^ uint64_t(uint32_t(p[1])) << 20 ^ uint64_t(uint32_t(p[2])) << 40);
            return float(random.uniform(-1.0, 1.0));
        };
        const auto wanted = [=](const Place& corner) {
            return mix_bits(seed + uint64_t(uint32_t(corner[0]) * 31u + uint32_t(corner[1]) * 1009u + uint32_t(corner[2]) * 70001u)) % 3 !=
                   0;
        };
        const auto absent = [](const Place&) { return -0.75f; };
        const Place least = {-16, -8, -24}, end = {24, 24, 16};
        ScalarGrid grid{.placement = {.origin = Vec3d(least[0] - 1, least[1] - 1, least[2] - 1)}, .size = {}, .values = {}};
        for (size_t axis = 0; axis < 3; ++axis) grid.size[axis] = uint32_t(end[axis] - least[axis] + 2);
        for (int32_t k = least[2] - 1; k <= end[2]; ++k)
            for (int32_t j = least[1] - 1; j <= end[1]; ++j)
                for (int32_t i = least[0] - 1; i <= end[0]; ++i) {
                    const bool rim = i < least[0] || j < least[1] || k < least[2] || i >= end[0] || j >= end[1] || k >= end[2];
                    grid.values.push_back(rim || !wanted({brick_of(i), brick_of(j), brick_of(k)}) ? -0.75f : value({i, j, k}));
                }
        ContourSettings settings{.isovalues = {0.25, -0.5}, .normals = true};
        FunctionBricks source({}, least, end, value, wanted, absent);
        SurfaceCollector sink;
        const ContourReport report = contour_bricks(source, settings, sink);
        ContourMesh mesh;
        const ContourReport whole = contour_grid(grid.placement, grid.size, grid.values, settings, mesh);
        EXPECT_EQ(report.triangles, whole.triangles);
        EXPECT_EQ(report.vertices, whole.vertices);
        EXPECT_EQ(report.ambiguous_cells, whole.ambiguous_cells);
        EXPECT_EQ(report.tunnel_cells, whole.tunnel_cells);
        const SurfaceShape shape = shape_of(sink.positions, sink.triangles);
        EXPECT_EQ(shape.fault, "");
        EXPECT_EQ(shape.boundary_edges, 0u);
        EXPECT_EQ(shape.euler,
                  shape_of({mesh.positions.data(), mesh.positions.size()}, {mesh.triangles.data(), mesh.triangles.size()}).euler);

        // The same bytes on any number of threads.
        for (int threads = 2; threads <= 4; ++threads) {
            settings.threads = threads;
            FunctionBricks again({}, least, end, value, wanted, absent);
            SurfaceCollector other;
            contour_bricks(again, settings, other);
            EXPECT_TRUE(other.positions == sink.positions && other.triangles == sink.triangles && other.normals == sink.normals);
            // Without normals a layer is read while the one before is on its way.
            settings.normals = false;
            FunctionBricks ahead({}, least, end, value, wanted, absent);
            SurfaceCollector bare;
            contour_bricks(ahead, settings, bare);
            EXPECT_TRUE(bare.positions == sink.positions && bare.triangles == sink.triangles && bare.normals.empty());
            settings.normals = true;
        }
        // In memory it is the same.
        FunctionBricks kept({}, least, end, value, wanted, absent);
        ContourMesh in_memory;
        EXPECT_EQ(contour_bricks(kept, settings, in_memory).triangles, report.triangles);
        EXPECT_EQ(in_memory.origin, sink.origin);
        EXPECT_TRUE(std::equal(in_memory.positions.begin(), in_memory.positions.end(), sink.positions.begin(), sink.positions.end()));
        EXPECT_TRUE(std::equal(in_memory.normals.begin(), in_memory.normals.end(), sink.normals.begin(), sink.normals.end()));
        EXPECT_TRUE(std::equal(in_memory.triangles.begin(), in_memory.triangles.end(), sink.triangles.begin(), sink.triangles.end()));
        // Along each axis positions differ by whole cells, in floats of unequal origins: compare rounded ones.
        const Vec3d shift = sink.origin - mesh.origin;
        const auto rounded = [](std::span<const Vec3f> positions, const Vec3d& by) {
            std::vector<Vec3f> out;
            for (const Vec3f& p : positions) {
                const Vec3d q = ((p.cast<double>() + by) * 4096.0).array().round();
                out.push_back(q.cast<float>());
            }
            return out;
        };
        const std::vector<Vec3f> ours = rounded(sink.positions, shift),
                                 theirs = rounded({mesh.positions.data(), mesh.positions.size()}, Vec3d::Zero());
        size_t unlike = 0, triangles_unlike = 0;
        const auto there = places_of(theirs);
        for (const auto& [place, count] : places_of(ours)) unlike += there.count(place) == 0;
        EXPECT_LT(unlike, ours.size() / 50);  // rounded apart
        const auto triangles_there = triangles_of(theirs, {mesh.triangles.data(), mesh.triangles.size()});
        for (const auto& [triangle, count] : triangles_of(ours, sink.triangles)) triangles_unlike += triangles_there.count(triangle) == 0;
        EXPECT_LT(triangles_unlike, sink.triangles.size() / 20);
    }
}

// Random samples in bricks, of which some are NaN: where the surface may be open, it is that of the field with numbers there, without the
// triangles of cells that have a NaN corner and without the vertices that no other has.
TEST(ContourBricks, IsOpenAtNaN) {
    const Place least = {-16, -8, -24}, end = {24, 24, 16};
    for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
        const auto random_at = [=](const Place& p, uint64_t salt) {
            return Random(mix_bits(seed + 100 * salt) ^ uint64_t(uint32_t(p[0])) ^ uint64_t(uint32_t(p[1])) << 20 ^ uint64_t(uint32_t(p[2])) << 40).uniform(0.0, 1.0);
        };
        const bool is_smooth = seed % 2 == 0;
        const auto number = [=](const Place& p) {
            return float(is_smooth ? std::sin(0.4 * p[0]) + std::sin(0.3 * p[1]) + std::sin(0.5 * p[2]) : random_at(p, 0) * 2.0 - 1.0);
        };
        const auto given = [=](const Place& corner) { return corner == least || random_at(corner, 1) > 0.3; };
        const auto is_kept = [=](const Place& corner) { return corner == least || seed < 5 || random_at(corner, 2) > 0.3; };
        const bool rest_is_nan = seed >= 3;  // where no brick is given
        const double share = seed % 2 == 0 ? 0.002 : 0.03;
        const auto is_nan = [=](const Place& p) {
            const Place corner = {brick_of(p[0]), brick_of(p[1]), brick_of(p[2])};
            bool within = true;
            for (size_t axis = 0; axis < 3; ++axis) within = within && p[axis] >= least[axis] && p[axis] < end[axis];
            return within && given(corner) && is_kept(corner) ? random_at(p, 3) < share : rest_is_nan;
        };
        const float nan = std::numeric_limits<float>::quiet_NaN(), rest = -0.75f;
        FunctionBricks numbers({}, least, end, number, given, [=](const Place&) { return rest; });
        const auto holed = [&] {
            return FunctionBricks({}, least, end, [=](const Place& p) { return is_nan(p) ? nan : number(p); },
                                  [=](const Place& corner) { return given(corner) && is_kept(corner); },
                                  [=](const Place&) { return rest_is_nan ? nan : rest; });
        };
        for (const ContourInside inside : {ContourInside::above, ContourInside::below}) {
            ContourSettings settings{.isovalues = {0.25, -0.5}, .inside = inside, .colors = {{1, 2, 3, 4}, {5, 6, 7, 8}}};
            SurfaceCollector whole;
            FunctionBricks all = numbers;
            contour_bricks(all, settings, whole);

            std::vector<char> is_used(whole.positions.size());
            std::vector<std::array<uint32_t, 3>> triangles;
            bool is_open = false;
            for (const auto& triangle : whole.triangles) {
                Vec3d middle = whole.origin;  // within its cell: a triangle with no corner within lies in no face
                for (const uint32_t v : triangle) middle += whole.positions[v].cast<double>() / 3.0;
                bool has_nan = false;
                for (int32_t c = 0; c < 8; ++c)
                    has_nan = has_nan || is_nan({int32_t(std::floor(middle.x())) + (c & 1), int32_t(std::floor(middle.y())) + (c >> 1 & 1),
                                                 int32_t(std::floor(middle.z())) + (c >> 2)});
                is_open = is_open || has_nan;
                if (has_nan) continue;
                triangles.push_back(triangle);
                for (const uint32_t v : triangle) is_used[v] = 1;
            }
            std::vector<Vec3f> positions;
            std::vector<std::array<uint8_t, 4>> colors;
            std::vector<uint32_t> numbers_of(is_used.size());
            for (size_t v = 0; v < is_used.size(); ++v) {
                if (is_used[v] == 0) continue;
                numbers_of[v] = uint32_t(positions.size());
                positions.push_back(whole.positions[v]);
                colors.push_back(whole.colors[v]);
            }
            for (auto& triangle : triangles)
                for (uint32_t& v : triangle) v = numbers_of[v];
            ASSERT_GT(triangles.size(), 2000u);
            ASSERT_LT(triangles.size(), whole.triangles.size());

            settings.open_at_nan = true;
            for (const int threads : {1, 3}) {
                settings.threads = threads;
                settings.normals = threads > 1;  // they do not change the surface
                settings.memory_bytes = uint64_t{1} << (threads > 1 ? 20 : 30);
                FunctionBricks source = holed();
                SurfaceCollector sink;
                const ContourReport report = contour_bricks(source, settings, sink);
                EXPECT_EQ(sink.origin, whole.origin);
                EXPECT_TRUE(sink.triangles == triangles) << sink.triangles.size() << " for " << triangles.size();
                EXPECT_TRUE(sink.positions == positions) << sink.positions.size() << " for " << positions.size();
                EXPECT_TRUE(sink.colors == colors);
                EXPECT_EQ(report.triangles, triangles.size());
                EXPECT_EQ(report.vertices, positions.size());
                EXPECT_TRUE(report.meets_boundary);
                EXPECT_GT(report.nan_samples, 0u);
                EXPECT_EQ(sink.normals.size(), settings.normals ? positions.size() : 0u);
                for (const Vec3f& normal : sink.normals) ASSERT_TRUE(normal.allFinite());
            }
        }
    }
}

// Without NaN it is the same surface, and closed.
TEST(ContourBricks, IsClosedWithoutNaN) {
    const Vec3d center = {3.0, -5.0, 11.0};
    FunctionBricks source = sphere_band({}, center, 9.0, 2.5, {-64, -64, -64}, {64, 64, 64}), again = source;
    ContourSettings settings{.isovalues = {0.0}, .inside = ContourInside::below};
    SurfaceCollector sink, open;
    contour_bricks(source, settings, sink);
    settings.open_at_nan = true;
    EXPECT_FALSE(contour_bricks(again, settings, open).meets_boundary);
    EXPECT_TRUE(open.positions == sink.positions && open.triangles == sink.triangles);
}

// A plane in a block of bricks with nothing known beside: a square of it, with a vertex for each line of samples.
TEST(ContourBricks, APlaneThatEndsWhereNothingIsKnown) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    FunctionBricks source({}, {-16, -16, -8}, {16, 16, 16}, [](const Place& p) { return float(p[2]) - 3.5f; },
                          [](const Place&) { return true; }, [=](const Place&) { return nan; });
    SurfaceCollector sink;
    const ContourReport report =
        contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below, .open_at_nan = true, .normals = true}, sink);
    EXPECT_TRUE(report.meets_boundary);
    EXPECT_EQ(sink.triangles.size(), 2u * 31 * 31);  // cells between 32 samples an axis
    EXPECT_EQ(sink.positions.size(), 32u * 32);
    const SurfaceShape shape = shape_of(sink.positions, sink.triangles);
    EXPECT_EQ(shape.boundary_edges, 4u * 31);
    EXPECT_EQ(shape.euler, 1);
    for (size_t v = 0; v < sink.positions.size(); ++v) {
        EXPECT_EQ(sink.origin.z() + sink.positions[v].z(), 3.5);
        EXPECT_EQ(sink.normals[v], Vec3f(0, 0, 1));
    }
}

// The surface in a layer of noise is larger than its bricks: it comes in pieces, vertices before triangles, down to the least memory that the
// errors tell of, and is the same.
TEST(ContourBricks, ALayersSurfaceMayBeLargerThanTheMemory) {
    const auto value = [](const Place& p) {
        return float(Random(uint64_t(p[0]) ^ uint64_t(p[1]) << 20 ^ uint64_t(p[2]) << 40).uniform(-1.0, 1.0));
    };
    const auto source = [&] {
        return FunctionBricks({}, {0, 0, 0}, {40, 40, 16}, value, [](const Place& corner) { return corner[0] != 16 || corner[1] != 8; },
                              [](const Place&) { return -0.75f; });
    };
    for (const bool rich : {false, true}) {
        ContourSettings settings{.isovalues = {0.0}};
        if (rich) {
            settings.isovalues = {0.25, -0.5};
            settings.normals = true;
            settings.colors = {{1, 2, 3, 4}, {5, 6, 7, 8}};
        }
        SurfaceCollector whole;
        FunctionBricks all = source();
        const ContourReport report = contour_bricks(all, settings, whole);
        const uint64_t field_bytes = 40 * 40 * 8 * sizeof(float);
        const uint64_t layer_bytes = (whole.positions.size() * 12 + whole.normals.size() * 12 + whole.colors.size() * 4 + whole.triangles.size() * 12) / 2;
        ASSERT_GT(layer_bytes, 5 * field_bytes);
        settings.memory_bytes = 1000;
        bool has_run = false;
        for (int tries = 0;; ++tries) {
            ASSERT_LT(tries, 60);
            settings.threads = 1 + tries % 3;
            FunctionBricks again = source();
            SurfaceCollector sink;
            try {
                const ContourReport found = contour_bricks(again, settings, sink);
                EXPECT_TRUE(sink.positions == whole.positions && sink.triangles == whole.triangles);
                EXPECT_TRUE(sink.normals == whole.normals && sink.colors == whole.colors);
                EXPECT_EQ(found.vertices, report.vertices);
                EXPECT_EQ(found.triangles, report.triangles);
                EXPECT_EQ(found.clamped_vertices, report.clamped_vertices);
                EXPECT_EQ(found.largest_shift_cells, report.largest_shift_cells);
                if (!has_run) {
                    EXPECT_LT(settings.memory_bytes, 6 * field_bytes + (rich ? 2 : 1) * layer_bytes / 4);
                    EXPECT_GT(sink.pieces, 20);
                }
                has_run = true;
                EXPECT_LT(sink.largest_piece, settings.memory_bytes / 4);
                if (settings.memory_bytes > layer_bytes * 9) break;  // a layer is a piece there
                settings.memory_bytes *= 2;
            } catch (const Error& error) {
                ASSERT_FALSE(has_run) << error.what();
                const std::string text = error.what();
                const uint64_t needed = std::stoull(text.substr(text.find(" need ") + 6));
                ASSERT_GT(needed, settings.memory_bytes) << text;
                settings.memory_bytes = needed;
            }
        }
    }
}

// Bricks may be far apart, and layers missing.
TEST(ContourBricks, FarPiecesAndMissingLayers) {
    const auto value = [](const Place& p) {
        const auto ball = [&](double x, double y, double z) { return std::hypot(p[0] - x, p[1] - y, p[2] - z) - 3.0; };
        return float(std::min(ball(4, 4, 4), ball(-1000004, 2000004, 80004)));
    };
    class Two : public FieldBrickSource {
    public:
        Two(std::function<float(const Place&)> value) : value_(std::move(value)) {}
        const GridPlacement& placement() const override { return placement_; }
        float background() const override { return 10.0f; }
        bool next_layer(FieldBrickLayer& out) override {
            if (next_ == 2) return false;
            const Place corner = next_++ == 0 ? Place{0, 0, 0} : Place{-1000008, 2000000, 80000};
            out = {.k = corner[2], .corners = {{corner[0], corner[1]}}, .values = {}};
            for (int32_t n = 0; n < 512; ++n) out.values.push_back(value_({corner[0] + n % 8, corner[1] + n / 8 % 8, corner[2] + n / 64}));
            return true;
        }

    private:
        GridPlacement placement_;
        std::function<float(const Place&)> value_;
        int next_ = 0;
    };
    Two source(value);
    SurfaceCollector sink;
    contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below}, sink);
    const SurfaceShape shape = shape_of(sink.positions, sink.triangles);
    EXPECT_EQ(shape.fault, "");
    EXPECT_EQ(shape.boundary_edges, 0u);
    EXPECT_EQ(shape.euler, 4);
    EXPECT_EQ(shape.components, 2u);
}

class Given : public FieldBrickSource {
public:
    explicit Given(std::vector<FieldBrickLayer> layers) : layers_(std::move(layers)) {}
    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return 1.0f; }
    bool next_layer(FieldBrickLayer& out) override {
        if (next_ == layers_.size()) return false;
        out = layers_[next_++];
        return true;
    }

private:
    GridPlacement placement_;
    std::vector<FieldBrickLayer> layers_;
    size_t next_ = 0;
};

FieldBrickLayer layer_of(int32_t k, std::vector<std::array<int32_t, 2>> corners) {
    FieldBrickLayer layer{.k = k, .corners = std::move(corners), .values = {}};
    layer.values.assign(layer.corners.size() * kFieldBrickSamples, -1.0f);
    return layer;
}

// What a source throws comes out, also where its layers are read ahead.
TEST(ContourBricks, PassesOnWhatTheSourceThrows) {
    class Broken : public Given {
    public:
        using Given::Given;
        bool next_layer(FieldBrickLayer& out) override {
            if (++layers_read_ == 3) throw Error(ErrorKind::io, "third layer");
            return Given::next_layer(out);
        }

    private:
        int layers_read_ = 0;
    };
    for (const int threads : {1, 2}) {
        Broken source({layer_of(0, {{0, 0}}), layer_of(8, {{0, 0}}), layer_of(16, {{0, 0}})});
        SurfaceCollector sink;
        EXPECT_THROW(contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below, .threads = threads}, sink), Error);
    }
}

TEST(ContourBricks, RefusesWhatIsOutOfOrder) {
    FieldBrickLayer short_of_samples = layer_of(0, {{0, 0}});
    short_of_samples.values.pop_back();
    for (const std::vector<FieldBrickLayer>& layers : {std::vector<FieldBrickLayer>{layer_of(8, {{0, 0}}), layer_of(0, {{0, 0}})},
                                                       {layer_of(8, {{0, 0}}), layer_of(8, {{0, 0}})},
                                                       {layer_of(3, {{0, 0}})},
                                                       {layer_of(0, {{0, 4}})},
                                                       {layer_of(0, {{8, 0}, {0, 0}})},
                                                       {layer_of(0, {{0, 0}, {0, 0}})},
                                                       {layer_of(0, {{0, 8}, {8, 0}})},
                                                       {layer_of(0, {{std::numeric_limits<int32_t>::min(), 0}})},
                                                       {short_of_samples}}) {
        Given source(layers);
        SurfaceCollector sink;
        try {
            contour_bricks(source, {.isovalues = {0.0}}, sink);
            ADD_FAILURE();
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::malformed) << error.what();
        }
    }
    // One brick of inside in order: a box.
    Given source({layer_of(0, {{0, 0}})});
    SurfaceCollector sink;
    EXPECT_GT(contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below}, sink).triangles, 0u);
    EXPECT_EQ(shape_of(sink.positions, sink.triangles).euler, 2);
    EXPECT_NEAR(shape_of(sink.positions, sink.triangles).volume, 512.0, 26.0);  // a box of side 8 without its rounded rim
    Given none({});
    SurfaceCollector nothing;
    EXPECT_EQ(contour_bricks(none, {.isovalues = {0.0}}, nothing).triangles, 0u);
    Given again({layer_of(0, {{0, 0}})});
    EXPECT_THROW(contour_bricks(again, {.isovalues = {0.0}, .inside = ContourInside::below, .memory_bytes = 1000}, nothing), Error);
}

// 16 bricks in each of some layers, and no surface. What does not fit is refused before bricks are looked up around others, which masks
// come before and parts after: only then is a brick that is not given asked for.
TEST(ContourBricks, CountsLayersBeforeWhatIsMadeOfThem) {
    struct Asked : Given {
        using Given::Given;
        float absent_value(const Place& corner) const override {
            ++times;
            return Given::absent_value(corner);
        }
        mutable std::atomic<int> times = 0;
    };
    std::vector<std::array<int32_t, 2>> corners;
    for (int32_t j = 0; j < 4; ++j)
        for (int32_t i = 0; i < 4; ++i) corners.push_back({8 * i, 8 * j});
    constexpr uint64_t kLayer = 16 * (kFieldBrickSamples * sizeof(float) + sizeof(std::array<int32_t, 2>)), kMasks = 16 * 64;
    for (const int threads : {1, 3})
        for (const auto& [layers, memory_bytes, asked] : {std::tuple(1, kLayer, false),                  // not the masks
                                                         {1, kLayer + kMasks, false},                   // not the cells
                                                         {9, kLayer + kMasks, false},                   // as soon
                                                         {9, 4 * (kLayer + kMasks), true},              // not four layers and their cells  
                                                         {1, kLayer + kMasks + 2 * 25 * 1000, true},    // of two layers of cells, 5^2 bricks each
                                                         {9, 5 * (kLayer + kMasks) + 2 * 25 * 1000, true}}) {
            std::vector<FieldBrickLayer> given;
            for (int32_t k = 0; k < layers; ++k) given.push_back(layer_of(8 * k, corners));
            Asked source(given);
            SurfaceCollector sink;
            const ContourSettings settings{.isovalues = {2.0}, .threads = threads, .memory_bytes = memory_bytes};
            const bool fits = memory_bytes > uint64_t(std::min(layers, 5)) * (kLayer + kMasks) + 25 * 1000;
            try {
                EXPECT_EQ(contour_bricks(source, settings, sink).triangles, 0u);
                EXPECT_TRUE(fits) << layers << " layers in " << memory_bytes;
            } catch (const Error& error) {
                EXPECT_EQ(error.kind, ErrorKind::limit) << error.what();
                EXPECT_FALSE(fits) << error.what();
            }
            EXPECT_EQ(source.times > 0, asked) << layers << " layers in " << memory_bytes;
        }
}

}  // namespace
}  // namespace strata
