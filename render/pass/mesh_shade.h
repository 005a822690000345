#pragma once

#include <cstdint>

#include "render/gbuffer.h"
#include "render/mesh_model.h"
#include "render/pass/mesh_kernel.h"
#include "render/pass/mesh_shade_kernel.h"

namespace strata {

/// Turns words of a mesh into pixels.
struct MeshShade {
    const MeshModel& model;
    uint32_t drawable;
    const MeshProjection& view;
    const MeshTarget& target;
    MeetTriangles meet_triangles;
    Sky sky;

    /// Row `row` of the target, columns [left, right), into a G-buffer that has its rows, where what is there is farther.
    /// returns  whether any pixel was drawn
    bool draw_row(uint32_t row, uint32_t left, uint32_t right, GBuffer& out) const;
};

/// The parts of a triangle's id.
inline constexpr uint32_t kFrontSlot = 0, kBackSlot = 1;

}  // namespace strata
