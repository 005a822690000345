#include "io/png/png_reader.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <csetjmp>

#include "core/error.h"
#include "io/byte_source.h"

namespace strata {
namespace {

// What libpng's callbacks need. Errors leave libpng by longjmp, as it wants, over frames without destructors only.
struct Decoder {
    const ByteSource& source;
    uint64_t offset = 0;
    std::string message;
    png_structp png = nullptr;
    png_infop info = nullptr;

    explicit Decoder(const ByteSource& s) : source(s) {}
    Decoder(const Decoder&) = delete;
    Decoder& operator=(const Decoder&) = delete;
    ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }
};

void on_error(png_structp png, png_const_charp message) {
    static_cast<Decoder*>(png_get_error_ptr(png))->message = message;
    png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

void on_read(png_structp png, png_bytep out, size_t size) {
    Decoder& decoder = *static_cast<Decoder*>(png_get_io_ptr(png));
    try {
        decoder.source.read(decoder.offset, {reinterpret_cast<std::byte*>(out), size});
        decoder.offset += size;
        return;
    } catch (const Error&) {
    }
    png_error(png, decoder.offset + size > decoder.source.size() ? "the file ends too early" : "reading failed");
}

// returns false when libpng gave up, as the others do
bool read_header(Decoder& decoder) {
    if (setjmp(png_jmpbuf(decoder.png))) return false;
    png_set_user_limits(decoder.png, 0x7fffffff, 0x7fffffff);  // pixels are limited by the caller, sides by the format
    png_set_chunk_malloc_max(decoder.png, 8 << 20);            // compressed text and profiles that unpack to gigabytes
    png_read_info(decoder.png, decoder.info);
    return true;
}

// As 8-bit RGBA. libpng takes memory for two rows here, and fills one: only once the width is believed.
bool start_rows(Decoder& decoder) {
    if (setjmp(png_jmpbuf(decoder.png))) return false;
    png_set_expand(decoder.png);
    png_set_strip_16(decoder.png);
    png_set_gray_to_rgb(decoder.png);
    png_set_add_alpha(decoder.png, 0xff, PNG_FILLER_AFTER);
    png_set_interlace_handling(decoder.png);
    png_read_update_info(decoder.png, decoder.info);
    return true;
}

bool read_pixels(Decoder& decoder, png_bytepp rows) {
    if (setjmp(png_jmpbuf(decoder.png))) return false;
    png_read_image(decoder.png, rows);
    png_read_end(decoder.png, nullptr);
    return true;
}

}  // namespace

PngPicture decode_png(const std::string& path) {
    const std::unique_ptr<ByteSource> source = open_file(path);
    const auto malformed = [&](const Decoder& decoder) {
        return Error(ErrorKind::malformed, path + ": byte " + std::to_string(decoder.offset) + ": damaged PNG: " + decoder.message);
    };

    std::array<std::byte, 8> signature{};
    if (source->size() >= signature.size()) source->read(0, signature);
    if (png_sig_cmp(reinterpret_cast<png_const_bytep>(signature.data()), 0, signature.size()) != 0)
        throw Error(ErrorKind::malformed, path + ": is no PNG picture");

    Decoder decoder(*source);
    decoder.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoder, on_error, on_warning);
    if (decoder.png) decoder.info = png_create_info_struct(decoder.png);
    if (!decoder.info) throw Error(ErrorKind::limit, path + ": libpng cannot start");
    png_set_read_fn(decoder.png, &decoder, on_read);
    if (!read_header(decoder)) throw malformed(decoder);

    PngPicture picture;
    picture.width = png_get_image_width(decoder.png, decoder.info);
    picture.height = png_get_image_height(decoder.png, decoder.info);
    const uint64_t pixels = uint64_t{picture.width} * picture.height;
    // Deflate packs at most 1032 bytes into one, and a pixel takes at least a bit: a small file cannot hold a large picture.
    const uint64_t most_pixels = source->size() * 1032 * 8;
    if (pixels > kPngPixelLimit)
        throw Error(ErrorKind::limit, path + ": " + std::to_string(picture.width) + " x " + std::to_string(picture.height) +
                                          " pixels; at most " + std::to_string(kPngPixelLimit) + " are read");
    if (pixels > most_pixels)
        throw Error(ErrorKind::malformed, path + ": header: " + std::to_string(pixels) + " pixels cannot come from " +
                                              std::to_string(source->size()) + " bytes");
    if (!start_rows(decoder)) throw malformed(decoder);
    picture.rgba.resize(pixels);
    std::vector<png_bytep> rows(picture.height);
    for (uint32_t y = 0; y < picture.height; ++y)
        rows[y] = reinterpret_cast<png_bytep>(picture.rgba.data() + size_t(y) * picture.width);
    if (!read_pixels(decoder, rows.data())) throw malformed(decoder);
    return picture;
}

}  // namespace strata
