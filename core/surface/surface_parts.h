#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/surface/surface_sink.h"

namespace strata {

/// Hands a piece on in parts of at most so many vertices, so that what is given to them on the way stays small; its faces come with the last.
/// give  called with each part before it goes on, and with the attributes it will have, which begin as the piece's own
template <typename Give>
void hand_on_in_parts(const SurfacePiece& piece, size_t most_vertices, SurfaceSink& next, const Give& give) {
    const size_t all = piece.positions.size();
    std::vector<VertexScalars> scalars;
    size_t first = 0;
    do {
        const size_t count = std::min(most_vertices, all - first);
        SurfacePiece part = {.origin = piece.origin, .positions = piece.positions.subspan(first, count)};
        if (!piece.normals.empty()) part.normals = piece.normals.subspan(first, count);
        if (!piece.colors.empty()) part.colors = piece.colors.subspan(first, count);
        scalars.clear();
        for (const VertexScalars& own : piece.scalars) scalars.push_back({own.name, own.values.subspan(first, count)});
        give(part, scalars);
        part.scalars = scalars;
        first += count;
        if (first == all) {
            part.triangles = piece.triangles;
            part.quads = piece.quads;
        }
        next.add(part);
    } while (first < all);
}

}  // namespace strata
