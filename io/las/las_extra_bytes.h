#pragma once

#include <vector>

#include "core/cloud/attribute.h"
#include "io/byte_source.h"
#include "io/las/las_header.h"

namespace strata::las {

/// An attribute and where it lies in the point record.
struct ExtraAttribute {
    Attribute attribute;
    uint16_t record_offset = 0;  // bytes
};

/// The attributes that the "extra bytes" record describes (LAS 1.4 R15, section 2.7, table 24). Arrays become components,
/// and so do entries NAME[0], NAME[1], ... that are stored alike; an array whose components are scaled differently becomes
/// an attribute a component. Bytes that no entry describes are left out with a line in `notes`.
/// throws  Error{malformed} when the entries need more bytes than a point has
std::vector<ExtraAttribute> read_extra_bytes(const ByteSource& source, const Header& header, std::vector<std::string>& notes);

}  // namespace strata::las
