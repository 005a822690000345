#include "io/byte_stream.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/las_file.h"

namespace strata {
namespace {

using Lines = std::vector<std::string>;

Lines lines_of(const std::string& text, ByteStream::Continued continued = ByteStream::Continued::never) {
    const auto source = memory_source("text", test::bytes_of(text));
    ByteStream stream(*source);
    Lines lines;
    for (std::string_view line; stream.next_line(line, continued);) lines.emplace_back(line);
    return lines;
}

TEST(ByteStream, LinesEndAsTheFirstDoes) {
    EXPECT_EQ(lines_of("a\nb\n\nc"), (Lines{"a", "b", "", "c"}));
    EXPECT_EQ(lines_of("a\r\nb\r\n"), (Lines{"a\r", "b\r"}));
    EXPECT_EQ(lines_of("a\rb\r"), (Lines{"a", "b"}));
    EXPECT_EQ(lines_of("a\nb\rc"), (Lines{"a", "b\rc"}));
    EXPECT_EQ(lines_of(""), Lines{});
    EXPECT_EQ(lines_of("\n"), Lines{""});
}

TEST(ByteStream, ABackslashJoinsLinesWhereAskedFor) {
    EXPECT_EQ(lines_of("f 1 \\\n2 3\nv", ByteStream::Continued::by_backslash), (Lines{"f 1   2 3", "v"}));
    EXPECT_EQ(lines_of("f 1 \\\r\n2\\\r\n3\r\n", ByteStream::Continued::by_backslash), (Lines{"f 1    2   3\r"}));
    EXPECT_EQ(lines_of("a\\\nb"), (Lines{"a\\", "b"}));
    EXPECT_EQ(lines_of("a\\\n", ByteStream::Continued::by_backslash), (Lines{"a  "}));
}

// Lines of every length around the buffer's edges, and longer than the buffer.
TEST(ByteStream, LinesCrossTheBuffer) {
    for (const size_t length : {size_t{1}, size_t{7}, size_t{1000}, size_t{262143}, size_t{262144}, size_t{262145}, size_t{3000001}}) {
        std::string text;
        const size_t count = 1'000'000 / length + 2;
        for (size_t i = 0; i < count; ++i) text += std::string(length, char('a' + i % 26)) + "\n";
        const Lines lines = lines_of(text);
        ASSERT_EQ(lines.size(), count) << length;
        for (size_t i = 0; i < count; ++i) ASSERT_EQ(lines[i], std::string(length, char('a' + i % 26))) << length << " " << i;
    }
}

TEST(ByteStream, ALineOfEndlessLengthIsRefused) {
    const auto source = memory_source("text", std::vector<std::byte>(40 * 1024 * 1024, std::byte{'x'}));
    ByteStream stream(*source);
    std::string_view line;
    try {
        stream.next_line(line);
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_STREQ(error.what(), "text: line 1: lines of at most 16 MiB are expected");
    }
}

TEST(ByteStream, CountsLinesThatWereJoined) {
    const auto source = memory_source("text", test::bytes_of("a\\\nb\nc\n"));
    ByteStream stream(*source);
    std::string_view line;
    ASSERT_TRUE(stream.next_line(line, ByteStream::Continued::by_backslash));
    EXPECT_EQ(stream.line_number(), 1u);
    ASSERT_TRUE(stream.next_line(line, ByteStream::Continued::by_backslash));
    EXPECT_EQ(stream.line_number(), 3u);
}

TEST(ByteStream, BytesFollowLinesAndEndWithTheFile) {
    std::vector<std::byte> bytes = test::bytes_of("head\n");
    for (int i = 0; i < 600'000; ++i) bytes.push_back(std::byte(i * 7 % 251));
    const auto source = memory_source("data", bytes);
    ByteStream stream(*source);
    std::string_view line;
    ASSERT_TRUE(stream.next_line(line));
    EXPECT_EQ(line, "head");
    int at = 0;
    for (const size_t count : {size_t{1}, size_t{65536}, size_t{3}, size_t{65536}, size_t{65536}, size_t{65536}, size_t{65536}})
        for (const std::byte byte : stream.take(count)) ASSERT_EQ(byte, std::byte(at++ * 7 % 251));
    stream.skip(200'000);
    at += 200'000;
    EXPECT_EQ(stream.take(1)[0], std::byte(at * 7 % 251));
    EXPECT_EQ(stream.left(), 600'000u - uint64_t(at) - 1);
    stream.skip(stream.left());
    EXPECT_EQ(stream.take(0).size(), 0u);
    EXPECT_THROW(stream.take(1), Error);
    EXPECT_THROW(stream.skip(1), Error);
}

}  // namespace
}  // namespace strata
