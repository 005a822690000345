#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// Several clouds as one. Per axis the finest scale wins, and the offset of the first cloud, so that integers stay what
/// they are, up to a whole shift, where scales agree. Attributes are the union by name: a cloud that lacks one has zeros
/// there; where type or scale differ the column becomes double, of true values. Color that some hold in 8 of 16 bits and
/// others in 16 is widened to 16: this, and nothing else, reads points when it is called. Points of LAS formats 0 to 5 among
/// those of 6 to 10 are promoted: ranks become scan angles, class 12 becomes class 1 with the overlap flag, and a note says so.
/// names   one a source, for messages; a note that several have is said once, with the first name and how many more
/// throws  Error{limit} when the clouds lie too far apart for int32 quanta; what the sources throw
std::unique_ptr<PointSource> merge_sources(std::vector<std::unique_ptr<PointSource>> sources, std::vector<std::string> names);

}  // namespace strata
