#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace strata {

enum class ScalarType : uint8_t { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

/// Bytes of one scalar: 1, 2, 4 or 8.
size_t scalar_size(ScalarType type);
/// The name in metadata and reports: "int8" ... "uint64", "float", "double" (those of Potree 2.0).
std::string_view scalar_name(ScalarType type);
/// The scalar at `bytes` as a double (64-bit integers beyond 2^53 are rounded). `bytes` need not be aligned.
double load_scalar(ScalarType type, const std::byte* bytes);

/// A named array beside position: intensity, classification, GPS time, rgb, ...
struct Attribute {
    std::string name;         // LAS attributes use the names of Potree 2.0; extra bytes keep their own
    std::string description;  // may be empty
    ScalarType type = ScalarType::uint8;
    int components = 1;  // 3 for rgb
    double scale = 1.0;  // value = stored * scale + offset; 1 and 0 unless extra bytes say otherwise
    double offset = 0.0;
    double no_data = std::numeric_limits<double>::quiet_NaN();  // the stored value that stands for "none"; NaN: there is no such value

    size_t size_bytes() const { return scalar_size(type) * size_t(components); }  // of one point
};

namespace attribute_name {
// Names that Potree 2.0 readers know; every reader maps its own fields to these.
inline constexpr std::string_view kIntensity = "intensity";
inline constexpr std::string_view kReturnNumber = "return number";
inline constexpr std::string_view kNumberOfReturns = "number of returns";
/// LAS 1.4 byte: bits 0-3 synthetic, key point, withheld, overlap; 4-5 scanner channel; 6 scan direction; 7 edge of flight line.
inline constexpr std::string_view kClassificationFlags = "classification flags";
inline constexpr std::string_view kClassification = "classification";
inline constexpr std::string_view kScanAngleRank = "scan angle rank";  // int8 degrees, point formats 0 to 5
inline constexpr std::string_view kScanAngle = "scan angle";           // int16 in 0.006 degrees, point formats 6 to 10
inline constexpr std::string_view kUserData = "user data";
inline constexpr std::string_view kPointSourceId = "point source id";
inline constexpr std::string_view kGpsTime = "gps-time";
inline constexpr std::string_view kRgb = "rgb";
inline constexpr std::string_view kNearInfrared = "nir";
inline constexpr std::string_view kNormal[3] = {"NormalX", "NormalY", "NormalZ"};
inline constexpr std::string_view kDensity = "density";  // points per square unit of surface
}  // namespace attribute_name

/// Index of the attribute of that name, or -1.
int find_attribute(const std::vector<Attribute>& attributes, std::string_view name);

/// The attribute that a short name of the command line stands for ("class", "return", "source"); other names as they are.
std::string_view full_attribute_name(std::string_view name);

struct AttributeComponent {
    int attribute = -1;  // index
    int component = 0;
};

/// Finds what a user names: an attribute, by its own or a short name, or as NAME[1] a component of one that has several.
/// others  what else may be named there, for the message
/// throws  Error{usage}: there is no such attribute, and these are there; or a component must be chosen
AttributeComponent find_component(const std::vector<Attribute>& attributes, std::string_view name, std::string_view others);

}  // namespace strata
