#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/draco/draco_header.h"

namespace strata::drc {

/// The grid on which Draco quantized an attribute: value = min + step * range / (2^bits - 1).
struct Lattice {
    std::array<double, 3> min{};
    double range = 1.0;
    int bits = 1;
};

/// The values of an attribute, a point each.
struct Column {
    AttributeHeader header;  // as decoded: steps of a lattice are int32
    std::vector<std::byte> values;
    std::optional<Lattice> lattice;  // of positions that are steps
};

struct DecodedPoints {
    uint64_t points = 0;
    std::vector<Column> columns;  // in the order of the file
};

/// Decodes all of a file, the vertices of a mesh as points; positions that Draco quantized stay steps of their grid.
/// name    for messages
/// throws  Error{malformed}: Draco cannot decode it; Error{limit}: more memory than its size explains
DecodedPoints decode(std::span<const std::byte> bytes, const Header& header, const std::string& name);

}  // namespace strata::drc
