#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/surface/contour.h"
#include "core/surface/large_array.h"
#include "core/surface/surface_sink.h"

namespace strata {

/// Pieces of a surface on their way to a sink, one after the other in the same memory. The settings must outlive it.
class PieceBuffer {
public:
    explicit PieceBuffer(const ContourSettings& settings)
        : settings_(settings), vertex_bytes_(sizeof(Vec3f) * (settings.normals ? 2 : 1) + (settings.colors.empty() ? 0 : sizeof settings.colors[0])) {}

    /// Of a piece, of the bytes that are left: a part of the memory, since what takes the piece keeps some of it.
    static uint64_t most_bytes(const ContourSettings& settings, uint64_t left) { return std::min({left, settings.memory_bytes / kPieces, kMostPieceBytes}); }
    uint64_t bytes_of(uint64_t vertices, uint64_t triangles) const { return vertices * vertex_bytes_ + triangles * sizeof triangles_[0]; }
    /// Held, from pieces before.
    uint64_t bytes() const { return bytes_of(positions_.size(), triangles_.size()); }

    /// Calls use(first, end) with as many parts as fit, at least one, where these have anything.
    /// before  elements before a part; each: bytes of an element
    template <typename Before, typename Use>
    static void for_pieces(size_t parts, const Before& before, uint64_t each, uint64_t most_bytes, const Use& use) {
        for (size_t first = 0, end; first < parts; first = end) {
            end = first + 1;
            while (end < parts && (before(end + 1) - before(first)) * each <= most_bytes) ++end;
            if (before(end) > before(first)) use(first, end);
        }
    }

    /// For the next piece: in the memory of pieces before, if both together do not take more than one may.
    void make_room(uint64_t vertices, uint64_t triangles, uint64_t most_bytes) {
        if (bytes_of(std::max<uint64_t>(vertices, positions_.size()), std::max<uint64_t>(triangles, triangles_.size())) > most_bytes) drop();
        reserve(positions_, vertices);
        if (settings_.normals) reserve(normals_, vertices);
        reserve(triangles_, triangles);
    }
    void drop() {
        positions_ = {};
        normals_ = {};
        triangles_ = {};
    }
    Vec3f* positions() { return positions_.data(); }
    Vec3f* normals() { return settings_.normals ? normals_.data() : nullptr; }
    std::array<uint32_t, 3>* triangles() { return triangles_.data(); }
    /// Of the next vertices of the piece, if there are colors.
    void add_colors(uint64_t vertices, size_t isovalue) {
        if (!settings_.colors.empty()) colors_.insert(colors_.end(), size_t(vertices), settings_.colors[isovalue]);
    }

    void hand_on(const Vec3d& origin, uint64_t vertices, uint64_t triangles, SurfaceSink& sink) {
        sink.add({.origin = origin,
                  .positions = {positions_.data(), size_t(vertices)},
                  .normals = {normals_.data(), settings_.normals ? size_t(vertices) : 0},
                  .colors = colors_,
                  .triangles = {triangles_.data(), size_t(triangles)},
                  .quads = {}});
        colors_.clear();
    }

private:
    static constexpr uint64_t kPieces = 8, kMostPieceBytes = uint64_t{64} << 20;

    template <typename T>
    static void reserve(LargeArray<T>& array, uint64_t size) {
        if (array.size() < size) array = LargeArray<T>(size_t(size));
    }

    const ContourSettings& settings_;
    uint64_t vertex_bytes_;
    LargeArray<Vec3f> positions_, normals_;
    LargeArray<std::array<uint32_t, 3>> triangles_;
    std::vector<std::array<uint8_t, 4>> colors_;
};

}  // namespace strata
