#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/surface/triangle_mesh.h"
#include "io/byte_source.h"

namespace strata {

struct MeshReadSettings {
    uint64_t most_bytes = std::numeric_limits<uint64_t>::max();  // of memory, while it is read
    bool triangles_needed = false;                               // a mesh without triangles is an error
    bool scalars = false;                                        // other values of vertices are kept, too, where the format has some
};

/// What a file says of its mesh beside the mesh, and what was done with it.
struct MeshReport {
    std::string format;              // "PLY, ASCII"
    uint64_t faces = 0;              // polygons in the file; each becomes a fan of triangles around its first corner or, where
                                     // that would leave the polygon, triangles within (concave_faces.h); in any order of the file
    std::vector<std::string> notes;  // what was left out, a line each
};

/// Reads a mesh: Wavefront OBJ, STL, or PLY, by its content. The file goes through a small buffer.
/// Vertices: as the file has them, those that no triangle uses as well; those of STL, which has none, are the distinct corners. A
/// vertex without a finite position is left out with the triangles that use it, and a note counts both. Normals and colors:
/// those of vertices; where corners of OBJ have their own, the mean direction of a vertex's corners,
/// or zero, not known, where one is more than 20 degrees from the mean of those before it, as at the edges of a cube. Other values: single numbers that PLY has of vertices, but texture coordinates; the first 32.
/// report  where not null, gets what the file says
/// throws  Error{not_found, io, unsupported}
///         Error{malformed}: the line or byte, and what was expected
///         Error{limit}: more memory than allowed, with the bytes needed; more than 2^32 - 1 vertices or triangles
TriangleMesh read_mesh(const std::string& path, const MeshReadSettings& settings = {}, MeshReport* report = nullptr);

// One format each, whatever the source is called. Without triangles it is a mesh here, too.
TriangleMesh read_obj(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report);
TriangleMesh read_stl(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report);
TriangleMesh read_ply(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report);

/// Whether a file of that size is a binary STL by its count of triangles.
/// head  the first 84 bytes or more
bool is_binary_stl(std::string_view head, uint64_t size);

}  // namespace strata
