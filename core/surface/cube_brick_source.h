#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/surface/cube_faces.h"
#include "core/surface/scalar_field.h"
#include "core/voxel/voxel_block.h"

namespace strata {

/// What cells are made of.
struct CubeMaterials {
    bool by_color = false;                // cells of different colors are of different materials; else all are one
    std::vector<VoxelColor> transparent;  // colors of cells that can be seen through
};

/// Of a color: red << 16 | green << 8 | blue.
inline uint32_t material_of(const VoxelColor& c) { return uint32_t(c[0]) << 16 | uint32_t(c[1]) << 8 | c[2]; }

/// Cells of a grid as bricks of 64^3, those with occupied cells only, in some order. Bricks of which nothing can be seen may be left out.
class CubeBrickSource {
public:
    static constexpr size_t kNone = ~size_t{0};

    virtual ~CubeBrickSource() = default;
    /// Of corners of cells: where that of cell (0, 0, 0) lies which has the least coordinates, and steps of a cell.
    virtual const GridPlacement& placement() const = 0;
    virtual bool has_colors() const = 0;
    virtual uint64_t cells() const = 0;  // occupied ones
    virtual size_t size() const = 0;     // bricks
    virtual uint64_t memory_bytes() const = 0;  // that it holds for them
    /// What would need less memory, for the end of a message: "coarser cells need less".
    virtual std::string_view advice() const = 0;
    /// Coordinates in units of bricks.
    virtual std::array<uint32_t, 3> place(size_t brick) const = 0;
    /// The brick there, or kNone.
    virtual size_t find(const std::array<int64_t, 3>& place) const = 0;
    /// Fills a brick and the cells around it, except that materials are left as they are without by_color. Safe from several threads.
    /// materials  by_color only with has_colors. Those of cells are material_of() their colors
    /// returns    false: brick and all around it are full, so that it has no faces, and `out` is not filled
    virtual bool gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const = 0;
};

}  // namespace strata
