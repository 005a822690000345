#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "core/math/vec.h"

namespace strata {

/// What a mesh is, found from its triangles alone.
struct SurfaceShape {
    std::string fault;            // the first reason for not being a consistently oriented manifold with boundary; empty: none
    uint64_t boundary_edges = 0;  // edges of one triangle
    int64_t euler = 0;            // vertices - edges + triangles
    uint64_t components = 0;
    double volume = 0.0;  // enclosed, where there is no boundary edge; negative: inside out
    double area = 0.0;
};

/// Every vertex is to be used, every edge by two triangles in opposite directions or by one, and the triangles around each vertex are to
/// be one fan.
SurfaceShape shape_of(std::span<const Vec3f> positions, std::span<const std::array<uint32_t, 3>> triangles);

}  // namespace strata
