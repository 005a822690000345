#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "io/byte_reader.h"

namespace strata {

/// The coordinate reference system that GeoTIFF keys describe (OGC GeoTIFF 1.1, and what LAS writers make of it): "EPSG:n" or
/// "EPSG:h+v" where codes say all, WKT 1 where parameters or units of the file's own come in, the citation where that cannot be
/// translated, empty where there is none. Without PROJ's database codes are taken unseen.
/// directory  record 34735, all of it; the reader's place is for messages
/// doubles    record 34736, texts  record 34737; may be empty, and be damaged
/// notes      gets a line for what was odd or is left out
/// throws     Error{malformed}: a directory that does not hold its keys
std::string crs_of_geotiff_keys(ByteReader directory, std::span<const std::byte> doubles, std::span<const std::byte> texts,
                                std::vector<std::string>& notes);

}  // namespace strata
