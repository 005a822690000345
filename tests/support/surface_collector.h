#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/surface/surface_sink.h"

namespace strata {

/// Keeps a surface's pieces together, and holds them to what SurfacePiece says.
class SurfaceCollector : public SurfaceSink {
public:
    void add(const SurfacePiece& piece) override {
        origin = piece.origin;
        positions.insert(positions.end(), piece.positions.begin(), piece.positions.end());
        normals.insert(normals.end(), piece.normals.begin(), piece.normals.end());
        colors.insert(colors.end(), piece.colors.begin(), piece.colors.end());
        for (const auto& t : piece.triangles)
            for (const uint32_t v : t) EXPECT_LT(v, positions.size());  // of this piece or an earlier one
        triangles.insert(triangles.end(), piece.triangles.begin(), piece.triangles.end());
        EXPECT_TRUE(piece.quads.empty());
        largest_piece = std::max<uint64_t>(largest_piece, piece.positions.size_bytes() + piece.normals.size_bytes() + piece.colors.size_bytes() + piece.triangles.size_bytes());
        ++pieces;
    }

    Vec3d origin = Vec3d::Zero();
    std::vector<Vec3f> positions, normals;
    std::vector<std::array<uint8_t, 4>> colors;
    std::vector<std::array<uint32_t, 3>> triangles;
    int pieces = 0;
    uint64_t largest_piece = 0;  // bytes
};

}  // namespace strata
