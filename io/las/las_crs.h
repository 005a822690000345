#pragma once

#include <string>

#include "io/byte_source.h"
#include "io/las/las_header.h"

namespace strata::las {

/// The coordinate reference system as text: WKT where the file has it, else "EPSG:n" from its GeoTIFF keys, else the
/// name that the keys cite, else empty. Damaged keys are no reason to refuse the points: they become a line in `notes`.
std::string read_crs(const ByteSource& source, const Header& header, std::vector<std::string>& notes);

}  // namespace strata::las
