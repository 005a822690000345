#include "io/byte_source.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "core/error.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

// Byte i of the file is i * 7 modulo 251, so that every place within 251 bytes is told apart.
std::byte value_at(uint64_t i) { return std::byte(i * 7 % 251); }

class FileBytes : public ::testing::Test {
protected:
    FileBytes() : path_(folder_.file("bytes")) {
        std::ofstream out(path_, std::ios::binary);
        for (uint64_t i = 0; i < kSize; ++i) out.put(char(value_at(i)));
    }
    static constexpr uint64_t kSize = 200'000;
    TemporaryFolder folder_;
    std::string path_;
};

TEST_F(FileBytes, ReadsRanges) {
    const auto source = open_file(path_);
    ASSERT_EQ(source->size(), kSize);
    std::vector<std::byte> out(1000);
    source->read(kSize - 1000, out);
    for (uint64_t i = 0; i < out.size(); ++i) ASSERT_EQ(out[i], value_at(kSize - 1000 + i));
    EXPECT_THROW(source->read(kSize - 999, out), Error);
    EXPECT_THROW(source->read(UINT64_MAX, out), Error);
    source->prefetch(0, UINT64_MAX);  // a hint never fails
}

// Neighbours, gaps small and large, an overlap, an order that goes back, an empty range, and more ranges than one request has.
TEST_F(FileBytes, ReadManyEqualsReads) {
    const auto source = open_file(path_);
    std::vector<std::pair<uint64_t, size_t>> places = {{0, 10}, {10, 5}, {20, 100}, {60, 100}, {150'000, 1}, {5, 0}, {199'999, 1}};
    for (uint64_t i = 0; i < 1500; ++i) places.emplace_back(i * 100, 50);
    std::vector<std::vector<std::byte>> buffers;
    for (const auto& [offset, size] : places) buffers.emplace_back(size);
    std::vector<ByteRange> ranges;
    for (size_t i = 0; i < places.size(); ++i) ranges.push_back({places[i].first, buffers[i]});
    source->read_many(ranges);
    for (size_t r = 0; r < places.size(); ++r)
        for (size_t i = 0; i < buffers[r].size(); ++i) ASSERT_EQ(buffers[r][i], value_at(places[r].first + i)) << "range " << r;
}

TEST_F(FileBytes, ReadManyRefusesWhatIsBeyondTheEnd) {
    const auto source = open_file(path_);
    std::vector<std::byte> a(10), b(10);
    const ByteRange ranges[] = {{kSize - 20, a}, {kSize - 9, b}};
    EXPECT_THROW(source->read_many(ranges), Error);
}

TEST(ByteSource, WhatIsNoRegularFileIsRefusedAtOnce) {
    const TemporaryFolder folder;
    EXPECT_THROW(open_file(folder.path()), Error);
    const std::string fifo = folder.file("fifo");
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    EXPECT_THROW(open_file(fifo), Error);  // must not wait for a writer
    try {
        open_file(folder.file("none"));
        FAIL() << "opened a file that is not there";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::not_found);
    }
}

TEST(ByteSource, AFileThatBecameShorterIsAnError) {
    const TemporaryFolder folder;
    const std::string path = folder.file("bytes");
    std::ofstream(path) << std::string(100, 'x');
    const auto source = open_file(path);
    std::ofstream(path, std::ios::trunc) << "x";
    std::vector<std::byte> out(100);
    try {
        source->read(0, out);
        FAIL() << "read what is no longer there";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::io);
        EXPECT_EQ(error.what(), path + ": byte 1: the file became shorter");
    }
}

TEST(ByteSource, MemoryReadsRanges) {
    const auto source = memory_source("here", {std::byte{1}, std::byte{2}, std::byte{3}});
    std::vector<std::byte> out(2);
    source->read(1, out);
    EXPECT_EQ(out, (std::vector{std::byte{2}, std::byte{3}}));
    EXPECT_THROW(source->read(2, out), Error);
    EXPECT_NO_THROW(source->read(3, {}));
}

}  // namespace
}  // namespace strata
