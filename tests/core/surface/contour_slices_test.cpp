#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "tests/support/surface_collector.h"
#include "tests/support/surface_shape.h"

namespace strata {
namespace {

// A grid's slices, counting how they are read.
class GridSlices : public SliceSource {
public:
    explicit GridSlices(const ScalarGrid& grid) : grid_(grid) {}

    const GridPlacement& placement() const override { return grid_.placement; }
    std::array<uint32_t, 3> size() const override { return grid_.size; }
    void read(uint32_t count, double reference, std::span<float> out) override {
        const size_t slice = size_t(grid_.size[0]) * grid_.size[1];
        ASSERT_LE(next_ + count, grid_.size[2]);
        ASSERT_EQ(out.size(), slice * count);
        for (size_t n = 0; n < out.size(); ++n) out[n] = float(double(grid_.values[next_ * slice + n]) - reference);
        next_ += count;
        ++reads_;
    }
    uint32_t reads() const { return reads_; }
    uint32_t slices_read() const { return uint32_t(next_); }

private:
    const ScalarGrid& grid_;
    size_t next_ = 0;
    uint32_t reads_ = 0;
};

template <typename T>
std::string bytes_of(const T* data, size_t size) {
    return {reinterpret_cast<const char*>(data), size * sizeof(T)};
}
std::string bytes_of(const SurfaceCollector& surface) {
    return bytes_of(surface.positions.data(), surface.positions.size()) + bytes_of(surface.normals.data(), surface.normals.size()) +
           bytes_of(surface.colors.data(), surface.colors.size()) + bytes_of(surface.triangles.data(), surface.triangles.size());
}

ScalarGrid smooth_grid(const std::array<uint32_t, 3>& size) {
    ScalarGrid grid{.placement = {.origin = {10, 20, 30}, .axes = Mat3d::Identity() * 0.5}, .size = size, .values = {}};
    Random random(4);
    for (uint32_t k = 0; k < size[2]; ++k)
        for (uint32_t j = 0; j < size[1]; ++j)
            for (uint32_t i = 0; i < size[0]; ++i)
                grid.values.push_back(
                    float(std::sin(0.31 * i) * std::cos(0.23 * j) + std::sin(0.27 * k) + 0.2 * random.uniform(-1.0, 1.0)));
    grid.values[size_t(size[0]) * size[1] * 7 + 19] = std::numeric_limits<float>::quiet_NaN();
    return grid;
}

TEST(ContourSlices, SameBytesWhateverTheMemory) {
    const ScalarGrid grid = smooth_grid({61, 33, 90});
    for (const bool close : {false, true}) {
        ContourSettings settings{
            .isovalues = {0.125, -0.5}, .close = close, .normals = true, .colors = {{255, 0, 0, 255}, {0, 255, 0, 255}}, .threads = 2};
        std::string whole;
        ContourReport whole_report;
        for (const uint64_t memory : {uint64_t{1} << 30, uint64_t{1} << 21, uint64_t{1} << 20, uint64_t{400000}}) {
            settings.memory_bytes = memory;
            GridSlices source(grid);
            SurfaceCollector sink;
            const ContourReport report = contour_slices(source, settings, sink);
            EXPECT_EQ(source.slices_read(), 90u);
            const std::string bytes = bytes_of(sink);
            if (whole.empty()) {
                whole = bytes;
                whole_report = report;
                const SurfaceShape shape = shape_of(sink.positions, sink.triangles);
                EXPECT_EQ(shape.fault, "");
                EXPECT_EQ(shape.boundary_edges == 0, close);
                EXPECT_EQ(sink.colors.size(), sink.positions.size());
            } else {
                EXPECT_GE(sink.pieces, 2);
            }
            EXPECT_EQ(bytes == whole, true) << memory;
            EXPECT_EQ(report.vertices, whole_report.vertices);
            EXPECT_EQ(report.triangles, whole_report.triangles);
            EXPECT_EQ(report.triangles, sink.triangles.size());
            EXPECT_EQ(report.nan_samples, 1u);
            EXPECT_EQ(report.clamped_vertices, whole_report.clamped_vertices);
            EXPECT_EQ(report.ambiguous_cells, whole_report.ambiguous_cells);
            EXPECT_EQ(report.least, whole_report.least);
            EXPECT_EQ(report.meets_boundary, true);
        }
    }
}

// At the isovalue 0 nothing is subtracted, and slices and the grid in memory are the same numbers.
TEST(ContourSlices, SameBytesAsTheGridInMemory) {
    const ScalarGrid grid = smooth_grid({40, 41, 42});
    const ContourSettings settings{.isovalues = {0.0}, .normals = true, .memory_bytes = 300000};
    GridSlices source(grid);
    SurfaceCollector sink;
    contour_slices(source, settings, sink);
    ContourMesh mesh;
    contour_grid(grid.placement, grid.size, grid.values, settings, mesh);
    EXPECT_EQ(sink.origin, mesh.origin);
    EXPECT_EQ(bytes_of(sink) == bytes_of(mesh.positions.data(), mesh.positions.size()) +
                                    bytes_of(mesh.normals.data(), mesh.normals.size()) +
                                    bytes_of(mesh.triangles.data(), mesh.triangles.size()),
              true);
}

TEST(ContourSlices, ColorsAreThoseOfTheirIsovalue) {
    const ScalarGrid grid = smooth_grid({30, 30, 30});
    const ContourSettings settings{.isovalues = {0.3, -0.3}, .colors = {{1, 2, 3, 4}, {5, 6, 7, 8}}, .memory_bytes = 100000};
    GridSlices source(grid);
    SurfaceCollector sink;
    contour_slices(source, settings, sink);
    std::array<uint64_t, 2> vertices = {0, 0};
    for (const auto& t : sink.triangles) EXPECT_TRUE(sink.colors[t[0]] == sink.colors[t[1]] && sink.colors[t[1]] == sink.colors[t[2]]);
    for (const auto& color : sink.colors) ++vertices[color == settings.colors[1] ? 1 : 0];
    for (size_t s = 0; s < 2; ++s) {
        ContourMesh mesh;
        EXPECT_EQ(contour_grid(grid.placement, grid.size, grid.values, {.isovalues = {settings.isovalues[s]}}, mesh).vertices, vertices[s]);
    }
}

// The surface between two slices of noise is many times as large as they are: it comes in pieces of some rows, vertices before triangles.
TEST(ContourSlices, ALayerMayBeLargerThanTheMemory) {
    ScalarGrid grid{.placement = {.origin = {1, 2, 3}}, .size = {50, 60, 5}, .values = {}};
    Random random(11);
    for (uint32_t n = 0; n < 50 * 60 * 5; ++n) grid.values.push_back(float(random.uniform(-1.0, 1.0)));
    for (const bool close : {false, true})
        for (const bool rich : {false, true}) {
            ContourSettings settings{.isovalues = {0.0}, .close = close};
            if (rich) {
                settings.isovalues.push_back(0.25);
                settings.normals = true;
                settings.colors = {{1, 2, 3, 4}, {5, 6, 7, 8}};
            }
            GridSlices all(grid);
            SurfaceCollector whole;
            const ContourReport report = contour_slices(all, settings, whole);
            const uint64_t layer_bytes = bytes_of(whole).size() / 5;
            // The least memory, as the errors tell it.
            settings.memory_bytes = 1000;
            for (int tries = 0;; ++tries) {
                ASSERT_LT(tries, 40);
                settings.threads = 1 + tries % 3;
                GridSlices source(grid);
                SurfaceCollector sink;
                try {
                    const ContourReport again = contour_slices(source, settings, sink);
                    EXPECT_TRUE(bytes_of(sink) == bytes_of(whole));
                    EXPECT_EQ(again.vertices, report.vertices);
                    EXPECT_EQ(again.triangles, report.triangles);
                    EXPECT_EQ(again.clamped_vertices, report.clamped_vertices);
                    EXPECT_EQ(again.largest_shift_cells, report.largest_shift_cells);
                    EXPECT_LT(sink.largest_piece, settings.memory_bytes);
                    if (settings.memory_bytes > layer_bytes * 9) break;  // a layer is a piece there
                    settings.memory_bytes += settings.memory_bytes / 2;
                } catch (const Error& error) {
                    const std::string text = error.what();
                    const uint64_t needed = std::stoull(text.substr(text.find(" need ") + 6));
                    ASSERT_GT(needed, settings.memory_bytes) << text;
                    settings.memory_bytes = needed;
                    EXPECT_LT(needed, layer_bytes / (rich ? 2 : 1)) << text;
                }
            }
        }
}

TEST(ContourSlices, RefusesTooLittleMemoryWithTheNumberNeeded) {
    const ScalarGrid grid = smooth_grid({100, 100, 10});
    GridSlices source(grid);
    SurfaceCollector sink;
    try {
        contour_slices(source, {.memory_bytes = 50000}, sink);
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_NE(std::string(error.what()).find("50000 are allowed"), std::string::npos);
    }
    // Of what was given, this may be a part.
    try {
        contour_slices(source, {.memory_bytes = 50000, .memory_parts = 2}, sink);
        FAIL();
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("100000 are allowed"), std::string::npos);
    }
    EXPECT_EQ(source.reads(), 0u);
}

// A slice that no memory holds is refused before anything is allocated.
TEST(ContourSlices, RefusesSlicesBeyondAnyMemory) {
    for (const std::array<uint32_t, 3>& size : {std::array<uint32_t, 3>{0xffffffff, 0xffffffff, 0xffffffff}, {1 << 20, 1 << 20, 2}}) {
        const ScalarGrid grid{.placement = {}, .size = size, .values = {}};
        GridSlices source(grid);
        SurfaceCollector sink;
        EXPECT_THROW(contour_slices(source, {}, sink), Error);
        EXPECT_EQ(source.reads(), 0u);
    }
}

TEST(ContourSlices, NoCellsNoPieces) {
    for (const std::array<uint32_t, 3>& size : {std::array<uint32_t, 3>{20, 20, 1}, {1, 20, 20}, {0, 0, 0}}) {
        ScalarGrid grid{.placement = {}, .size = size, .values = std::vector<float>(size_t(size[0]) * size[1] * size[2], 1.0f)};
        GridSlices source(grid);
        SurfaceCollector sink;
        EXPECT_EQ(contour_slices(source, {}, sink).triangles, 0u);
        EXPECT_EQ(sink.pieces, 0);
    }
}

}  // namespace
}  // namespace strata
