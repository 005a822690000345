#include "io/png/png_reader.h"

#include <gtest/gtest.h>
#include <png.h>
#include <sys/resource.h>
#include <zlib.h>

#include <csetjmp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "core/math/random.h"
#include "io/png/png_writer.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

std::string read_all(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void write_all(const std::string& path, const std::string& bytes) {
    std::filesystem::remove(path);  // some file systems wait for the disk when a file is overwritten
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

std::string small_png(const TemporaryFolder& folder, std::vector<uint32_t>& rgba) {
    Random random(3);
    rgba.resize(13 * 9);
    for (uint32_t& pixel : rgba) pixel = uint32_t(random.bits());
    PngWriter writer(folder.file("good.png"), 13, 9, {.overwrite = true});
    writer.write_rows(rgba);
    writer.finish();
    return read_all(folder.file("good.png"));
}

int64_t peak_memory_kib() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

TEST(PngReader, EveryTruncationIsRefusedInOneLine) {
    const TemporaryFolder folder;
    std::vector<uint32_t> rgba;
    const std::string good = small_png(folder, rgba);
    const std::string path = folder.file("cut.png");
    for (size_t size = 0; size < good.size(); ++size) {
        write_all(path, good.substr(0, size));
        try {
            decode_png(path);
            ADD_FAILURE() << size;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::malformed) << size << ": " << error.what();
            EXPECT_EQ(std::string(error.what()).find(path), 0u);
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        }
    }
}

// Every chunk has a CRC: a flipped bit is refused, or lies in an ancillary chunk that does not touch the pixels.
TEST(PngReader, NoFlippedBitChangesAPixel) {
    const TemporaryFolder folder;
    std::vector<uint32_t> rgba;
    const std::string good = small_png(folder, rgba);
    const std::string path = folder.file("flipped.png");
    size_t refused = 0;
    for (size_t bit = 0; bit < good.size() * 8; bit += 5) {  // every byte, every place in it
        std::string bad = good;
        bad[bit / 8] = char(uint8_t(bad[bit / 8]) ^ (1u << bit % 8));
        write_all(path, bad);
        try {
            EXPECT_EQ(decode_png(path).rgba, rgba) << bit;
        } catch (const Error& error) {
            EXPECT_TRUE(error.kind == ErrorKind::malformed || error.kind == ErrorKind::limit) << error.what();
            ++refused;
        }
    }
    EXPECT_GT(refused, good.size());       // most of the file is pixels
}

// A header with right checksum that promises more pixels than the bytes can hold must not cost their memory.
TEST(PngReader, SidesAreHeldAgainstTheFileBeforeMemoryIsTaken) {
    const TemporaryFolder folder;
    std::vector<uint32_t> rgba;
    const std::string good = small_png(folder, rgba);
    const auto with_sides = [&](uint32_t width, uint32_t height) {
        std::string bad = good;
        for (int i = 0; i < 4; ++i) {
            bad[size_t(16 + i)] = char(width >> (24 - 8 * i));
            bad[size_t(20 + i)] = char(height >> (24 - 8 * i));
        }
        const uint32_t checksum = uint32_t(crc32(0, reinterpret_cast<const Bytef*>(bad.data()) + 12, 17));
        for (int i = 0; i < 4; ++i) bad[size_t(29 + i)] = char(checksum >> (24 - 8 * i));
        write_all(folder.file("lying.png"), bad);
        try {
            decode_png(folder.file("lying.png"));
        } catch (const Error& error) {
            return error;
        }
        return Error(ErrorKind::device, "nothing was thrown");
    };
    const int64_t before_kib = peak_memory_kib();
    EXPECT_EQ(with_sides(0x7fffffff, 0x7fffffff).kind, ErrorKind::limit);
    EXPECT_EQ(with_sides(0x7fffffff, 1).kind, ErrorKind::limit);
    EXPECT_EQ(with_sides(16384, 16385).kind, ErrorKind::limit);
    EXPECT_EQ(with_sides(16384, 16384).kind, ErrorKind::malformed);
    EXPECT_EQ(with_sides(0, 9).kind, ErrorKind::malformed);
    EXPECT_EQ(with_sides(0x80000000u, 1).kind, ErrorKind::malformed);
    EXPECT_LT(peak_memory_kib() - before_kib, 64 << 10);  // a row of the first would take 8 GiB
}

TEST(PngReader, OtherFilesAreNamed) {
    const TemporaryFolder folder;
    write_all(folder.file("text.png"), "this is no picture at all");
    EXPECT_THROW(decode_png(folder.file("text.png")), Error);
    try {
        decode_png(folder.file("none.png"));
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::not_found);
    }
}

// Pictures of other programs: 16-bit gray and a palette with transparency, written by libpng itself.
TEST(PngReader, GrayPaletteAndSixteenBitsBecomeRgba) {
    const TemporaryFolder folder;
    const auto write = [&](const std::string& path, int depth, int type, const std::vector<uint8_t>& row) {
        FILE* file = std::fopen(path.c_str(), "wb");
        png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
        png_infop info = png_create_info_struct(png);
        if (setjmp(png_jmpbuf(png)) == 0) {
            png_init_io(png, file);
            png_set_IHDR(png, info, 2, 2, depth, type, PNG_INTERLACE_ADAM7, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
            const png_color colors[2] = {{10, 20, 30}, {40, 50, 60}};
            const png_byte alphas[2] = {255, 77};
            if (type == PNG_COLOR_TYPE_PALETTE) {
                png_set_PLTE(png, info, colors, 2);
                png_set_tRNS(png, info, alphas, 2, nullptr);
            }
            png_write_info(png, info);
            png_bytep rows[2] = {const_cast<png_bytep>(row.data()), const_cast<png_bytep>(row.data())};
            png_write_image(png, rows);
            png_write_end(png, info);
        }
        png_destroy_write_struct(&png, &info);
        std::fclose(file);
    };
    write(folder.file("gray.png"), 16, PNG_COLOR_TYPE_GRAY, {0x12, 0x34, 0xff, 0xff});
    const PngPicture gray = decode_png(folder.file("gray.png"));
    EXPECT_EQ(gray.rgba, (std::vector<uint32_t>{0xff121212, 0xffffffff, 0xff121212, 0xffffffff}));
    write(folder.file("palette.png"), 8, PNG_COLOR_TYPE_PALETTE, {0, 1});
    const PngPicture palette = decode_png(folder.file("palette.png"));
    EXPECT_EQ(palette.rgba, (std::vector<uint32_t>{0xff1e140a, 0x4d3c3228, 0xff1e140a, 0x4d3c3228}));
}

}  // namespace
}  // namespace strata
