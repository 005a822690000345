#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/math/box.h"
#include "core/math/vec.h"
#include "core/surface/surface_report.h"

namespace strata {

// How the reports of `strata info` say vectors and boxes. NaN and infinity become null.
nlohmann::ordered_json vector_json(const Vec3d& v);
nlohmann::ordered_json box_json(const Box3d& box);  // an empty one has null for both corners

/// Adds what a surface is like, but not what it is made of: components, edges, Euler characteristic, area, volume.
/// is_closed  has a volume
void add_surface(const SurfaceReport& surface, bool is_closed, nlohmann::ordered_json& report);

}  // namespace strata
