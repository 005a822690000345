#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/box.h"
#include "core/surface/scalar_field.h"
#include "io/byte_stream.h"

namespace strata {

enum class SampleType : uint8_t { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

constexpr size_t size_of(SampleType type) {
    constexpr std::array<size_t, 10> kSizes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return kSizes[size_t(type)];
}
/// "int16", "float", "double"
std::string_view name_of(SampleType type);
std::optional<SampleType> sample_type_named(std::string_view name);

/// How samples are stored.
enum class VolumeEncoding : uint8_t {
    raw,
    deflated,  // by zlib or gzip
    text,      // numbers with blanks between
};

/// What the header of a volume file says: where its samples lie in the world and in which bytes of which file.
struct VolumeHeader {
    std::string format;                        // "MetaImage"
    std::array<uint32_t, 3> size = {0, 0, 0};  // samples an axis; the product in bytes fits 63 bits
    GridPlacement placement;
    SampleType type = SampleType::uint8;
    bool is_big_endian = false;
    VolumeEncoding encoding = VolumeEncoding::raw;

    std::string data_file;                     // of the samples, beside the header's; empty: the header's own
    uint64_t offset = 0;                       // there, of the samples
    uint64_t lines_before = 0;                 // lines to step over, from `offset`
    uint64_t bytes_before = 0;                 // then, after decompression, bytes to step over
    bool more_follows = false;                 // behind the samples there may be others
    bool is_at_end = false;                    // the samples are the last bytes of the file; `offset` says nothing
    std::optional<uint64_t> stored_bytes;      // of deflated samples, where the header says so
    std::vector<std::string> notes;            // what is odd, a line each

    uint64_t samples() const { return uint64_t{size[0]} * size[1] * size[2]; }
    uint64_t sample_bytes() const { return samples() * size_of(type); }
    /// World: of the places of samples, and of what is `beyond` steps farther out.
    Box3d box_around(double beyond = 0.0) const;
};

// One format each. The stream is at the file's first byte.
// throws  Error{malformed, unsupported}, naming the line
VolumeHeader read_metaimage_header(ByteStream& stream);
VolumeHeader read_nrrd_header(ByteStream& stream);
VolumeHeader read_vtk_header(ByteStream& stream);

/// Whether a file begins like that.
bool looks_like_metaimage(std::string_view head);
bool looks_like_nrrd(std::string_view head);
bool looks_like_vtk(std::string_view head);

/// Sets the sizes of a header.
/// throws  Error{malformed}: not 1 to 2^32 - 1 samples an axis, or 2^63 bytes and more
void set_size(VolumeHeader& header, const std::array<uint64_t, 3>& size, const std::string& place);

/// throws  Error{malformed}: steps that are zero, not finite, or beyond what can be computed with; steps in one plane
void check_placement(const GridPlacement& placement, const std::array<uint32_t, 3>& size, const std::string& place);

/// The whole number that a line of a header says.
/// throws  Error{malformed}, naming the line: no number, or not from least to most
int64_t integer_of(const ByteStream& stream, std::string_view value, int64_t least, int64_t most);

/// A step along an axis as a file says it.
/// throws  Error{malformed}: zero, negative or not finite
double checked_spacing(double spacing, const std::string& place);

/// The name of a file of samples, which may only lie in the folder of its header or below.
/// throws  Error{unsupported}
std::string checked_data_file(std::string_view name, const std::string& place);

}  // namespace strata
