#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/box.h"
#include "core/surface/surface_sink.h"
#include "core/surface/vertex_positions.h"
#include "io/output_file.h"

namespace strata {

/// What is known of a surface before its first piece comes.
struct SurfaceWriteSettings {
    bool overwrite = false;
    bool normals = false;                 // pieces have them
    bool colors = false;                  // likewise
    std::vector<std::string> scalars;     // names of those that pieces have
    Box3d bounds;                         // world; vertices lie there, or not far from it
    double edge = 0.0;                    // world units: of a typical length; 0: not known
    std::string scratch_folder;           // for faces that wait until all vertices are written
    VertexPositions* positions = nullptr; // of all vertices up to those of the piece that is added; needed by STL
};

/// A mesh file that a surface goes to, piece after piece, through buffers of a few MiB.
class SurfaceWriter : public SurfaceSink {
public:
    /// Gives the file its name. Once.
    /// returns  its bytes
    virtual uint64_t commit(Durability durability) = 0;
    /// Else they become two triangles each.
    virtual bool keeps_quads() const { return true; }
    /// What the format cannot hold as it was; a line each. After the last piece.
    virtual std::vector<std::string> notes() const { return {}; }
};

/// Whether a name ends in .ply, .obj, .stl or .glb.
bool is_surface_name(const std::string& path);

/// Names of attributes as a format can have them: letters, digits and _ - . : of ASCII, no two alike and none in `taken`, at most 80
/// bytes each.
std::vector<std::string> plain_names(const std::vector<std::string>& names, std::span<const std::string_view> taken);

/// PLY, binary: positions as float, or double where a float would lose more than 1/1000 of an edge; quads stay quads.
///      Attributes are properties of vertices, float.
/// OBJ: digits to 1/100000 of an edge, colors behind positions; quads stay quads.
/// STL, binary: world coordinates as float.
/// GLB: glTF 2.0 in one file; positions less the first piece's origin, which is the translation of its node; y is up there. Attributes are
///      those of vertices whose names begin with _; where one is unknown, it is 0.
/// throws  Error{io}: the output; Error{limit}: more than the format holds
std::unique_ptr<SurfaceWriter> make_surface_writer(const std::string& path, const SurfaceWriteSettings& settings);

// One format each.
std::unique_ptr<SurfaceWriter> make_ply_writer(const std::string& path, const SurfaceWriteSettings& settings);
std::unique_ptr<SurfaceWriter> make_obj_writer(const std::string& path, const SurfaceWriteSettings& settings);
std::unique_ptr<SurfaceWriter> make_stl_writer(const std::string& path, const SurfaceWriteSettings& settings);
std::unique_ptr<SurfaceWriter> make_glb_writer(const std::string& path, const SurfaceWriteSettings& settings);

/// The largest error of world coordinates as floats.
double float_error(const Box3d& bounds);

}  // namespace strata
