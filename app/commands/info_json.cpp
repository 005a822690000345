#include "app/commands/info_json.h"

#include <nlohmann/json.hpp>

namespace strata {

using nlohmann::ordered_json;

ordered_json vector_json(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json box_json(const Box3d& box) {
    if (box.empty()) return {{"min", nullptr}, {"max", nullptr}};
    return {{"min", vector_json(box.min)}, {"max", vector_json(box.max)}};
}

}  // namespace strata
