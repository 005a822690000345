#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/byte_stream.h"

namespace strata::ply {

enum class Encoding { ascii, little_endian, big_endian };
enum class Scalar : uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

inline size_t size_of(Scalar scalar) {
    constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return kSizes[size_t(scalar)];
}
inline bool is_integer(Scalar scalar) { return scalar < Scalar::float32; }

struct Property {
    std::string name;
    Scalar type = Scalar::float32;  // of a value, or of the list's values
    bool is_list = false;
    Scalar count_type = Scalar::uint8;  // of a list's length
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
};

struct Header {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;  // in the order of their data
};

/// Reads from the file's first byte to the first byte of data. The counts fit the bytes that are left.
/// throws  Error{malformed, unsupported}
/// source  G. Turk, "The PLY Polygon File Format", 1994, with the names of types that later writers use
Header read_header(ByteStream& stream);

}  // namespace strata::ply
