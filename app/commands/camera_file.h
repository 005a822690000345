#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/math/camera.h"
#include "core/math/vec.h"

namespace strata {

/// A camera as a user states it.
struct CameraSpec {
    Vec3d eye = Vec3d::Zero(), target = Vec3d::Zero();  // world
    Vec3d up = Vec3d::UnitZ();
    double fov_deg = 45.0;               // from the bottom to the top of the picture
    std::optional<double> ortho_height;  // world units from the bottom to the top; given: orthographic
};

/// Parses {"eye": [x,y,z], "target": [x,y,z], "up": [x,y,z], "fov": degrees, "ortho_height": units}; the last three may be
/// missing, and ortho_height replaces fov.
/// throws  Error{malformed}: what is expected at which key; keys that do not exist are refused, since they are misspelled
CameraSpec parse_camera(std::string_view json);

/// throws  as parse_camera, naming the file; Error{not_found, io}; Error{limit} when it is far too large for a camera
CameraSpec read_camera_file(const std::string& path);

/// Its near and far planes are still to be set.
Camera camera_of(const CameraSpec& spec);

}  // namespace strata
