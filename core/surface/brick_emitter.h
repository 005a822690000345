#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/brick_cells.h"
#include "core/surface/brick_view.h"
#include "core/surface/edge_cut.h"

namespace strata {

/// Where a part of a surface of bricks is written.
struct BrickTarget {
    Vec3f* positions = nullptr;                    // none: the triangles alone are wanted
    Vec3f* normals = nullptr;                      // or none
    std::array<uint32_t, 3>* triangles = nullptr;
    uint64_t first_vertex = 0, first_triangle = 0; // those that are written first of all
};

/// Cells of a layer whose vertices and triangles are numbered, and what their surface needs beside.
struct NumberedCells {
    const BrickCells& cells;
    MaskedLayers layers;
    const BrickCells* above = nullptr;                 // the cells of the layer above, if it has any
    const std::vector<AroundBrick>* around = nullptr;  // [cells] which of the cells, and of those above, lie around the upper side
};

/// Writes the vertices and triangles of parts, which threads may do side by side.
class BrickEmitter {
public:
    BrickEmitter(const FieldBrickSource& source, const ContourSettings& settings, const BrickLevels& levels, const BrickLayerWindow& window);

    /// Where positions are counted from: the least sample of a brick.
    void set_start(const std::array<int32_t, 3>& start) { start_ = start; }

    /// Those on edges of a part that come with the layer before, or the others.
    void put_vertices(const NumberedCells& layer, size_t part, bool early, const BrickTarget& out, CutStatistics& cuts) const;
    /// Those within cells, where the triangles are not wanted.
    void put_inner(const NumberedCells& layer, size_t part, const BrickTarget& out) const;
    /// And vertices within cells, if they are wanted.
    /// throws  Error{malformed}: bricks touch, have different values and are not given
    void put_triangles(const NumberedCells& layer, size_t part, const BrickTarget& out) const;

    [[noreturn]] static void refuse_absent(const BrickCells& cells);

private:
    friend struct BrickKernel;

    Vec3d start_of(const BrickCells& cells, size_t brick) const;
    double value_at(const BrickCells& cells, size_t brick, const BrickView& view, const std::array<int, 3>& at) const;
    Vec3d slope_at(const BrickCells& cells, size_t brick, const BrickView& view, const std::array<int, 3>& at) const;
    Vec3f normal_of(const Vec3d& outward) const;

    const FieldBrickSource& source_;
    const ContourSettings& settings_;
    const BrickLevels& levels_;
    const BrickLayerWindow& window_;
    const SimdLevel simd_level_ = best_simd_level();
    bool mirrored_;
    std::array<Vec3d, 3> axes_;
    Mat3d normal_from_gradient_;
    std::array<int32_t, 3> start_ = {0, 0, 0};
    mutable std::mutex source_mutex_;  // of absent_value
};

}  // namespace strata
