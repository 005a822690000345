#include "render/image_compare.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "render/colormap.h"

namespace strata {
namespace {

constexpr uint32_t kBlock = kTilePixels / 2;  // tiles start at every block, so that they overlap by half
constexpr uint32_t kWindow = 8, kWindowStep = 4;

// Red, green and blue times alpha, and alpha.
using Channels = std::array<int, 4>;

Channels channels_of(Rgba8 pixel) {
    const int alpha = alpha_of(pixel);
    const auto weighted = [&](int value) { return (value * alpha + 127) / 255; };
    return {weighted(red_of(pixel)), weighted(green_of(pixel)), weighted(blue_of(pixel)), alpha};
}

// By how much each channel of a pixel lies outside of what `other` has within one pixel of (x, y), squared and summed.
int distance_to_neighborhood(const Channels& pixel, const Image& other, uint32_t x, uint32_t y) {
    Channels least = channels_of(other.at(x, y)), most = least;
    for (uint32_t v = y > 0 ? y - 1 : 0; v <= std::min(y + 1, other.height - 1); ++v)
        for (uint32_t u = x > 0 ? x - 1 : 0; u <= std::min(x + 1, other.width - 1); ++u) {
            const Channels near = channels_of(other.at(u, v));
            for (size_t c = 0; c < 4; ++c) {
                least[c] = std::min(least[c], near[c]);
                most[c] = std::max(most[c], near[c]);
            }
        }
    int sum = 0;
    for (size_t c = 0; c < 4; ++c) {
        const int outside = std::max({least[c] - pixel[c], pixel[c] - most[c], 0});
        sum += outside * outside;
    }
    return sum;
}

// Squared difference of a pixel that tolerates a shift by a pixel; both ways, so that neither picture may lack a thing.
int tolerant_difference(const Image& a, const Image& b, uint32_t x, uint32_t y) {
    if (a.at(x, y) == b.at(x, y)) return 0;
    return std::max(distance_to_neighborhood(channels_of(a.at(x, y)), b, x, y),
                    distance_to_neighborhood(channels_of(b.at(x, y)), a, x, y));
}

// Sums over one row of blocks. Integers, so that the order of threads cannot show.
struct RowSums {
    std::vector<uint64_t> tolerant;  // [block] squared differences
    uint64_t absolute = 0, squared = 0, pixels_over = 0;
    int max_channel = 0;
};

RowSums sum_block_row(const Image& a, const Image& b, uint32_t block_y) {
    RowSums sums;
    sums.tolerant.resize((a.width + kBlock - 1) / kBlock);
    for (uint32_t y = block_y * kBlock; y < std::min((block_y + 1) * kBlock, a.height); ++y) {
        for (uint32_t x = 0; x < a.width; ++x) {
            if (a.at(x, y) == b.at(x, y)) continue;
            sums.tolerant[x / kBlock] += uint64_t(tolerant_difference(a, b, x, y));
            const Channels p = channels_of(a.at(x, y)), q = channels_of(b.at(x, y));
            int most = 0;
            for (size_t c = 0; c < 4; ++c) {
                const int step = std::abs(p[c] - q[c]);
                most = std::max(most, step);
                sums.absolute += uint64_t(step);
                sums.squared += uint64_t(step) * uint64_t(step);
            }
            sums.max_channel = std::max(sums.max_channel, most);
            sums.pixels_over += most > kPixelTolerance;
        }
    }
    return sums;
}

// Rec. 709 luma of the pixel over black, in 8-bit steps.
double luma(Rgba8 pixel) {
    const Channels c = channels_of(pixel);
    return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
}

double window_similarity(const Image& a, const Image& b, uint32_t x0, uint32_t y0) {
    const uint32_t x1 = std::min(x0 + kWindow, a.width), y1 = std::min(y0 + kWindow, a.height);
    double sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
    for (uint32_t y = y0; y < y1; ++y)
        for (uint32_t x = x0; x < x1; ++x) {
            const double p = luma(a.at(x, y)), q = luma(b.at(x, y));
            sum_a += p, sum_b += q, sum_aa += p * p, sum_bb += q * q, sum_ab += p * q;
        }
    const double n = double(x1 - x0) * double(y1 - y0);
    const double mean_a = sum_a / n, mean_b = sum_b / n;
    const double variance_a = sum_aa / n - mean_a * mean_a, variance_b = sum_bb / n - mean_b * mean_b;
    const double covariance = sum_ab / n - mean_a * mean_b;
    constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;  // the paper's
    return (2 * mean_a * mean_b + kC1) * (2 * covariance + kC2) /
           ((mean_a * mean_a + mean_b * mean_b + kC1) * (variance_a + variance_b + kC2));
}

double structural_similarity(const Image& a, const Image& b, int threads) {
    const auto count = [](uint32_t side) { return side <= kWindow ? 1 : (side - kWindow) / kWindowStep + 1; };
    const uint32_t columns = count(a.width), rows = count(a.height);
    std::vector<double> row_sums(rows);
    parallel_blocks(threads, rows, 4, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row)
            for (uint32_t column = 0; column < columns; ++column)
                row_sums[row] += window_similarity(a, b, column * kWindowStep, uint32_t(row) * kWindowStep);
    });
    double sum = 0;
    for (const double row : row_sums) sum += row;
    return sum / (double(rows) * columns);
}

void find_worst_tile(const Image& image, const std::vector<RowSums>& rows, ImageDifference& result) {
    const size_t block_rows = rows.size(), block_columns = rows[0].tolerant.size();
    for (size_t by = 0; by < std::max<size_t>(block_rows - 1, 1); ++by) {
        for (size_t bx = 0; bx < std::max<size_t>(block_columns - 1, 1); ++bx) {
            uint64_t sum = 0;
            for (size_t v = by; v < std::min(by + 2, block_rows); ++v)
                for (size_t u = bx; u < std::min(bx + 2, block_columns); ++u) sum += rows[v].tolerant[u];
            const uint32_t x = uint32_t(bx) * kBlock, y = uint32_t(by) * kBlock;
            const double pixels = double(std::min(kTilePixels, image.width - x)) * std::min(kTilePixels, image.height - y);
            const double rms = std::sqrt(double(sum) / (3.0 * pixels));
            if (rms <= result.worst_tile) continue;
            result.worst_tile = rms;
            result.worst_tile_x = x;
            result.worst_tile_y = y;
        }
    }
}

std::string size_text(const Image& image) { return std::to_string(image.width) + " x " + std::to_string(image.height); }

Rgba8 over_gray(Rgba8 pixel) {
    const auto mix = [&](int value) { return uint8_t((value * alpha_of(pixel) + 128 * (255 - alpha_of(pixel)) + 127) / 255); };
    return make_rgba(mix(red_of(pixel)), mix(green_of(pixel)), mix(blue_of(pixel)));
}

void draw_frame(Image& image, uint32_t left, uint32_t top, uint32_t right, uint32_t bottom, Rgba8 color) {
    for (uint32_t x = left; x < right; ++x) image.at(x, top) = image.at(x, bottom - 1) = color;
    for (uint32_t y = top; y < bottom; ++y) image.at(left, y) = image.at(right - 1, y) = color;
}

}  // namespace

ImageDifference compare_images(const Image& picture, const Image& reference, int threads) {
    if (picture.width != reference.width || picture.height != reference.height)
        throw Error(ErrorKind::usage, "the picture has " + size_text(picture) + " pixels, the reference " + size_text(reference));
    if (picture.pixels.empty()) throw Error(ErrorKind::usage, "an empty picture cannot be compared");

    std::vector<RowSums> rows((picture.height + kBlock - 1) / kBlock);
    parallel_blocks(threads, rows.size(), 1, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row) rows[row] = sum_block_row(picture, reference, uint32_t(row));
    });

    ImageDifference result;
    uint64_t absolute = 0, squared = 0;
    for (const RowSums& row : rows) {
        absolute += row.absolute;
        squared += row.squared;
        result.pixels_over += row.pixels_over;
        result.max_channel = std::max(result.max_channel, row.max_channel);
    }
    const double pixels = double(picture.pixels.size());
    result.mean = double(absolute) / (3.0 * pixels);
    result.rms = std::sqrt(double(squared) / (3.0 * pixels));
    result.psnr_db = squared == 0 ? kEqualPsnr : 20.0 * std::log10(255.0 / result.rms);
    result.share_over = double(result.pixels_over) / pixels;
    find_worst_tile(picture, rows, result);
    result.ssim = squared == 0 ? 1.0 : structural_similarity(picture, reference, threads);
    return result;
}

Image difference_picture(const Image& picture, const Image& reference, const ImageDifference& difference) {
    constexpr Rgba8 kFrame = make_rgba(0, 220, 255);
    constexpr double kFullHeat = 64.0;  // 8-bit steps at which the heat map ends
    const Colormap heat("ember");
    const uint32_t width = picture.width;
    Image out(width * 3, picture.height);
    for (uint32_t y = 0; y < picture.height; ++y) {
        for (uint32_t x = 0; x < width; ++x) {
            out.at(x, y) = over_gray(reference.at(x, y));
            out.at(x + width, y) = over_gray(picture.at(x, y));
            const uint8_t dim = uint8_t(std::lround(0.3 * luma(over_gray(reference.at(x, y)))));
            const double steps = std::sqrt(tolerant_difference(picture, reference, x, y) / 3.0);
            out.at(x + 2 * width, y) = steps < 1.0 ? make_rgba(dim, dim, dim) : heat.color(0.4 + 0.6 * steps / kFullHeat);
        }
    }
    if (difference.worst_tile > 0.0) {
        const uint32_t x = difference.worst_tile_x, y = difference.worst_tile_y;
        const uint32_t right = std::min(x + kTilePixels, width), bottom = std::min(y + kTilePixels, picture.height);
        for (uint32_t panel = 0; panel < 3; ++panel)
            draw_frame(out, x + panel * width, y, right + panel * width, bottom, kFrame);
    }
    return out;
}

}  // namespace strata
