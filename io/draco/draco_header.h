#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "io/byte_source.h"

namespace strata::drc {

/// What an attribute means to Draco.
enum class AttributeKind : uint8_t { position, normal, color, texture, generic, tangent, material, joints, weights };

/// What a file says of one attribute.
struct AttributeHeader {
    AttributeKind kind = AttributeKind::generic;
    ScalarType type = ScalarType::uint8;
    int components = 1;
    bool normalized = false;  // integers stand for 0 to 1, or -1 to 1
    uint32_t id = 0;          // by which metadata names it

    size_t size_bytes() const { return scalar_size(type) * size_t(components); }  // of one point
};

/// Draco's metadata: values without a type, by name.
using Entries = std::map<std::string, std::vector<std::byte>, std::less<>>;

/// What stands before the compressed values.
struct Header {
    int major_version = 0, minor_version = 0;
    bool mesh = false;
    std::string method;                       // "sequential", "kd-tree", "edgebreaker"
    uint64_t points = 0;                      // of a mesh: the most there can be, three a face
    uint64_t faces = 0;
    std::vector<AttributeHeader> attributes;  // of points; those of a mesh stand behind its faces
    Entries metadata;
    std::map<uint32_t, Entries> attribute_metadata;  // by AttributeHeader::id
};

/// Reads the header of a Draco file and holds its counts against the size of the file, so that Draco, which allocates by
/// them and counts on by them, may be let at it.
/// throws  Error{malformed, unsupported, limit, io}: file, byte, expectation
/// source  "Draco Bitstream Specification" 2.2; the point clouds of 2.3 differ in their kd-tree
Header read_header(const ByteSource& bytes);

/// The most memory that decoding a file of so many bytes may take. Real files hold their points in bits, equal ones in
/// none; a few bytes that ask for gigabytes lie.
uint64_t allowed_bytes(uint64_t file_bytes);

/// Memory that decoding so many points takes at most: values, those before they are quantized back, maps.
uint64_t decoding_bytes(uint64_t points, const std::vector<AttributeHeader>& attributes);

/// The scalar of a Draco data type, 1 to 11; none: there is no such type. bool is uint8.
std::optional<ScalarType> scalar_of_data_type(int type);

}  // namespace strata::drc
