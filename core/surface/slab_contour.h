#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/cell_cases.h"
#include "core/surface/contour.h"
#include "core/surface/edge_cut.h"
#include "core/surface/large_array.h"
#include "core/surface/sample_masks.h"

namespace strata {

/// Where a part of a surface is written.
struct ContourTarget {
    Vec3f* positions = nullptr;  // none: the triangles alone are wanted
    Vec3f* normals = nullptr;    // or none
    std::array<uint32_t, 3>* triangles = nullptr;  // none: the vertices alone are wanted
};

/// Consecutive slices of a grid in memory.
struct SlabSamples {
    const float* values = nullptr;
    int64_t first_slice = 0;  // of the grid, where values begin
};

/// Marching cubes, slab by slab from k = 0: first everything is counted by the bits of samples inside, then every vertex and triangle has
/// its place and threads write them side by side.
///
/// Vertices are numbered slice by slice: for every isovalue and row those on edges along i, then those along j; then, between the slice and
/// the next, for every isovalue and row those along k, then those within cells. A layer is what lies between two slices.
/// Where the surface is closed, slices, rows and samples count one that is outside before the first and one after the last.
class SlabContour {
public:
    SlabContour(const GridPlacement& placement, const std::array<uint32_t, 3>& size, const ContourSettings& settings, double reference,
                SimdLevel level);

    /// Layers of the grid; 0: there is no cell.
    int64_t layers() const;
    /// Slices of the grid that planning and emitting layers [first, end) reads.
    std::array<int64_t, 2> slices_of(int64_t first, int64_t end) const;
    /// Bytes for planning so many layers.
    uint64_t plan_bytes(int64_t layers) const;

    /// Counts the next layers, which begin where those planned before ended.
    /// samples  they hold slices_of(first, end)
    /// throws   Error{limit}: 2^32 vertices or more
    void plan(const SlabSamples& samples, int64_t first, int64_t end);

    struct Part {
        uint64_t vertices = 0, triangles = 0;
    };
    /// What emit() writes for planned layers: their triangles, and the vertices that came with no layer before.
    Part part_of(int64_t first, int64_t end) const;
    void emit(const SlabSamples& samples, int64_t first, int64_t end, const ContourTarget& out);
    /// Which isovalue's the vertices of those layers are: calls with the index and the number of vertices that follow each other.
    void for_isovalues(int64_t first, int64_t end, const std::function<void(size_t isovalue, uint64_t vertices)>& use) const;

    // The same of a part of one planned layer, row by row: first all of its vertices, in the order of their numbers, then its triangles.
    size_t vertex_rows(int64_t layer) const { return triangle_rows() * (layer == 0 ? 3 : 2); }
    size_t triangle_rows() const { return isovalues_.size() * size_t(rows_); }
    /// Vertices, or triangles, of the layer before those of a row; of all rows where it is their number.
    uint64_t vertices_before(int64_t layer, size_t row) const;
    uint64_t triangles_before(int64_t layer, size_t row) const;
    size_t isovalue_of(size_t row) const { return row / size_t(rows_) % isovalues_.size(); }
    void emit_vertices(const SlabSamples& samples, int64_t layer, size_t first_row, size_t end_row, const ContourTarget& out);
    void emit_triangles(const SlabSamples& samples, int64_t layer, size_t first_row, size_t end_row, const ContourTarget& out);

    ContourReport report() const { return report_; }

private:
    friend struct SlabKernel;

    struct Unit {  // of one isovalue: a slice or a layer
        uint64_t vertices = 0, triangles = 0;
        uint64_t first_vertex = 0, first_triangle = 0;  // of triangles, from the slab's first
    };
    struct SliceRow {
        uint32_t x, y;  // counts of vertices, then numbers of the first
    };
    struct LayerRow {
        uint32_t z, inner;
        uint32_t triangles;  // a count, then the first in its unit
    };
    struct Findings;

    size_t unit(int64_t slab_slice, size_t isovalue) const { return size_t(slab_slice) * isovalues_.size() + isovalue; }
    uint64_t* mask(int64_t slab_slice, size_t isovalue, int64_t row) {
        return masks_.data() + (unit(slab_slice, isovalue) * size_t(rows_) + size_t(row)) * stride_;
    }

    void find_masks(const SlabSamples& samples, int64_t slab_slice, SampleStatistics& statistics);
    void number_units(int64_t slices);
    void keep(const CutStatistics& cuts);
    uint64_t first_vertex_of(int64_t layer) const;

    std::array<int64_t, 3> samples_;   // of the grid
    int64_t pad_;                      // 1 where the surface is closed
    int64_t columns_, rows_, slices_;  // with what is outside
    size_t stride_;                    // words a row of bits, one of them 0 at the end
    std::vector<double> isovalues_;    // less the reference
    std::vector<float> levels_;
    bool below_, normals_, mirrored_;
    int threads_;
    SimdLevel level_;
    std::array<Vec3d, 3> axes_;
    Mat3d normal_from_gradient_;

    int64_t slab_first_ = 0, slab_end_ = 0;  // layers
    LargeArray<uint64_t> masks_;
    std::vector<Unit> slice_units_, layer_units_;
    std::vector<SliceRow> slice_rows_;
    std::vector<LayerRow> layer_rows_;
    uint64_t next_vertex_ = 0;
    ContourReport report_;
};

}  // namespace strata
