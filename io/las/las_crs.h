#pragma once

#include "core/cloud/point_source.h"
#include "io/byte_source.h"
#include "io/las/las_header.h"

namespace strata::las {

/// Puts the coordinate reference system into `info`: as `crs` WKT where the file has it, else what its GeoTIFF keys say
/// (crs_of_geotiff_keys), else nothing; as `crs_records` the records of its keys, as they are. Damaged keys are no reason to refuse
/// the points: they become a line in `notes`.
void read_crs(const ByteSource& source, const Header& header, CloudInfo& info);

}  // namespace strata::las
