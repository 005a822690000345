#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/surface/triangle_mesh.h"
#include "io/mesh/mesh_memory.h"

namespace strata {

/// Faces of a file whose fan of triangles around the first corner would leave the polygon, as of an L. They are cut anew, in place, into as many
/// triangles, by clipping ears in the plane of their normal; all others keep their fan.
/// cost    one look at the fan; of one that is cut anew, up to corners * (1 + corners that turn inwards)
/// source  G. Meisters, "Polygons have Ears", American Mathematical Monthly 82, 1975; the normal is that of M. Newell
class ConcaveFaces {
public:
    explicit ConcaveFaces(MeshMemory& memory) : memory_(memory) {}

    /// The mesh's triangles from `begin` on are the fan of one face.
    /// placed  its vertices have been read; else it waits for finish()
    void add_fan(TriangleMesh& mesh, size_t begin, bool placed);
    /// All vertices have been read.
    void finish(TriangleMesh& mesh, std::vector<std::string>& notes);

private:
    MeshMemory& memory_;
    std::vector<std::array<uint32_t, 2>> waiting_;  // first triangle and number of triangles
    uint64_t too_long_ = 0;                         // faces
};

}  // namespace strata
