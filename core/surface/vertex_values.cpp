#include "core/surface/vertex_values.h"

#include "core/surface/surface_parts.h"

namespace strata {

void SurfaceWithValues::add(const SurfacePiece& piece) {
    hand_on_in_parts(piece, kMostVertices, next_, [&](SurfacePiece& part, std::vector<VertexScalars>& scalars) {
        const size_t count = part.positions.size();
        for (Attribute& attribute : values_) {
            attribute.values.resize(count);
            attribute.source->look_up(part.origin, part.positions, attribute.values);
            scalars.push_back({attribute.name, attribute.values});
        }
        if (!colors_) return;
        found_.resize(count);
        colors_->look_up(part.origin, part.positions, found_);
        part.colors = found_;
    });
}

void SurfaceWithValues::finish() {
    for (Attribute& attribute : values_) attribute.source->finish();
}

}  // namespace strata
