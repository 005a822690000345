#pragma once

#include <cstdint>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata::drc {

/// What all blocks of a cloud have in common: where POSITION is zero, and how far coordinates may be off.
struct BlockFrame {
    Quantization quantization;  // of the source
    Vec3i origin = Vec3i::Zero();  // quanta; POSITION is relative to it
    double max_error = 0.0;  // world units, an axis; 0: half a quantum, see block_frame
    int rgb_bits = 16;  // of the whole cloud: 8 is written as bytes
};

/// The frame of a source; reads points only to learn how many bits its colors use.
/// max_error  world units, the same for each axis. 0: half a quantum, so that the source's own integers come back; but no
///            finer than 2^-25 of what a block extends along the axis, the most steps that Draco compresses
BlockFrame block_frame(const PointSource& source, double max_error, int threads);

struct EncodedBlock {
    std::vector<std::byte> bytes;  // a Draco file
    double worst_error = 0.0;      // world units, an axis: of POSITION as any program decodes it, measured by decoding
    bool exact = false;            // rounding brings back the source's integers
};

/// Encodes points with all their attributes (each column must be there), and decodes them again to see what came of it.
/// throws  Error{limit}: the points span more steps of the error than can be compressed; Error{unsupported}: an attribute
EncodedBlock encode_block(const PointBatch& points, const CloudInfo& info, const BlockFrame& frame);

/// Memory that encode_block takes at most for so many points, besides what it is given.
uint64_t encoding_bytes(uint64_t points, const std::vector<Attribute>& attributes);

}  // namespace strata::drc
