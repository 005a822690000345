#pragma once

#include <cstddef>
#include <vector>

#include "io/draco/draco_decoder.h"

namespace strata::drc {

/// An attribute for the encoder, a value a point.
struct EncoderColumn {
    AttributeHeader header;  // ids are given by the encoder: 0, 1, ...
    std::vector<std::byte> values;
    bool delta = false;  // integers: coded as differences from the point before
    int bits = 0;        // positions of float32: steps of a power of two, all below 2^bits
    float step = 0.0f;
    Entries metadata;    // values must not be empty
};

/// Encodes points in their order (Draco's sequential method). Integers come back as they are, floats too: where `bits` is
/// given they must lie on a grid of `step` that float32 holds exactly, so that Draco's own arithmetic is exact.
/// throws  Error{unsupported}: Draco cannot
std::vector<std::byte> encode(uint32_t points, const std::vector<EncoderColumn>& columns, const Entries& metadata);

}  // namespace strata::drc
