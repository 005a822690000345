#include "io/mesh/mesh_reader.h"

#include "core/error.h"
#include "io/format.h"

namespace strata {

TriangleMesh read_mesh(const std::string& path, const MeshReadSettings& settings, MeshReport* report) {
    const Format& format = identify_format(path);
    if (format.kind != FormatKind::mesh)
        throw Error(ErrorKind::unsupported, path + ": " + std::string(format.name) + " (" + std::string(format.description) + "): a mesh is expected here");
    MeshReport own;
    MeshReport& said = report ? *report : own;
    const std::unique_ptr<ByteSource> source = open_file(path);
    const auto read = format.name == "obj" ? read_obj : format.name == "stl" ? read_stl : read_ply;
    TriangleMesh mesh = read(*source, settings, said);
    if (settings.triangles_needed && mesh.triangles.empty()) {
        std::string line = path + ": triangles are expected, there are " + std::to_string(mesh.positions.size()) + " vertices without any" + (mesh.positions.empty() ? "" : "; points are read from LAS, LAZ, COPC, Potree and Draco files");
        for (const std::string& note : said.notes) line += "; " + note;
        throw Error(ErrorKind::malformed, line);
    }
    return mesh;
}

}  // namespace strata
