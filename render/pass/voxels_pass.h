#pragma once

#include <cstdint>
#include <span>

#include "core/cloud/clip_box.h"
#include "core/math/camera.h"
#include "render/gbuffer.h"
#include "render/sky_light.h"
#include "render/voxel_model.h"

namespace strata {

/// How voxels are drawn into rows of a picture.
struct VoxelView {
    const Camera& camera;
    uint32_t width_px, height_px;  // of the whole picture
    Vec2f offset_px;               // of a sample, from the middle of its pixel
    double error_px = 1.0;         // cells that look no larger are drawn whole
    std::span<const ClipBox> clips;
    int threads = 1;
    UpAxis up = UpAxis::z;  // for light
};

/// What was drawn.
struct VoxelsDrawn {
    int finest_depth = 0;          // of the cells; 0: none
    double error_px = 0.0;         // how large cells look that are coarser than voxels
    bool short_of_memory = false;  // the tree in memory ends before cells are as small as error_px

    void add(const VoxelsDrawn& other);
    /// A cell of a depth, where pixels are so many voxels wide.
    void add_cell(const VoxelTree& tree, int depth, double pixel_voxels, double wanted_px);
};

/// Casts a ray through the middle of each pixel of a G-buffer and draws what it hits where that is nearer than what is there:
/// color, eye depth, id and, where the G-buffer has it, splat_px: 1 for cubes, whose steps are relief; as large as the cells look where
/// they stand for a smooth surface, whose steps are none. Of what is equally near the lower drawable stays.
/// Flat faces are lit by a sky that is brightest above and to the south, so that the six directions differ, and their borders are
/// darkened where cells look large; cells too small to be seen as cubes are lit as the surface that they stand for. Smooth ones have the normal that is stored or, without one, that of
/// the cells around, and the depth of the plane through those, within 1.5 cells of their own.
/// Clip boxes cut through cells: the cut is a face.
/// drawable  the model's number in the scene; ids are voxel_slot(hit) and the node
/// cost      that of the rays, about 100 ns a pixel and thread; three times that for smooth ones
VoxelsDrawn draw_voxels(const VoxelModel& model, uint32_t drawable, const VoxelView& view, GBuffer& out);

/// The part of a voxel's id that says which cell of a node it is and by which face: level, whether the cell is an octant of the
/// node, its bit, the face; 4, 1, 6 and 3 bits from the highest.
constexpr uint32_t voxel_slot(const VoxelHit& hit, CellFace face) {
    const uint32_t octant = hit.depth == 2 * hit.level + 1;
    return ((uint32_t(hit.level) << 1 | octant) << 6 | (octant ? uint32_t(hit.bit) & 56 : uint32_t(hit.bit))) << 3 | uint32_t(face);
}

}  // namespace strata
