// LAZ files that lie: each is refused with one line that names file, place and expectation.
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <iterator>

#include "core/error.h"
#include "io/las/laz_source.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;
using test::poke;

Bytes golden(const std::string& name) {
    std::ifstream file(std::string(STRATA_SOURCE_DIR) + "/tests/golden/laz/" + name + ".laz", std::ios::binary);
    return test::bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
}

void read_all(Bytes bytes) {
    const LazSource source(memory_source("bad.laz", std::move(bytes)));
    const PointBatch points = test::points_of(source);
    ASSERT_EQ(points.size, source.info().points);
}

void expect_one_line(const Error& error) {
    const std::string text = error.what();
    EXPECT_EQ(error.kind, ErrorKind::malformed) << text;
    EXPECT_TRUE(text.starts_with("bad.laz: ")) << text;
    EXPECT_NE(text.find("byte "), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_EQ(text.find("bad.laz", 1), std::string::npos) << text;
}

class LazFile : public ::testing::TestWithParam<const char*> {
protected:
    Bytes whole_ = golden(GetParam());
    las::Header header_ = las::read_header(*memory_source("bad.laz", whole_));
};

// Whatever is cut off, something of what the header promises is missing.
TEST_P(LazFile, EveryTruncationIsRefused) {
    for (size_t size = 0; size < whole_.size(); ++size) {
        try {
            read_all(Bytes(whole_.begin(), whole_.begin() + std::ptrdiff_t(size)));
            FAIL() << "accepted the first " << size << " of " << whole_.size() << " bytes";
        } catch (const Error& error) {
            expect_one_line(error);
        }
    }
}

// One byte changed: another point here and there, or an Error; never more or fewer points, never a crash.
TEST_P(LazFile, AnyByteMayBeWrong) {
    size_t refused = 0;
    for (size_t at = header_.point_offset; at < whole_.size(); at += 23) {
        Bytes bytes = whole_;
        bytes[at] ^= std::byte(at % 3 == 0 ? 0x01 : at % 3 == 1 ? 0x80 : 0xFF);
        try {
            read_all(std::move(bytes));
        } catch (const Error& error) {
            expect_one_line(error);
            ++refused;
        }
    }
    EXPECT_GT(refused, 0u);
}

INSTANTIATE_TEST_SUITE_P(Laz, LazFile,
                         ::testing::Values("format5_version1", "format5_version2", "format5_one_stream", "format10_version3", "format10_version4",
                                           "format8_chunks_of_any_size"),
                         [](const auto& name) { return std::string(name.param); });

/// Places in a golden file.
struct Places {
    size_t laz_record, point_offset, table;

    explicit Places(const Bytes& bytes) {
        const las::Header header = las::read_header(*memory_source("bad.laz", bytes));
        for (const las::VariableRecord& record : header.records)
            if (record.record_id == 22204) laz_record = record.offset;
        point_offset = header.point_offset;
        uint64_t pointer;
        std::memcpy(&pointer, bytes.data() + point_offset, 8);
        table = size_t(pointer);
    }
};

struct Lie {
    const char* name;
    const char* file;
    std::function<void(Bytes&, const Places&)> tell;
    const char* expected;  // part of the message
    ErrorKind kind = ErrorKind::malformed;
};

const Lie kLies[] = {
    {"compressor", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record, 4); }, "compressor 4, compressors 1 to 3 are known", ErrorKind::unsupported},
    {"compressor_none", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record, 0); }, "compressor 0", ErrorKind::unsupported},
    {"compressor_of_other_formats", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record, 3); }, "compressor 3 with point format 5"},
    {"coder", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 2, 1); }, "coder 1", ErrorKind::unsupported},
    {"item_count", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 32, 65535); }, "65535 items, there is room for 5"},
    {"item_missing", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 32, 4); }, "item byte (3 bytes) is missing"},
    {"item_kind", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 34, 10); }, "item 1 is point14 (20 bytes), point format 5 with records of 66 bytes has point10 (20 bytes)"},
    {"item_unknown", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 34, 999); }, "item 1 is type 999"},
    {"item_size", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 34 + 24 + 2, 4); }, "item 5 is byte (4 bytes)"},
    {"item_version", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 38, 3); }, "of version 3 is not known", ErrorKind::unsupported},
    {"item_versions_differ", "format5_version2", [](Bytes& b, const Places& p) { poke<uint16_t>(b, p.laz_record + 38, 1); }, "items of versions 1 and 2", ErrorKind::unsupported},
    {"record_length", "format10_version3", [](Bytes& b, const Places&) { poke<uint16_t>(b, 105, 71); }, "item 4 is byte14 (3 bytes), point format 10 with records of 71 bytes has byte14 (4 bytes)"},
    {"point_format", "format5_version2", [](Bytes& b, const Places&) { poke<uint8_t>(b, 104, 0x84); }, "point format 4"},
    {"table_before_points", "format5_version2", [](Bytes& b, const Places& p) { poke<uint64_t>(b, p.point_offset, p.point_offset + 7); }, "chunk table: byte"},
    {"table_beyond_file", "format5_version2", [](Bytes& b, const Places& p) { poke<uint64_t>(b, p.point_offset, UINT64_MAX - 1); }, "its offset is 18446744073709551614"},
    {"table_version", "format5_version2", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.table, 1); }, "version 1, version 0 is known"},
    {"table_count", "format5_version2", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.table + 4, 4); }, "4 chunks of 50 points, 126 points need 3"},
    {"table_count_huge", "format8_chunks_of_any_size", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.table + 4, UINT32_MAX); }, "4294967295 chunks, the"},
    {"table_count_none", "format8_chunks_of_any_size", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.table + 4, 0); }, "no chunks, but the header counts 126 points"},
    {"table_count_small", "format8_chunks_of_any_size", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.table + 4, 1); }, "points, the header counts 126"},
    {"chunk_size", "format5_version2", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.laz_record + 12, 42); }, "chunk"},
    {"points_more", "format5_one_stream", [](Bytes& b, const Places&) { poke<uint32_t>(b, 107, 1000000); }, "chunk 1 of 1: byte"},
    {"points_too_many", "format5_one_stream", [](Bytes& b, const Places&) { poke<uint32_t>(b, 107, UINT32_MAX); }, "4294967295 points cannot lie in"},
    {"points_64_bit", "format10_version3", [](Bytes& b, const Places&) { poke<uint64_t>(b, 247, UINT64_MAX); }, "chunks of 50 points"},
    {"layer_size", "format10_version3", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.point_offset + 8 + 70 + 4, 0xFFFFFFFF); }, "chunk 1 of 3: byte"},
    {"layer_points", "format10_version3", [](Bytes& b, const Places& p) { poke<uint32_t>(b, p.point_offset + 8 + 70, 49); }, "it says that it has 49 points, 50 are expected"},
};

class LazLie : public ::testing::TestWithParam<Lie> {};

TEST_P(LazLie, IsRefusedWithOneClearLine) {
    Bytes bytes = golden(GetParam().file);
    GetParam().tell(bytes, Places(bytes));
    try {
        read_all(std::move(bytes));
        FAIL() << "accepted";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, GetParam().kind);
        EXPECT_NE(std::string(error.what()).find(GetParam().expected), std::string::npos) << error.what();
        EXPECT_EQ(std::string(error.what()).rfind("bad.laz: ", 0), 0u) << error.what();
    }
}

INSTANTIATE_TEST_SUITE_P(Laz, LazLie, ::testing::ValuesIn(kLies), [](const auto& lie) { return std::string(lie.param.name); });

}  // namespace
}  // namespace strata
