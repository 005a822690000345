#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/math/vec.h"

namespace strata {

/// An attribute of vertices.
struct VertexScalars {
    std::string_view name;
    std::span<const float> values;  // NaN: unknown
};

/// A piece of a surface, as it grows. Vertices are numbered through from the surface's first piece to its last; faces refer to vertices
/// of this piece or of earlier ones. Valid during the call.
struct SurfacePiece {
    Vec3d origin = Vec3d::Zero();                        // world: of positions
    std::span<const Vec3f> positions;                    // world, less origin
    std::span<const Vec3f> normals;                      // [positions] of unit length, zero: unknown; or empty
    std::span<const std::array<uint8_t, 4>> colors;      // [positions] sRGB and opacity; or empty
    std::span<const VertexScalars> scalars;              // values: [positions]. Of the same names in every piece
    std::span<const std::array<uint32_t, 3>> triangles;  // counterclockwise seen from outside
    std::span<const std::array<uint32_t, 4>> quads;      // likewise, plane and convex
};

/// Takes a surface piece after piece, always from one thread at a time.
class SurfaceSink {
public:
    virtual ~SurfaceSink() = default;
    /// throws  Error: what prevents writing on
    virtual void add(const SurfacePiece& piece) = 0;
};

}  // namespace strata
