#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/math/box.h"
#include "core/math/vec.h"

namespace strata {

/// An attribute of vertices.
struct MeshScalars {
    std::string name;
    std::vector<float> values;  // NaN: unknown
};

/// Triangles that share vertices, in world units. What is empty is unknown; else it has an entry a vertex.
struct TriangleMesh {
    std::vector<Vec3d> positions;                         // finite
    std::vector<std::array<uint32_t, 3>> triangles;       // indices of vertices, counterclockwise seen from outside
    std::vector<Vec3f> normals;                           // [positions] of any length; zero: unknown
    std::vector<std::array<uint8_t, 4>> colors;           // [positions] sRGB and opacity
    std::vector<MeshScalars> scalars;                     // values: [positions]

    Box3d bounds() const {
        Box3d box;
        for (const Vec3d& p : positions) box.extend(p);
        return box;
    }
    /// Bytes of memory that the arrays take.
    uint64_t size_bytes() const {
        return positions.size() * (sizeof(Vec3d) + scalars.size() * sizeof(float)) + triangles.size() * sizeof(triangles[0]) +
               normals.size() * sizeof(Vec3f) + colors.size() * sizeof(colors[0]);
    }
};

}  // namespace strata
