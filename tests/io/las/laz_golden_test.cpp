// Files that the reference compressor made of the points of lively_points.h, every kind of item in every version: their
// records must come out bit for bit.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "core/error.h"
#include "io/las/laz_source.h"
#include "tests/support/lively_points.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;

Bytes golden(const std::string& name) {
    std::ifstream file(std::string(STRATA_SOURCE_DIR) + "/tests/golden/laz/" + name, std::ios::binary);
    return test::bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
}

LazSource open(Bytes bytes) { return LazSource(memory_source("golden.laz", std::move(bytes))); }

Bytes all_records(const LazSource& source) {
    Bytes all;
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        const Bytes records = source.read_records(i);
        all.insert(all.end(), records.begin(), records.end());
    }
    return all;
}

uint64_t batch_points(const LazSource& source) {
    PointBatch batch;
    source.read_batch(0, {}, batch);
    return batch.size;
}

struct Golden {
    const char* name;
    int format, extra_bytes, points;
};
constexpr Golden kGoldens[] = {
    {"format5_version1", 5, 3, 126}, {"format5_version2", 5, 3, 126},  {"format5_one_stream", 5, 3, 38},
    {"format10_version3", 10, 3, 126}, {"format10_version4", 10, 3, 126}, {"format8_chunks_of_any_size", 8, 2, 126},
};

class LazGolden : public ::testing::TestWithParam<Golden> {
protected:
    Bytes file() const { return golden(std::string(GetParam().name) + ".laz"); }
    Bytes expected() const {
        Bytes all;
        for (int i = 0; i < GetParam().points; ++i) {
            const Bytes record = test::lively_record(GetParam().format, i, GetParam().extra_bytes);
            all.insert(all.end(), record.begin(), record.end());
        }
        return all;
    }
    void expect_records(Bytes bytes) const {
        const Bytes found = all_records(open(std::move(bytes))), wanted = expected();
        ASSERT_EQ(found.size(), wanted.size());
        const size_t at = size_t(std::mismatch(found.begin(), found.end(), wanted.begin()).first - found.begin());
        const size_t record_size = wanted.size() / size_t(GetParam().points);
        EXPECT_EQ(at, wanted.size()) << "point " << at / record_size << ", byte " << at % record_size;
    }
};

TEST_P(LazGolden, RecordsComeOutBitForBit) { expect_records(file()); }

// A writer to a pipe leaves -1 before the points and puts the offset of the table at the end.
TEST_P(LazGolden, TheTablesOffsetMayBeAtTheEnd) {
    Bytes bytes = file();
    const las::Header header = las::read_header(*memory_source("golden.laz", bytes));
    if (std::string(GetParam().name).ends_with("one_stream")) return;  // has none
    uint64_t table;
    std::memcpy(&table, bytes.data() + header.point_offset, 8);
    test::poke<uint64_t>(bytes, header.point_offset, UINT64_MAX);
    test::put<uint64_t>(bytes, table);
    expect_records(std::move(bytes));
}

// A writer that was interrupted leaves the offset of the offset, and no table.
TEST_P(LazGolden, WithoutATableChunksAreFoundOneBehindTheOther) {
    Bytes bytes = file();
    const las::Header header = las::read_header(*memory_source("golden.laz", bytes));
    if (std::string(GetParam().name).ends_with("one_stream")) return;  // has none
    uint64_t table;
    std::memcpy(&table, bytes.data() + header.point_offset, 8);
    test::poke<uint64_t>(bytes, header.point_offset, header.point_offset);
    bytes.resize(table);
    if (std::string(GetParam().name).ends_with("any_size"))
        EXPECT_THROW(open(std::move(bytes)), Error);
    else
        expect_records(std::move(bytes));
}

// What is not asked for must not change what is: attributes alone equal those of all at once.
TEST_P(LazGolden, EachAttributeAloneIsTheSame) {
    const LazSource source = open(file());
    const PointBatch all = test::points_of(source);
    for (size_t a = 0; a <= source.info().attributes.size(); ++a) {
        const int index = int(a);
        const std::span<const int> wanted(&index, a < source.info().attributes.size() ? 1 : 0);
        PointBatch batch;
        size_t row = 0, byte = 0;
        for (uint64_t i = 0; i < source.batch_count(); ++i) {
            source.read_batch(i, wanted, batch);
            for (size_t p = 0; p < batch.size; ++p, ++row)
                ASSERT_TRUE(batch.x[p] == all.x[row] && batch.y[p] == all.y[row] && batch.z[p] == all.z[row]) << "attribute " << a << ", point " << row;
            if (wanted.empty()) continue;
            ASSERT_TRUE(std::equal(batch.columns[a].begin(), batch.columns[a].end(), all.columns[a].begin() + std::ptrdiff_t(byte)))
                << source.info().attributes[a].name;
            byte += batch.columns[a].size();
        }
        EXPECT_EQ(row, all.size);
    }
}

// What a preview takes of a batch is what the batch begins with, of some attributes as of all.
TEST_P(LazGolden, FirstPointsAreThoseOfTheBatch) {
    const LazSource source = open(file());
    const std::vector<int> wanted = {0};
    for (uint64_t index = 0; index < source.batch_count(); ++index) {
        PointBatch whole, first;
        source.read_batch(index, wanted, whole);
        for (const uint64_t most : {uint64_t{0}, uint64_t{1}, uint64_t{33}, UINT64_MAX}) {
            source.read_first(index, most, wanted, first);
            if (index > 0 && first.size == 0) continue;  // not to be reached without what lies before
            ASSERT_EQ(first.size, std::min<uint64_t>(most, whole.size));
            EXPECT_TRUE(std::equal(first.x.begin(), first.x.end(), whole.x.begin()));
            EXPECT_TRUE(std::equal(first.z.begin(), first.z.end(), whole.z.begin()));
            EXPECT_TRUE(std::equal(first.columns[0].begin(), first.columns[0].end(), whole.columns[0].begin()));
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Laz, LazGolden, ::testing::ValuesIn(kGoldens), [](const auto& golden_file) { return std::string(golden_file.param.name); });

// A chunk too large for a batch is read in parts, in whatever order they are asked for.
TEST(LazParts, OfALargeChunkComeInAnyOrder) {
    const LazSource source(memory_source("golden.laz", golden("format0_large_chunk.laz")));
    const uint64_t count = source.batch_count();
    ASSERT_GT(count, 3u);
    const PointBatch all = test::points_of(source);
    EXPECT_EQ(all.size, 600'000u);
    for (size_t i = 0; i < all.size; i += 997) ASSERT_EQ(all.x[i], int32_t(i / 100'000 * 7)) << i;
    PointBatch batch;
    for (const uint64_t index : {count - 1, uint64_t{1}, uint64_t{0}, uint64_t{2}, count - 1}) {
        const uint64_t first = index * batch_points(source);
        source.read_batch(index, {}, batch);
        ASSERT_TRUE(std::equal(batch.x.begin(), batch.x.end(), all.x.begin() + std::ptrdiff_t(first))) << index;
    }
}

// Prototypes of the reference compressor marked layered items as version 2.
TEST(LazVersions, LayeredVersionTwoIsThree) {
    Bytes bytes = golden("format8_chunks_of_any_size.laz");
    const Bytes before = all_records(open(bytes));
    const las::Header header = las::read_header(*memory_source("golden.laz", bytes));
    for (const las::VariableRecord& record : header.records)
        if (record.record_id == 22204)
            for (size_t item = 0; item < 3; ++item) test::poke<uint16_t>(bytes, record.offset + 34 + 6 * item + 4, 2);
    EXPECT_EQ(all_records(open(bytes)), before);
}

}  // namespace
}  // namespace strata
