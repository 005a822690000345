#include "app/commands/info_json.h"

#include <nlohmann/json.hpp>

namespace strata {

using nlohmann::ordered_json;

ordered_json vector_json(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json box_json(const Box3d& box) {
    if (box.empty()) return {{"min", nullptr}, {"max", nullptr}};
    return {{"min", vector_json(box.min)}, {"max", vector_json(box.max)}};
}

void add_surface(const SurfaceReport& surface, bool is_closed, ordered_json& report) {
    report.update({{"components", surface.components},
                   {"boundary_edges", surface.boundary_edges},
                   {"nonmanifold_edges", surface.nonmanifold_edges},
                   {"flipped_edges", surface.flipped_edges},
                   {"euler_characteristic", surface.euler_characteristic},
                   {"degenerate_faces", surface.degenerate_faces},
                   {"unused_vertices", surface.unused_vertices},
                   {"area", surface.area},
                   {"volume", is_closed ? ordered_json(surface.volume) : ordered_json()}});
}

}  // namespace strata
