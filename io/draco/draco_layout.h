#pragma once

#include <string_view>

namespace strata::drc {

// What strata writes into Draco's metadata, and honors when kLayout is there. Vectors are three numbers side by side.
// Geometry:
inline constexpr std::string_view kLayout = "strata";      // int32: 1
inline constexpr std::string_view kScale = "scale";        // double[3]; world = offset + scale * POSITION
inline constexpr std::string_view kOffset = "offset";      // double[3]
inline constexpr std::string_view kMin = "min";            // double[3]: world bounds of the points
inline constexpr std::string_view kMax = "max";            // double[3]
inline constexpr std::string_view kMaxError = "max_error";  // double[3]: how far an axis of a point may be off
inline constexpr std::string_view kCrs = "crs";            // text
// Where rounding POSITION brings back the source's own integers: quanta = origin + round(scale * POSITION / grid_scale),
// world = grid_offset + grid_scale * quanta. Else the quanta are the steps of POSITION.
inline constexpr std::string_view kGridScale = "grid_scale";    // double[3]
inline constexpr std::string_view kGridOffset = "grid_offset";  // double[3]
inline constexpr std::string_view kGridOrigin = "grid_origin";  // int32[3]
// Attribute:
inline constexpr std::string_view kName = "name";                // text; other programs write it too
inline constexpr std::string_view kDescription = "description";  // text
inline constexpr std::string_view kType = "type";                // text, as scalar_name has it: the type of the source
inline constexpr std::string_view kValueScale = "value_scale";   // double; value = stored * value_scale + value_offset
inline constexpr std::string_view kValueOffset = "value_offset";  // double
inline constexpr std::string_view kNoData = "no_data";           // double: the stored value for "none"
// Scalars that Draco cannot compress, among them all of 64 bits, are split: the bits of each, as an unsigned integer, minus
// those of the point before it, signs interleaved (0, -1, 1, -2, ... as 0, 1, 2, 3, ...), in words of 16 bits, an attribute
// each. Word 0 is the lowest.
inline constexpr std::string_view kWord = "word";  // int32: which word this attribute is

}  // namespace strata::drc
