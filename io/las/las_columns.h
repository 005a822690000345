#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "io/las/las_extra_bytes.h"

namespace strata::las {

/// Fills one column from `count` records that lie `stride` bytes apart. field: that of the first record; size: bytes a point
using DecodeColumn = void (*)(const std::byte* field, size_t stride, size_t count, size_t size, std::byte* out);

/// The attributes of a point format, and how each gets from records to its column.
class Columns {
public:
    /// extra  attributes after those of the format; their names are changed where they meet one that is taken
    Columns(int point_format, size_t record_size, const std::vector<ExtraAttribute>& extra);

    const std::vector<Attribute>& attributes() const { return attributes_; }

    /// The byte of the record at which the attribute begins.
    size_t record_offset(size_t attribute) const { return sources_[attribute].record_offset; }

    /// Decodes records into rows first ... of a batch that is sized for them: positions and the wanted attributes.
    void decode(std::span<const std::byte> records, std::span<const int> wanted, size_t first, PointBatch& out) const;

private:
    struct Source {
        DecodeColumn decoder;
        uint16_t record_offset;
    };
    void add(Attribute attribute, DecodeColumn decoder, size_t record_offset);

    size_t record_size_;
    std::vector<Attribute> attributes_;
    std::vector<Source> sources_;  // one per attribute
};

}  // namespace strata::las
