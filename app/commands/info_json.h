#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/math/box.h"
#include "core/math/vec.h"

namespace strata {

// How the reports of `strata info` say vectors and boxes. NaN and infinity become null.
nlohmann::ordered_json vector_json(const Vec3d& v);
nlohmann::ordered_json box_json(const Box3d& box);  // an empty one has null for both corners

}  // namespace strata
