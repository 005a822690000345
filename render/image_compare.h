#pragma once

#include <cstdint>

#include "render/image.h"

namespace strata {

/// How far a picture is from a reference, over both laid on the same background.
struct ImageDifference {
    double worst_tile = 0.0;   // what a threshold is held against: see compare_images
    uint32_t worst_tile_x = 0, worst_tile_y = 0;  // its top left pixel
    int max_channel = 0;       // 8-bit steps
    double mean = 0.0;         // mean absolute difference of a channel, 8-bit steps
    double rms = 0.0;          // root of the mean squared difference of a channel, 8-bit steps
    double psnr_db = 0.0;      // 20 log10(255 / rms); kEqualPsnr for equal pictures
    double ssim = 1.0;         // mean structural similarity of luma, 1 for equal pictures
    uint64_t pixels_over = 0;  // pixels of which a channel differs by more than kPixelTolerance
    double share_over = 0.0;   // of all pixels
};

inline constexpr double kEqualPsnr = 999.0;       // dB; no infinity, so that JSON can say it
inline constexpr int kPixelTolerance = 8;         // 8-bit steps that hardly anyone sees
inline constexpr uint32_t kTilePixels = 16;       // side of a tile
inline constexpr double kDefaultThreshold = 8.0;  // for worst_tile

/// Compares two pictures for a screenshot test.
///
/// A threshold is held against one number, `worst_tile`: the largest root mean square difference, in 8-bit steps, of any
/// tile of 16 x 16 pixels (tiles overlap by half). A mean over the whole picture would let a missing small object pass, and
/// a maximum would fail on a single pixel of an edge. For this number, a channel differs only by what it lies outside of the
/// values within one pixel of that place in the other picture, taken both ways: an edge that moved by less than a pixel
/// costs nothing, an object that is missing costs all its contrast. 0 means equal to within a pixel; below 2 is rounding;
/// one lone pixel of contrast c gives c/16, a missing line of one pixel c/4, a missing object c. kDefaultThreshold lets one
/// pixel a tile go wrong, at half the full contrast, and nothing more.
///
/// Colors are multiplied by alpha first, so those of transparent pixels do not count; alpha counts as a channel of its own.
/// throws  Error{usage}: the sizes differ, or a picture is empty
/// source  SSIM: Z. Wang et al., "Image Quality Assessment", IEEE TIP 2004, with square windows of 8 pixels at every 4th
ImageDifference compare_images(const Image& picture, const Image& reference, int threads);

/// A picture for people: reference, picture, and the reference in dim gray with what differs in heat colors, side by side;
/// the worst tile is framed. Transparent pixels show as mid gray.
Image difference_picture(const Image& picture, const Image& reference, const ImageDifference& difference);

}  // namespace strata
