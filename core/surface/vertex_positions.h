#pragma once

#include <cstdint>

#include "core/math/vec.h"
#include "core/surface/paged_array.h"
#include "core/surface/surface_sink.h"

namespace strata {

/// The places of a surface's vertices by number, of which only some are in memory: faces of a surface that grows refer to the vertices of
/// late, and to any.
class VertexPositions {
public:
    /// scratch, memory_bytes  as of a PagedArray
    VertexPositions(ScratchRoom* scratch, uint64_t memory_bytes) : places_(scratch, memory_bytes) {}

    void append(const SurfacePiece& piece);
    uint64_t size() const { return places_.size(); }
    /// Where a vertex is, world.
    Vec3d operator[](uint32_t vertex) { return places_[vertex]; }

private:
    PagedArray<Vec3d, 8'192> places_;
};

}  // namespace strata
