#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "render/image.h"

namespace strata {

/// What a pixel shows: from the highest bit on 8 bits of drawable (its number in the scene), 24 bits of slot and 32 bits of primitive.
/// Of a cloud the slot is the node's among those drawn (in key order), and the primitive the point's index in it;
/// of voxels they are voxel_slot(hit) and the node; of meshes the side that is seen and the triangle.
using PixelId = uint64_t;
inline constexpr PixelId kNoPixelId = ~PixelId{0};
inline constexpr uint32_t kMostSlots = 1 << 24;
inline constexpr uint32_t kMostDrawables = 255;  // so that none has the number of kNoPixelId
constexpr PixelId make_pixel_id(uint32_t slot, uint32_t primitive, uint32_t drawable = 0) {
    return PixelId{drawable} << 56 | PixelId{slot} << 32 | primitive;
}
constexpr uint32_t drawable_of(PixelId id) { return uint32_t(id >> 56); }
constexpr uint32_t slot_of(PixelId id) { return uint32_t(id >> 32) & (kMostSlots - 1); }
constexpr uint32_t primitive_of(PixelId id) { return uint32_t(id); }

inline constexpr float kNoDepth = std::numeric_limits<float>::infinity();

/// What opaque drawables leave behind for the screen-space passes: rows [first_row, first_row + rows) of a picture.
struct GBuffer {
    uint32_t width = 0, first_row = 0, rows = 0;
    std::vector<Rgba8> colors;   // [width * rows] alpha 0 where nothing was drawn
    std::vector<float> depths;   // eye depth, world units; kNoDepth where nothing was drawn
    std::vector<uint8_t> splat_px;  // how far the relief of splats reaches: their diameter, half of it where they lie in the surface; rounded, at most 255; empty unless a pass asks for it
    std::vector<PixelId> ids;    // kNoPixelId where nothing was drawn; empty unless asked for
};

}  // namespace strata
