#pragma once

#include <cstring>
#include <string>
#include <vector>

#include "core/cloud/point_batch.h"
#include "io/draco/draco_encoder.h"

namespace strata::drc {

/// A metadata entry.
template <typename T>
std::vector<std::byte> bytes_of(const T& value) {
    std::vector<std::byte> bytes(sizeof value);
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
}
std::vector<std::byte> bytes_of(const std::string& text);

/// Columns for the encoder, and about how many bits it will make of them as far as that depends on the order of the points.
struct ColumnSet {
    std::vector<EncoderColumn> columns;
    double bits = 0.0;
};

/// Adds the attributes of a batch, each column of which must be there.
/// rgb_bits  8: the upper bytes of color are all zero and are left out
/// throws    Error{unsupported}: more components than Draco holds
void add_attributes(const PointBatch& points, const std::vector<Attribute>& attributes, int rgb_bits, ColumnSet& set);

/// What a column of values of three components (int32, or float32 in whole steps) takes as differences from point to point.
/// order  of the points; empty: as they are
double position_bits(const EncoderColumn& column, const std::vector<uint32_t>& order);

/// Memory that encoding so many points takes at most, besides what it is given.
uint64_t encoding_bytes(uint64_t points, const std::vector<Attribute>& attributes);

}  // namespace strata::drc
