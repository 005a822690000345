#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace strata {

/// A decoded picture: RGBA pixels, red in the lowest byte, top row first.
struct PngPicture {
    uint32_t width = 0, height = 0;
    std::vector<uint32_t> rgba;  // [width * height]
};

/// Pixels that a picture may have before it is decoded: 16384 x 16384, the largest that strata writes.
inline constexpr uint64_t kPngPixelLimit = uint64_t{1} << 28;

/// Reads any PNG; gray, palette, 16 bits, tRNS and interlace become 8-bit RGBA. Color profiles and gamma are not applied.
/// throws  Error{not_found, io}; Error{limit} above kPngPixelLimit; Error{malformed}: what libpng says, naming the file
PngPicture decode_png(const std::string& path);

}  // namespace strata
