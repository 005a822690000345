#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace strata {

/// One pixel: red in the lowest byte, then green, blue and alpha; sRGB, alpha straight (not multiplied in).
using Rgba8 = uint32_t;

constexpr Rgba8 make_rgba(uint8_t red, uint8_t green, uint8_t blue, uint8_t alpha = 255) {
    return Rgba8(red) | Rgba8(green) << 8 | Rgba8(blue) << 16 | Rgba8(alpha) << 24;
}
constexpr uint8_t red_of(Rgba8 color) { return uint8_t(color); }
constexpr uint8_t green_of(Rgba8 color) { return uint8_t(color >> 8); }
constexpr uint8_t blue_of(Rgba8 color) { return uint8_t(color >> 16); }
constexpr uint8_t alpha_of(Rgba8 color) { return uint8_t(color >> 24); }

/// A picture in memory, top row first, rows without gaps.
struct Image {
    uint32_t width = 0, height = 0;
    std::vector<Rgba8> pixels;  // [width * height]

    Image() = default;
    Image(uint32_t w, uint32_t h, Rgba8 fill = 0) : width(w), height(h), pixels(size_t(w) * h, fill) {}

    Rgba8& at(uint32_t x, uint32_t y) { return pixels[size_t(y) * width + x]; }
    Rgba8 at(uint32_t x, uint32_t y) const { return pixels[size_t(y) * width + x]; }
    std::span<const Rgba8> row(uint32_t y) const { return {pixels.data() + size_t(y) * width, width}; }
};

/// Every pixel has alpha 255.
bool is_opaque(const Image& image);

/// Writes a whole picture: RGB when it is opaque, else RGBA. Large pictures go row by row through PngWriter instead.
/// throws  Error{usage} when the file exists and `overwrite` is false, Error{io}
void write_png(const std::string& path, const Image& image, bool overwrite, int threads);

/// Reads any PNG: gray, palette and 16 bits become 8-bit RGBA.
/// throws  Error{not_found, malformed, limit, io}, naming the file
Image read_png(const std::string& path);

}  // namespace strata
