#pragma once

#include <string>

#include "core/math/vec.h"

namespace strata {

/// Where the pixels of a picture lie on the map, for a view straight down.
struct PictureGeoreference {
    Vec2d right_step = {1, 0};   // CRS units from a pixel to its right neighbor
    Vec2d down_step = {0, -1};   // CRS units from a pixel to the one below
    Vec2d first_center = {0, 0};  // of the top left pixel
};

/// The six lines of an ESRI world file, each number with the digits that bring the same double back.
std::string world_file_text(const PictureGeoreference& georeference);

/// Where GIS programs look for it: "shot.png" has "shot.pgw".
std::string world_file_path(const std::string& png_path);

/// throws  Error{usage} when the file exists and `overwrite` is false, Error{io}
void write_world_file(const std::string& path, const PictureGeoreference& georeference, bool overwrite);

}  // namespace strata
