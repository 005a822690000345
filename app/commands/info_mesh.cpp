#include "app/commands/info_mesh.h"

#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "io/mesh/mesh_reader.h"

namespace strata {

using nlohmann::ordered_json;

ordered_json mesh_report(const std::string& path, const Format& format, uint64_t memory_bytes) {
    MeshReport said;
    const TriangleMesh mesh = read_mesh(path, {.most_bytes = memory_bytes}, &said);
    ordered_json report = {{"path", path}, {"format", format.name}, {"detail", said.format}, {"vertices", mesh.positions.size()},
                           {"triangles", mesh.triangles.size()}, {"faces", said.faces}, {"bounds", box_json(mesh.bounds())},
                           {"attributes", ordered_json::array()}};
    const auto add = [&](const char* name, const char* type, int components) {
        report["attributes"].push_back({{"name", name}, {"type", type}, {"components", components}, {"min", nullptr}, {"max", nullptr}});
    };
    if (!mesh.normals.empty()) add("normal", "float", 3);
    if (!mesh.colors.empty()) add("color", "uint8", 4);
    if (!said.notes.empty()) report["notes"] = said.notes;
    return report;
}

}  // namespace strata
