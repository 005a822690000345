#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/cloud/point_filter.h"

namespace strata {

/// "xmin,ymin,zmin,xmax,ymax,zmax" with ';' between boxes; a number that is left out is infinite: ",,470,,,480".
/// throws  Error{usage}, naming the flag: not six numbers, not a number, or a least above the most
std::vector<ClipBox> parse_clip_boxes(std::string_view flag, const std::string& text, ClipBox::Action action);

/// "class=2,6;intensity=100:2000;gps-time=5e8:": terms with ';' between them, values and ranges with ','. A range may lack an end.
/// throws  Error{usage}, naming the flag and the term
std::vector<FilterTerm> parse_filter(std::string_view flag, const std::string& text);

}  // namespace strata
