#include "app/commands/info_mesh.h"

#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "core/error.h"
#include "core/surface/scalar_ranges.h"
#include "core/surface/surface_report.h"
#include "io/mesh/mesh_reader.h"

namespace strata {

using nlohmann::ordered_json;

ordered_json mesh_report(const std::string& path, const Format& format, bool exact, uint64_t memory_bytes) {
    MeshReport said;
    const TriangleMesh mesh = read_mesh(path, {.most_bytes = memory_bytes, .scalars = true}, &said);
    ordered_json report = {{"path", path}, {"format", format.name}, {"detail", said.format}, {"vertices", mesh.positions.size()},
                           {"triangles", mesh.triangles.size()}, {"faces", said.faces}, {"bounds", box_json(mesh.bounds())},
                           {"attributes", ordered_json::array()}};
    const auto add = [&](const char* name, const char* type, int components) {
        report["attributes"].push_back({{"name", name}, {"type", type}, {"components", components}, {"min", nullptr}, {"max", nullptr}});
    };
    if (!mesh.normals.empty()) add("normal", "float", 3);
    if (!mesh.colors.empty()) add("color", "uint8", 4);
    for (const MeshScalars& scalars : mesh.scalars) {
        ScalarRanges::Range range;
        range.add(scalars.values);
        const auto number = [&](float value) { return range.known() ? ordered_json(value) : ordered_json(); };
        report["attributes"].push_back({{"name", scalars.name}, {"type", "float"}, {"components", 1}, {"min", number(range.least)},
                                        {"max", number(range.greatest)}, {"unknown", range.unknown}});
    }
    if (exact) {
        // All edges are kept, 32 bytes a vertex and some that many edges end at; and parts, 5 bytes a vertex.
        const uint64_t needed = mesh.size_bytes() + mesh.positions.size() * 40;
        if (needed > memory_bytes)
            throw Error(ErrorKind::limit, path + ": its surface needs about " + std::to_string(needed) + " bytes of memory to be measured, " + std::to_string(memory_bytes) + " are allowed");
        const SurfaceReport surface = measure_surface(mesh);
        add_surface(surface, surface.triangles > 0 && surface.is_closed(), report);
    }
    if (!said.notes.empty()) report["notes"] = said.notes;
    return report;
}

}  // namespace strata
