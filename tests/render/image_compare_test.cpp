#include "render/image_compare.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/math/random.h"

namespace strata {
namespace {

constexpr Rgba8 gray(int value) { return make_rgba(uint8_t(value), uint8_t(value), uint8_t(value)); }

void fill(Image& image, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height, Rgba8 color) {
    for (uint32_t y = y0; y < y0 + height; ++y)
        for (uint32_t x = x0; x < x0 + width; ++x) image.at(x, y) = color;
}

ImageDifference compare_both_ways(const Image& a, const Image& b) {
    const ImageDifference there = compare_images(a, b, 1), back = compare_images(b, a, 3);
    EXPECT_EQ(there.worst_tile, back.worst_tile);
    EXPECT_EQ(there.rms, back.rms);
    EXPECT_DOUBLE_EQ(there.ssim, back.ssim);
    return there;
}

TEST(ImageCompare, EqualPicturesDifferInNothing) {
    const ImageDifference d = compare_both_ways(Image(50, 40, gray(90)), Image(50, 40, gray(90)));
    EXPECT_EQ(d.worst_tile, 0.0);
    EXPECT_EQ(d.max_channel, 0);
    EXPECT_EQ(d.rms, 0.0);
    EXPECT_EQ(d.psnr_db, kEqualPsnr);
    EXPECT_EQ(d.ssim, 1.0);
    EXPECT_EQ(d.share_over, 0.0);
}

TEST(ImageCompare, AUniformStepIsAllFiguresAtOnce) {
    const ImageDifference d = compare_both_ways(Image(100, 60, gray(100)), Image(100, 60, gray(110)));
    EXPECT_DOUBLE_EQ(d.worst_tile, 10.0);
    EXPECT_EQ(d.max_channel, 10);
    EXPECT_DOUBLE_EQ(d.mean, 10.0);
    EXPECT_DOUBLE_EQ(d.rms, 10.0);
    EXPECT_NEAR(d.psnr_db, 20 * std::log10(25.5), 1e-12);
    EXPECT_EQ(d.share_over, 1.0);
    // No variance: SSIM is its luminance term alone.
    EXPECT_NEAR(d.ssim, (2.0 * 100 * 110 + 6.5025) / (100.0 * 100 + 110.0 * 110 + 6.5025), 1e-9);
}

// The contrasts of the header: a pixel c/16, a line c/4, an object of a tile c.
TEST(ImageCompare, AMissingThingCostsItsContrastTimesItsShareOfATile) {
    const Image empty(640, 480, gray(50));
    Image dot = empty, line = empty, object = empty;
    dot.at(333, 222) = gray(210);
    fill(line, 100, 50, 1, 300, gray(210));
    fill(object, 200, 200, 40, 40, gray(210));
    EXPECT_DOUBLE_EQ(compare_both_ways(dot, empty).worst_tile, 160.0 / 16);
    EXPECT_DOUBLE_EQ(compare_both_ways(line, empty).worst_tile, 160.0 / 4);
    const ImageDifference d = compare_both_ways(object, empty);
    EXPECT_DOUBLE_EQ(d.worst_tile, 160.0);
    EXPECT_GE(d.worst_tile_x, 200u);
    EXPECT_LE(d.worst_tile_x + kTilePixels, 240u);
    EXPECT_LT(d.mean, 1.0);  // which a mean over the whole picture would let pass
}

TEST(ImageCompare, AnEdgeMayMoveByAFractionOfAPixel) {
    Image a(100, 100, gray(20)), b = a, moved_far = a;
    fill(a, 50, 0, 50, 100, gray(220));
    fill(b, 51, 0, 49, 100, gray(220));
    fill(b, 50, 0, 1, 100, gray(120));  // the edge's pixel half covered
    fill(moved_far, 53, 0, 47, 100, gray(220));
    EXPECT_EQ(compare_both_ways(a, b).worst_tile, 0.0);
    EXPECT_EQ(compare_both_ways(a, b).max_channel, 100);  // the plain figures still tell
    EXPECT_GT(compare_both_ways(a, moved_far).worst_tile, 4 * kDefaultThreshold);
}

TEST(ImageCompare, SmallNoisePassesTheDefaultThreshold) {
    Random random(5);
    Image a(200, 200), b(200, 200);
    for (size_t i = 0; i < a.pixels.size(); ++i) {
        const int value = 60 + int(i % 200) / 2;
        a.pixels[i] = gray(value);
        b.pixels[i] = gray(value + int(random.uniform(-3, 4)));
    }
    const ImageDifference d = compare_both_ways(a, b);
    EXPECT_LT(d.worst_tile, 3.0);  // each value is off by at most 3
    EXPECT_GT(d.worst_tile, 0.0);
    EXPECT_EQ(d.pixels_over, 0u);
}

TEST(ImageCompare, ColorsOfTransparentPixelsDoNotCountButAlphaDoes) {
    const Image red(20, 20, make_rgba(255, 0, 0, 0)), blue(20, 20, make_rgba(0, 0, 255, 0)), black(20, 20, gray(0));
    EXPECT_EQ(compare_both_ways(red, blue).worst_tile, 0.0);
    EXPECT_EQ(compare_both_ways(red, blue).psnr_db, kEqualPsnr);
    EXPECT_EQ(compare_both_ways(red, black).max_channel, 255);
    EXPECT_GT(compare_both_ways(red, black).worst_tile, 100.0);
}

TEST(ImageCompare, PicturesSmallerThanATileAndOddSidesWork) {
    for (const auto& [width, height] : {std::pair{1u, 1u}, {7u, 3u}, {17u, 33u}, {9u, 100u}}) {
        Image a(width, height, gray(0)), b(width, height, gray(0));
        b.at(width - 1, height - 1) = gray(255);
        const ImageDifference d = compare_both_ways(a, b);
        EXPECT_GT(d.worst_tile, 0.0);
        EXPECT_TRUE(std::isfinite(d.ssim) && std::isfinite(d.psnr_db));
        const Image shown = difference_picture(a, b, d);
        EXPECT_EQ(shown.width, 3 * width);
        EXPECT_EQ(shown.height, height);
    }
}

TEST(ImageCompare, OtherSizesAreNamed) {
    try {
        compare_images(Image(10, 20), Image(20, 10), 1);
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        EXPECT_STREQ(error.what(), "the picture has 10 x 20 pixels, the reference 20 x 10");
    }
    EXPECT_THROW(compare_images(Image(), Image(), 1), Error);
}

TEST(ImageCompare, TheDifferencePictureShowsWhereAndOnlyThere) {
    Image a(100, 100, gray(100)), b = a;
    fill(b, 40, 40, 16, 16, gray(250));
    const ImageDifference d = compare_images(a, b, 1);
    const Image shown = difference_picture(a, b, d);
    EXPECT_EQ(shown.at(10, 10), gray(100));         // reference
    EXPECT_EQ(shown.at(100 + 10, 10), gray(100));   // picture
    EXPECT_EQ(shown.at(200 + 10, 10), gray(30));    // dim, 0.3 of the reference's luma
    const Rgba8 heat = shown.at(200 + 50, 50);
    EXPECT_GT(red_of(heat), 200);
    EXPECT_TRUE(is_opaque(shown));
}

}  // namespace
}  // namespace strata
