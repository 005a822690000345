#include "io/png/png_writer.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "core/math/random.h"
#include "io/png/png_reader.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

std::vector<uint32_t> random_pixels(uint32_t width, uint32_t height, uint32_t alpha_mask) {
    Random random(7);
    std::vector<uint32_t> rgba(size_t(width) * height);
    for (uint32_t& pixel : rgba) pixel = uint32_t(random.bits()) | ~alpha_mask;
    return rgba;
}

std::string bytes_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

struct Size {
    uint32_t width, height;
};

class PngRoundTrip : public testing::TestWithParam<Size> {};

// 300 x 700 RGBA takes several segments, 20000 x 7 segments of few rows, 70000 x 3 rows longer than a segment.
INSTANTIATE_TEST_SUITE_P(Sizes, PngRoundTrip, testing::Values(Size{1, 1}, Size{3, 1}, Size{1, 5}, Size{300, 700}, Size{20000, 7}, Size{70000, 3}));

TEST_P(PngRoundTrip, EveryPixelComesBackThroughLibpng) {
    const auto [width, height] = GetParam();
    const TemporaryFolder folder;
    for (const bool opaque : {false, true}) {
        const auto rgba = random_pixels(width, height, opaque ? 0x00ffffff : 0xffffffff);
        const std::string path = folder.path() + (opaque ? "/rgb.png" : "/rgba.png");
        PngWriter writer(path, width, height, {.alpha = opaque ? PngWriter::Alpha::dropped : PngWriter::Alpha::kept});
        writer.write_rows(rgba);
        writer.finish();
        const PngPicture picture = decode_png(path);
        EXPECT_EQ(picture.width, width);
        EXPECT_EQ(picture.height, height);
        EXPECT_EQ(picture.rgba, rgba);
    }
}

TEST(PngWriter, BytesDependOnPixelsAlone) {
    constexpr uint32_t kWidth = 321, kHeight = 1000;  // 5 segments
    const TemporaryFolder folder;
    const auto rgba = random_pixels(kWidth, kHeight, 0xffffffff);
    std::vector<std::string> files;
    for (const int threads : {1, 2, 7}) {
        for (const uint32_t rows : {kHeight, 1u, 99u, 204u, 205u}) {
            const std::string path = folder.path() + "/" + std::to_string(threads) + "-" + std::to_string(rows) + ".png";
            PngWriter writer(path, kWidth, kHeight, {.threads = threads});
            for (uint32_t y = 0; y < kHeight; y += rows)
                writer.write_rows(std::span(rgba).subspan(size_t(y) * kWidth, size_t(std::min(rows, kHeight - y)) * kWidth));
            writer.finish();
            files.push_back(bytes_of(path));
        }
    }
    for (const std::string& file : files) EXPECT_TRUE(file == files.front());
}

TEST(PngWriter, UnfinishedPictureLeavesNothingAndKeepsTheOldOne) {
    const TemporaryFolder folder;
    const std::string path = folder.path() + "/picture.png";
    std::ofstream(path) << "earlier";
    {
        PngWriter writer(path, 10, 10, {.overwrite = true});
        writer.write_rows(random_pixels(10, 5, 0xffffffff));
    }
    EXPECT_EQ(bytes_of(path), "earlier");
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(PngWriter, RefusesSidesThatTheFormatCannotSay) {
    const TemporaryFolder folder;
    for (const Size size : {Size{0, 1}, Size{1, 0}, Size{0x80000000u, 1}})
        EXPECT_THROW(PngWriter(folder.path() + "/x.png", size.width, size.height, {}), Error);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace strata
