#include "core/surface/vertex_positions.h"

namespace strata {

void VertexPositions::append(const SurfacePiece& piece) {
    for (size_t done = 0; done < piece.positions.size();)
        for (Vec3d& place : places_.grow(piece.positions.size() - done)) place = piece.origin + piece.positions[done++].cast<double>();
}

}  // namespace strata
