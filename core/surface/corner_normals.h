#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/surface/triangle_mesh.h"

namespace strata {

/// A direction in 32 bits, within 1e-4 of what was packed.
/// source  the octahedron of Q. Meyer et al., "On Floating-Point Normal Vectors", EGSR 2010
uint32_t pack_normal(const Vec3f& normal);
inline constexpr uint32_t kNoNormal = 0x80008000;  // packed by nothing

/// Of length 1. packed: not kNoNormal
inline Vec3f unpack_normal(uint32_t packed) {
    const float u = float(int16_t(packed)) * (1.0f / 32767.0f), v = float(int16_t(packed >> 16)) * (1.0f / 32767.0f);
    const float z = 1.0f - std::abs(u) - std::abs(v), fold = std::max(-z, 0.0f);
    const Vec3f n(u >= 0.0f ? u - fold : u + fold, v >= 0.0f ? v - fold : v + fold, z);
    return n / std::sqrt(n.x() * n.x() + n.y() * n.y() + n.z() * n.z());
}

inline constexpr float kCreaseCosine = 0.70710678f;  // faces that meet at more than 45 degrees meet at an edge

inline constexpr float kStoredCosine = 0.17364818f;  // 80 degrees: a file's normal farther from its triangle's is wrong, or is none of its side

/// The normals that make a mesh look smooth, three a triangle, on the side that its corners turn counterclockwise. Where the vertex has a normal
/// within 80 degrees of the triangle's own, or of its opposite, it is that one: whoever wrote it knew the surface, of which triangles of thin parts are but
/// chords. But where it is no more than the mean of the triangles at the vertex, nobody knew more, and it is taken only if all of them lie
/// within 44 degrees: not at the edges of a box. Else it is the mean of those of the triangles at the vertex that lie within 45 degrees of this one's plane, each weighing as its angle there: so edges stay edges, and triangles that turn the wrong way do no harm.
/// returns  [3 * triangles] packed; kNoNormal for triangles without area
/// cost     about 0.15 us a triangle and thread; 12 bytes a triangle kept; while it runs 36 a triangle and 8 a vertex more
/// source   G. Thürmer, C. Wüthrich, "Computing Vertex Normals from Polygonal Facets", J. Graphics Tools 3(1), 1998: the weights
std::vector<uint32_t> corner_normals(const TriangleMesh& mesh, int threads);

}  // namespace strata
