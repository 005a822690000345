#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/math/box.h"
#include "core/math/quantization.h"

namespace strata {

/// How a node's points lie in octree.bin.
enum class PotreeEncoding {
    plain,   // "DEFAULT": packed records, attributes in the order of metadata.json
    brotli,  // "BROTLI": one Brotli stream a node; columns in the same order, position and rgb as Morton codes
};

/// One entry of metadata.json's "attributes": where its bytes lie.
struct PotreeField {
    int attribute = -1;         // index into PotreeMetadata::attributes; -1: the position
    size_t size_bytes = 0;      // of one point, as declared
    size_t record_offset = 0;   // in a packed record
    size_t packed_bytes = 0;    // of one point in a Brotli column: 16 for position, 8 for rgb, else as declared
    bool rgb_morton = false;    // the Brotli column holds interleaved colors
};

/// What metadata.json says, checked.
struct PotreeMetadata {
    std::string name;
    std::string projection;  // free text: WKT or proj4
    uint64_t points = 0;
    uint64_t first_chunk_bytes = 0;  // of hierarchy.bin
    double spacing = 0.0;            // of the root, world units; positive
    Quantization quantization;
    Box3d cube;   // of the root
    Box3d tight;  // of the points, as stated; the cube where nothing is stated
    PotreeEncoding encoding = PotreeEncoding::plain;
    std::vector<Attribute> attributes;  // all but the position
    std::vector<std::vector<double>> attribute_min, attribute_max;  // [attribute][component], stored values; empty: unknown
    std::vector<PotreeField> fields;    // in file order, the position among them
    size_t record_bytes = 0;            // of one point, packed
    size_t column_bytes = 0;            // of one point, as Brotli columns
};

inline constexpr uint64_t kMostMetadataBytes = uint64_t{2} << 20;  // a JSON tree in memory is some 50 times its text

/// Parses and checks metadata.json.
/// throws  Error{malformed, unsupported} naming the key, not the file
PotreeMetadata parse_potree_metadata(std::span<const std::byte> text);

}  // namespace strata
