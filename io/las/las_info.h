#pragma once

#include <string>
#include <vector>

#include "core/cloud/point_source.h"
#include "io/byte_source.h"
#include "io/las/las_columns.h"
#include "io/las/las_header.h"

namespace strata::las {

/// What a LAS or LAZ file says of its points.
/// container  "las" or "laz"; the version and the point format are put behind it
/// notes      those of the header and of the extra bytes
CloudInfo cloud_info(const ByteSource& source, const Header& header, const Columns& columns, const std::string& container, std::vector<std::string> notes);

}  // namespace strata::las
