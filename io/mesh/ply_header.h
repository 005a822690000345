#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/byte_stream.h"

namespace strata::ply {

/// Names of properties that have a meaning to the reader. Its other properties of vertices are attributes, which the writer calls otherwise,
/// so that they are read back as what they are.
inline constexpr std::array<std::string_view, 22> kNamesWithMeaning = {
    "x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha",
    "u", "v", "s", "t", "texture_u", "texture_v", "vertex_indices", "vertex_index"};
inline constexpr int kDiffuse = 10, kTexture = 14, kCornerList = 20;  // where others than places, normals and colors begin there

/// The place of a name there, kNamesWithMeaning.size() of any other.
inline int meaning_of(std::string_view name) { return int(std::find(kNamesWithMeaning.begin(), kNamesWithMeaning.end(), name) - kNamesWithMeaning.begin()); }

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
