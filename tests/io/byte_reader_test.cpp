#include "io/byte_reader.h"

#include <gtest/gtest.h>

#include <array>

namespace strata {
namespace {

constexpr std::array kBytes = {std::byte{0x01}, std::byte{0x02}, std::byte{0x03}, std::byte{0x04}, std::byte{'a'}, std::byte{0}, std::byte{'b'}};

TEST(ByteReader, ReadsLittleEndianAndStepsOn) {
    ByteReader reader(kBytes, "here");
    EXPECT_EQ(reader.read<uint8_t>(), 1);
    EXPECT_EQ(reader.read<uint16_t>(), 0x0302);
    EXPECT_EQ(reader.position(), 3u);
    reader.seek(0);
    EXPECT_EQ(reader.read<uint32_t>(), 0x04030201u);
    EXPECT_EQ(reader.text(3), "a");  // up to the NUL, but the whole field is taken
    EXPECT_EQ(reader.left(), 0u);
}

TEST(ByteReader, NamesThePlaceWhenBytesAreMissing) {
    ByteReader reader(kBytes, "scan.las: header", 100);
    reader.skip(5);
    try {
        reader.read<uint32_t>();
        FAIL() << "read beyond the end";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::malformed);
        EXPECT_STREQ(error.what(), "scan.las: header: byte 105: 4 bytes needed, 2 left");
    }
    EXPECT_EQ(reader.position(), 5u);  // a failed read moves nothing
}

// A count that would wrap a 64-bit sum must not pass.
TEST(ByteReader, HugeCountsFail) {
    ByteReader reader(kBytes, "here");
    reader.skip(1);
    EXPECT_THROW(reader.take(UINT64_MAX), Error);
    EXPECT_THROW(reader.take(UINT64_MAX - 0), Error);
    EXPECT_THROW(reader.seek(8), Error);
    EXPECT_NO_THROW(reader.seek(7));
}

}  // namespace
}  // namespace strata
