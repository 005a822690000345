#include "render/image.h"

#include <algorithm>
#include <utility>

#include "io/png/png_reader.h"
#include "io/png/png_writer.h"

namespace strata {

bool is_opaque(const Image& image) {
    Rgba8 all = make_rgba(0, 0, 0, 255);
    for (const Rgba8 pixel : image.pixels) all &= pixel;
    return alpha_of(all) == 255;
}

void write_png(const std::string& path, const Image& image, bool overwrite, int threads) {
    PngWriter writer(path, image.width, image.height,
                     {.alpha = is_opaque(image) ? PngWriter::Alpha::dropped : PngWriter::Alpha::kept,
                      .overwrite = overwrite,
                      .threads = threads});
    writer.write_rows(image.pixels);
    writer.finish();
}

Image read_png(const std::string& path) {
    PngPicture picture = decode_png(path);
    Image image;
    image.width = picture.width;
    image.height = picture.height;
    image.pixels = std::move(picture.rgba);
    return image;
}

}  // namespace strata
