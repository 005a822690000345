#include "core/surface/vertex_values.h"

#include <algorithm>

namespace strata {

void SurfaceWithValues::add(const SurfacePiece& piece) {
    const size_t all = piece.positions.size();
    size_t first = 0;
    do {
        const size_t count = std::min(kMostVertices, all - first);
        SurfacePiece part = {.origin = piece.origin, .positions = piece.positions.subspan(first, count)};
        if (!piece.normals.empty()) part.normals = piece.normals.subspan(first, count);
        if (!piece.colors.empty()) part.colors = piece.colors.subspan(first, count);
        scalars_.clear();
        for (const VertexScalars& own : piece.scalars) scalars_.push_back({own.name, own.values.subspan(first, count)});
        for (Attribute& attribute : values_) {
            attribute.values.resize(count);
            attribute.source->look_up(part.origin, part.positions, attribute.values);
            scalars_.push_back({attribute.name, attribute.values});
        }
        part.scalars = scalars_;
        if (colors_) {
            found_.resize(count);
            colors_->look_up(part.origin, part.positions, found_);
            part.colors = found_;
        }
        first += count;
        if (first == all) {
            part.triangles = piece.triangles;
            part.quads = piece.quads;
        }
        next_.add(part);
    } while (first < all);
}

void SurfaceWithValues::finish() {
    for (Attribute& attribute : values_) attribute.source->finish();
}

}  // namespace strata
