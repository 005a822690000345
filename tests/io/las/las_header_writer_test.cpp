#include "io/las/las_header_writer.h"

#include <gtest/gtest.h>

#include <cstring>

#include "core/error.h"

namespace strata::las {
namespace {

template <typename T>
T at(const std::vector<std::byte>& bytes, size_t offset) {
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}

// LAS 1.4 R15, table 3: which counts hold depends on the point format and on the number.
TEST(LasHeaderWriter, LegacyCountsAreThoseOfOldFormatsThatFit) {
    HeaderValues values = {.minor_version = 2, .point_format = 3, .compressed = true, .record_size = 34, .points = 7, .points_by_return = {4, 2, 1}};
    const std::vector<std::byte> old = header_block(values);
    ASSERT_EQ(old.size(), 227u);
    EXPECT_EQ(at<uint8_t>(old, 104), 0x83);
    EXPECT_EQ(at<uint32_t>(old, 107), 7u);
    EXPECT_EQ(at<uint32_t>(old, 111), 4u);
    EXPECT_EQ(at<uint32_t>(old, 119), 1u);

    values.minor_version = 4;
    EXPECT_EQ(at<uint32_t>(header_block(values), 107), 7u);
    EXPECT_EQ(at<uint64_t>(header_block(values), 247), 7u);
    values.points = uint64_t{1} << 32;
    EXPECT_EQ(at<uint32_t>(header_block(values), 107), 0u);
    EXPECT_EQ(at<uint64_t>(header_block(values), 247), uint64_t{1} << 32);
    values.points = 7;
    values.point_format = 6;
    EXPECT_EQ(at<uint32_t>(header_block(values), 107), 0u);
}

TEST(LasHeaderWriter, RecordsSayTheirSize) {
    std::vector<std::byte> bytes(3);
    append_record(bytes, "copc", 1, "text", std::vector<std::byte>(160));
    ASSERT_EQ(bytes.size(), 3u + 54 + 160);
    EXPECT_STREQ(reinterpret_cast<const char*>(bytes.data()) + 5, "copc");
    EXPECT_EQ(at<uint16_t>(bytes, 3 + 18), 1);
    EXPECT_EQ(at<uint16_t>(bytes, 3 + 20), 160);
    append_extended_record_header(bytes, "copc", 1000, "text", uint64_t{1} << 40);
    ASSERT_EQ(bytes.size(), 217u + 60);
    EXPECT_EQ(at<uint16_t>(bytes, 217 + 18), 1000);
    EXPECT_EQ(at<uint64_t>(bytes, 217 + 20), uint64_t{1} << 40);
    EXPECT_STREQ(reinterpret_cast<const char*>(bytes.data()) + 217 + 28, "text");
    EXPECT_THROW(append_record(bytes, "copc", 1, "", std::vector<std::byte>(65536)), Error);
}

}  // namespace
}  // namespace strata::las
