// The encoder writes the bytes that the reference compressor wrote: files of others, decoded and encoded again in the same
// chunks, are themselves again. What no such file has must come back through the decoder.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "io/las/laz_chunk_table.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_encoder.h"
#include "tests/support/lively_points.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;
using test::put;

Bytes contents(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return test::bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
}

/// A LAZ file taken apart.
struct Opened {
    Bytes bytes;
    std::unique_ptr<ByteSource> source;
    las::Header header;
    las::LazHeader laz;
    las::LazChunks chunks;

    explicit Opened(Bytes file) : bytes(std::move(file)), source(memory_source("file.laz", bytes)), header(las::read_header(*source)) {
        laz = las::read_laz_header(*source, header);
        chunks = las::read_laz_chunks(*source, header, laz);
    }
    Bytes chunk(const las::LazChunk& chunk) const {
        return Bytes(bytes.begin() + std::ptrdiff_t(chunk.offset), bytes.begin() + std::ptrdiff_t(chunk.offset + chunk.size));
    }
    Bytes records(const las::LazChunk& chunk) const {
        const std::unique_ptr<las::LazDecoder> decoder = las::make_laz_decoder(header, laz, {});
        Bytes records(size_t(chunk.points) * header.record_size);
        decoder->begin(*source, chunk);
        decoder->decode(size_t(chunk.points), records.data());
        EXPECT_EQ(decoder->finish(), chunk.offset + chunk.size);
        return records;
    }
};

size_t first_difference(const Bytes& a, const Bytes& b) {
    return size_t(std::mismatch(a.begin(), a.begin() + std::ptrdiff_t(std::min(a.size(), b.size())), b.begin()).first - a.begin());
}

void expect_own_chunks(const Opened& file) {
    const std::unique_ptr<las::LazEncoder> encoder = las::make_laz_encoder(file.header.point_format, file.header.record_size);
    for (size_t i = 0; i < file.chunks.chunks.size(); ++i) {
        const las::LazChunk& chunk = file.chunks.chunks[i];
        const Bytes expected = file.chunk(chunk), records = file.records(chunk);
        Bytes found;
        encoder->encode(records, found);
        ASSERT_EQ(found == expected, true) << "chunk " << i << " of " << chunk.points << " points: byte " << first_difference(found, expected) << " of "
                                           << expected.size() << ", written " << found.size();
    }
}

/// The chunk table of a file: what lies behind its chunks.
void expect_own_table(const Opened& file) {
    uint64_t table;
    std::memcpy(&table, file.bytes.data() + file.header.point_offset, 8);
    std::vector<las::LazTableEntry> entries;
    for (const las::LazChunk& chunk : file.chunks.chunks) entries.push_back({uint32_t(chunk.points), uint32_t(chunk.size)});
    const Bytes found = las::encode_chunk_table(entries, file.laz.chunk_points == 0);
    ASSERT_LE(found.size(), file.bytes.size() - table);
    EXPECT_TRUE(std::equal(found.begin(), found.end(), file.bytes.begin() + std::ptrdiff_t(table)));
}

/// The record "laszip encoded", apart from the version of the program that wrote it.
void expect_own_record(const Opened& file) {
    const uint32_t chunk_points = file.laz.chunk_points == 0 ? las::kVariableChunks : file.laz.chunk_points;
    Bytes found = las::laszip_record(file.header.point_format, file.header.record_size, chunk_points);
    for (const las::VariableRecord& record : file.header.records) {
        if (!record.is("laszip encoded", 22204)) continue;
        Bytes expected = las::read_record(*file.source, record, 1000);
        constexpr size_t kVersion = 4, kVersionBytes = 4;
        for (Bytes* bytes : {&found, &expected}) std::fill_n(bytes->begin() + kVersion, kVersionBytes, std::byte{0});
        EXPECT_EQ(found, expected);
        return;
    }
    FAIL() << "it has none";
}

class LazWrittenByOthers : public ::testing::TestWithParam<const char*> {
protected:
    std::unique_ptr<Opened> open() const {
        const std::string name = GetParam();
        if (name.starts_with("golden/")) return std::make_unique<Opened>(contents(std::string(STRATA_SOURCE_DIR) + "/tests/golden/laz/" + name.substr(7)));
        const char* const data = std::getenv("STRATA_DATA");
        if (data == nullptr || !std::filesystem::exists(std::string(data) + "/" + name)) return nullptr;
        return std::make_unique<Opened>(contents(std::string(data) + "/" + name));
    }
};

TEST_P(LazWrittenByOthers, IsWrittenAgainByteForByte) {
    const std::unique_ptr<Opened> file = open();
    if (!file) GTEST_SKIP() << "not in STRATA_DATA: " << GetParam();
    expect_own_chunks(*file);
    expect_own_table(*file);
    expect_own_record(*file);
}

// All files of others that were at hand, but for one of items of version 1, which is not written any more.
INSTANTIATE_TEST_SUITE_P(Laz, LazWrittenByOthers,
                         ::testing::Values("golden/format0_large_chunk.laz", "golden/format5_version2.laz", "golden/format8_chunks_of_any_size.laz",
                                           "golden/format10_version3.laz", "laz/point10.las.laz", "laz/point-time.las.laz",
                                           "laz/point-time-1.4.las.laz", "laz/point-color.las.laz", "laz/point-color-time.las.laz", "laz/simple.laz",
                                           "laz/laszip-generated_with2bytespadding.laz", "laz/plane.laz", "laz/extrabytes.laz", "laz/autzen_trim.laz",
                                           "laz/example_data.laz", "laz/no-points-1.3.laz", "laz/1_4_w_evlr.laz", "laz/eb.laz", "laz/append-bug.laz",
                                           "copc/1.2-with-color.copc.laz", "copc/lion_takanawa.copc.laz"),
                         [](const auto& file) {
                             std::string name = file.param;
                             std::replace_if(name.begin(), name.end(), [](char c) { return !std::isalnum(c); }, '_');
                             return name;
                         });

/// What a decoder makes of a chunk.
Bytes decoded(int format, size_t record_size, size_t points, const Bytes& chunk) {
    las::Header header;
    header.point_format = format;
    header.record_size = uint16_t(record_size);
    las::LazHeader laz;
    laz.layered = format >= 6;
    laz.chunked = true;
    laz.items = las::laz_items(format, record_size);
    const std::unique_ptr<ByteSource> source = memory_source("chunk", chunk);
    const std::unique_ptr<las::LazDecoder> decoder = las::make_laz_decoder(header, laz, {});
    Bytes records(points * record_size);
    decoder->begin(*source, {.offset = 0, .size = chunk.size(), .points = points, .open_end = false});
    decoder->decode(points, records.data());
    EXPECT_EQ(decoder->finish(), chunk.size());
    return records;
}

Bytes encoded(int format, const std::vector<Bytes>& records) {
    Bytes all, out;
    for (const Bytes& record : records) all.insert(all.end(), record.begin(), record.end());
    las::make_laz_encoder(format, records.front().size())->encode(all, out);
    return out;
}

void expect_back(int format, const std::vector<Bytes>& records) {
    Bytes all;
    for (const Bytes& record : records) all.insert(all.end(), record.begin(), record.end());
    const Bytes back = decoded(format, records.front().size(), records.size(), encoded(format, records));
    const size_t at = first_difference(back, all);
    EXPECT_EQ(at, all.size()) << "format " << format << ": point " << at / records.front().size() << ", byte " << at % records.front().size();
}

class LazRoundTrip : public ::testing::TestWithParam<int> {
protected:
    std::vector<Bytes> records(const std::vector<test::LasPoint>& points) const {
        std::vector<Bytes> all;
        for (const test::LasPoint& point : points) all.push_back(test::las_record(GetParam(), point));
        return all;
    }
};

TEST_P(LazRoundTrip, LivelyPointsComeBack) {
    for (const int extra_bytes : {0, 1, 3, 40})
        for (const int count : {1, 2, 3, 126, 2000}) {
            std::vector<Bytes> records;
            for (int i = 0; i < count; ++i) records.push_back(test::lively_record(GetParam(), i, extra_bytes));
            expect_back(GetParam(), records);
        }
}

// Noise in every byte, in records of which whole runs are the same: no field is spared, none is likely.
TEST_P(LazRoundTrip, NoiseComesBack) {
    const size_t size = las::point_layout(GetParam()).size + 2;
    uint64_t state = 88172645463325252;
    const auto random = [&] { return state ^= state << 13, state ^= state >> 7, state ^= state << 17; };
    for (const uint64_t keep : {0, 1, 6}) {
        std::vector<Bytes> records = {Bytes(size)};
        for (int i = 0; i < 3000; ++i) {
            Bytes record = records.back();
            for (std::byte& byte : record)
                if (random() % (keep + 1) == 0) byte = std::byte(random() >> 24);
            records.push_back(record);
        }
        expect_back(GetParam(), records);
    }
}

TEST_P(LazRoundTrip, CoordinatesWrap) {
    std::vector<test::LasPoint> points;
    for (const int32_t x : {0, INT32_MAX, INT32_MIN, -1, 1, INT32_MIN, INT32_MIN + 1, 0, INT32_MIN, INT32_MAX, 5, -5})
        for (const int32_t y : {INT32_MIN, 0, INT32_MAX, -7})
            points.push_back({.x = x, .y = y, .z = int32_t(uint32_t(x) + uint32_t(y))});
    expect_back(GetParam(), records(points));
}

// The bits of times: steps of every kind, sequences in turns, and doubles that are no numbers.
TEST_P(LazRoundTrip, GpsTimesJumpAndRepeat) {
    const uint64_t t = 0x41A5F5E100000000, nan = 0x7FF8000000000001;
    const std::vector<uint64_t> times = {
        t, t, t + 100, t + 200, t + 300, t + 300, t + 299, t + 399, t + 100 * 500, t + 100 * 5000, t - 100, t - 2000, t + 90'000, t + 90'001, t + 90'050,
        t + INT32_MAX, t, t + (uint64_t{1} << 31), t, t - (uint64_t{1} << 31), t, t + (uint64_t{1} << 40), t + 1, t + (uint64_t{1} << 40) + 1,
        t + 2, t + (uint64_t{1} << 50), t + (uint64_t{1} << 51), t + (uint64_t{1} << 40) + 2, t + 3, t + (uint64_t{1} << 52), t + 4, 0, uint64_t{1} << 63, 0,
        nan, nan, nan, uint64_t{1} << 63, nan | uint64_t{1} << 63, t, t + 1, t + 2, t + 2 + INT32_MAX, UINT64_MAX, UINT64_MAX, 1};
    for (const int same : {1, 3}) {
        std::vector<test::LasPoint> points;
        for (const uint64_t time : times)
            for (int i = 0; i < same; ++i) {
                points.push_back({.x = i});
                std::memcpy(&points.back().gps_time, &time, sizeof time);
            }
        expect_back(GetParam(), records(points));
    }
}

TEST_P(LazRoundTrip, ColorsComeBack) {
    std::vector<test::LasPoint> points;
    for (const uint16_t red : {0, 255, 256, 65535, 4000})
        for (const uint16_t green : {0, 255, 256, 65535, 4001})
            for (const uint16_t blue : {65535, 0, 255, 257, 4000}) points.push_back({.rgb = {red, green, blue}, .nir = uint16_t(red ^ blue)});
    expect_back(GetParam(), records(points));
}

// Each point of the pulse in turns, over all pairs, also those that no pulse has.
TEST_P(LazRoundTrip, ReturnsComeBack) {
    const int most = GetParam() >= 6 ? 15 : 7;
    std::vector<test::LasPoint> points;
    for (int n = 0; n <= most; ++n)
        for (int r = 0; r <= most; ++r)
            points.push_back({.x = 10 * r, .y = n, .z = n * r, .intensity = uint16_t(n * 16 + r), .return_number = uint8_t(r * 7 & most), .number_of_returns = uint8_t(n)});
    expect_back(GetParam(), records(points));
}

INSTANTIATE_TEST_SUITE_P(Formats, LazRoundTrip, ::testing::Range(0, 11));

// Scanner channels come, go and come again; each keeps what it saw last, and no two say the same.
TEST(LazLayers, ScannerChannelsComeBack) {
    const std::vector<std::vector<int>> orders = {{0, 1, 0, 1}, {3, 3, 0, 0, 2, 1, 3}, {2, 0, 2, 0, 0, 0, 2}, {1, 2, 3, 0, 3, 2, 1}};
    for (const int format : {6, 7, 8, 9, 10})
        for (const std::vector<int>& order : orders) {
            std::vector<Bytes> records;
            for (int i = 0; i < 300; ++i) {
                const int channel = order[size_t(i) % order.size()];
                test::LasPoint point = test::lively_point(format, i * (channel + 1));
                point.flags = uint8_t((point.flags & ~0x30) | channel << 4);
                point.rgb[1] = uint16_t(1000 * channel + i);
                records.push_back(test::las_record(format, point));
                records.back().push_back(std::byte(channel * 50 + i));
            }
            expect_back(format, records);
        }
}

Bytes stream_without_symbols() {
    // The whole interval is left: one byte tells a number in its middle, three zeros are read ahead.
    return {std::byte{1}, std::byte{0}, std::byte{0}, std::byte{0}};
}

TEST(LazChunkOfOnePoint, IsItsRecordAndAnEmptyStream) {
    const Bytes record = test::lively_record(3, 5, 1);
    Bytes expected = record;
    for (const std::byte byte : stream_without_symbols()) expected.push_back(byte);
    EXPECT_EQ(encoded(3, {record}), expected);
}

TEST(LazChunkOfOnePoint, HasTwoLayersOfNothing) {
    const Bytes record = test::lively_record(8, 5, 1);
    Bytes expected = record;
    put<uint32_t>(expected, 1);
    for (int layer = 0; layer < 9 + 2 + 1; ++layer) put<uint32_t>(expected, layer < 2 ? 4 : 0);
    for (int layer = 0; layer < 2; ++layer)
        for (const std::byte byte : stream_without_symbols()) expected.push_back(byte);
    EXPECT_EQ(encoded(8, {record}), expected);
}

// Which layers of a chunk of format 8 with an extra byte have bytes, '1', in their order.
std::string layers_with_bytes(const std::vector<test::LasPoint>& points, const std::vector<int>& extra) {
    std::vector<Bytes> records;
    for (size_t i = 0; i < points.size(); ++i) {
        records.push_back(test::las_record(8, points[i]));
        records.back().push_back(std::byte(extra[i]));
    }
    const Bytes chunk = encoded(8, records);
    std::string layers;
    for (size_t layer = 0; layer < 12; ++layer) {
        uint32_t size;
        std::memcpy(&size, chunk.data() + 39 + 4 + 4 * layer, 4);
        layers += size > 0 ? '1' : '0';
    }
    return layers;
}

TEST(LazLayers, ThoseWithoutAChangeAreLeftOut) {
    const test::LasPoint grey = {.x = 3, .z = 9, .intensity = 77, .rgb = {5, 5, 5}, .nir = 6};
    const auto changed = [&](auto change) {
        test::LasPoint other = grey;
        change(other);
        return layers_with_bytes({grey, grey, other, grey}, {8, 8, 8, 8});
    };
    // x and y, z, classification, flags, intensity, scan angle, user data, source, time, color, infrared, extra byte
    EXPECT_EQ(changed([](test::LasPoint&) {}), "110000000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.z = 1; }), "110000000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.flags = 0x10; }), "110000000000");  // the channel is of the first layer
    EXPECT_EQ(changed([](test::LasPoint& p) { p.classification = 1; }), "111000000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.flags = 0x41; }), "110100000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.intensity = 1; }), "110010000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.scan_angle = 1; }), "110001000000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.user_data = 1; }), "110000100000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.point_source_id = 1; }), "110000010000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.gps_time = 1.0; }), "110000001000");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.rgb[2] = 1; }), "110000000100");
    EXPECT_EQ(changed([](test::LasPoint& p) { p.nir = 1; }), "110000000010");
    EXPECT_EQ(layers_with_bytes({grey, grey}, {8, 9}), "110000000001");
    // That a color is not grey is told each time.
    test::LasPoint colored = grey;
    colored.rgb = {5, 5, 6};
    EXPECT_EQ(layers_with_bytes({colored, colored}, {8, 8}), "110000000100");
}

TEST(LazEncoders, GoOnBehindWhatIsThereAndKeepNothing) {
    for (const int format : {3, 8}) {
        std::vector<Bytes> records;
        Bytes all, out = {std::byte{42}};
        for (int i = 0; i < 700; ++i) {
            records.push_back(test::lively_record(format, i, 2));
            all.insert(all.end(), records.back().begin(), records.back().end());
        }
        const Bytes once = encoded(format, records);
        const std::unique_ptr<las::LazEncoder> encoder = las::make_laz_encoder(format, records.front().size());
        Bytes scrap;
        encoder->encode(std::span(all).subspan(0, 50 * records.front().size()), scrap);
        encoder->encode(all, out);
        ASSERT_EQ(out.size(), 1 + once.size());
        EXPECT_EQ(out.front(), std::byte{42});
        EXPECT_TRUE(std::equal(once.begin(), once.end(), out.begin() + 1));
    }
}

TEST(LazEncoders, RefuseWhatTheyCannotWrite) {
    const auto message = [](int format, size_t size) -> std::string {
        try {
            las::make_laz_encoder(format, size);
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::unsupported);
            return error.what();
        }
        return "";
    };
    EXPECT_EQ(message(11, 30), "point format 11 cannot be compressed, formats 0 to 10 can");
    EXPECT_EQ(message(-1, 30), "point format -1 cannot be compressed, formats 0 to 10 can");
    EXPECT_EQ(message(3, 33), "records of 33 bytes, those of point format 3 have 34 to 65535");
    EXPECT_EQ(message(7, 65536), "records of 65536 bytes, those of point format 7 have 36 to 65535");
    EXPECT_EQ(message(7, 36), "");
    EXPECT_THROW(las::laszip_record(11, 30, 50'000), Error);
}

TEST(LazTables, OfNoChunksAreVersionAndCount) { EXPECT_EQ(las::encode_chunk_table({}, true), Bytes(8)); }

// Sizes of all magnitudes, and back.
TEST(LazTables, ComeBackThroughTheReader) {
    std::vector<las::LazTableEntry> entries;
    for (uint32_t i = 1; i < 400; ++i) entries.push_back({1 + i * 2654435761u % 5000, i % 7 == 0 ? 3000u * i : 40 + i % 11});
    uint64_t points = 0, bytes = 0;
    for (const las::LazTableEntry& entry : entries) {
        points += entry.points;
        bytes += entry.bytes;
    }
    Bytes file(8);
    test::poke<uint64_t>(file, 0, 8 + bytes);
    file.resize(8 + bytes);
    const Bytes table = las::encode_chunk_table(entries, true);
    file.insert(file.end(), table.begin(), table.end());
    las::Header header;
    header.record_size = 20;
    header.points = points;
    las::LazHeader laz;
    laz.chunked = true;
    const las::LazChunks read = las::read_laz_chunks(*memory_source("table", file), header, laz);
    ASSERT_EQ(read.chunks.size(), entries.size());
    uint64_t offset = 8;
    for (size_t i = 0; i < entries.size(); ++i) {
        EXPECT_EQ(read.chunks[i].points, entries[i].points);
        EXPECT_EQ(read.chunks[i].size, entries[i].bytes);
        EXPECT_EQ(read.chunks[i].offset, offset);
        offset += entries[i].bytes;
    }
}

}  // namespace
}  // namespace strata
