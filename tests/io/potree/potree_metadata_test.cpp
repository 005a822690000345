#include "io/potree/potree_metadata.h"

#include <gtest/gtest.h>

#include <numeric>

#include "core/error.h"
#include "core/octree/layered_validation.h"
#include "tests/support/potree_files.h"

namespace strata {
namespace {

std::string valid_text(bool brotli = false) {
    test::PotreeSet set;
    set.brotli = brotli;
    set.nodes["r"] = {test::PotreePoint{}};
    return test::make_potree(set).metadata;
}

PotreeMetadata parse(const std::string& text) { return parse_potree_metadata(std::as_bytes(std::span(text))); }

std::string message_of(const std::string& text) {
    try {
        parse(text);
    } catch (const Error& error) {
        return error.what();
    }
    return "nothing was thrown";
}

struct Nonsense {
    const char* from;
    const char* to;
    const char* expected;  // part of the message
};

constexpr Nonsense kNonsense[] = {
    {"\"version\": \"2.0\"", "\"version\": \"1.8\"", "'version': Potree 2.x is expected, '1.8' found"},
    {"\"version\": \"2.0\"", "\"version\": 2", "'version': a text is expected"},
    {"\"points\": 1", "\"points\": -1", "'points': a count"},
    {"\"points\": 1", "\"points\": 1.5", "'points': a count"},
    {"\"points\": 1", "\"points\": 18446744073709551615", "'points': a count up to"},
    {"\"firstChunkSize\": 22", "\"firstChunkSize\": \"22\"", "'hierarchy.firstChunkSize': a count"},
    {"\"hierarchy\"", "\"higherarchy\"", "'hierarchy': an object"},
    {"\"scale\": [0.001, ", "\"scale\": [0, ", "'scale': a positive scale"},
    {"\"scale\": [0.001, ", "\"scale\": [-0.001, ", "'scale': a positive scale"},
    {"\"scale\": [0.001, ", "\"scale\": [null, ", "'scale': an array of 3 finite numbers"},
    {"\"scale\": [0.001, ", "\"scale\": [NaN, ", "not JSON"},
    {"\"scale\": [0.001, ", "\"scale\": [1e999, ", "a number out of range"},
    {"\"scale\": [0.001, ", "\"scale\": [", "'scale': an array of 3 finite numbers"},
    {"\"spacing\": 1", "\"spacing\": 0", "'spacing': a positive number"},
    {"\"boundingBox\": {\"min\": [0, 0, 0]", "\"boundingBox\": {\"min\": [0, 200, 0]", "'boundingBox': min below max"},
    {"\"boundingBox\": {\"min\": [0, 0, 0]", "\"boundingBox\": {\"min\": [-1.7e308, 0, 0]", "nothing was thrown"},
    {"\"encoding\": \"DEFAULT\"", "\"encoding\": \"ZSTD\"", "'encoding': DEFAULT or BROTLI"},
    {"\"attributes\": [", "\"attributes\": [3, ", "'attributes[0]': an object"},
    {"\"name\": \"position\"", "\"name\": \"place\"", "'attributes': an attribute 'position'"},
    {"\"name\": \"rgb\"", "\"name\": \"position\"", "'attributes[2].type': int32 x 3 for the position"},
    {"\"size\": 12", "\"size\": 13", "'attributes[0].size': numElements x elementSize"},
    {"\"size\": 2, \"numElements\": 1", "\"size\": 0, \"numElements\": 0", "'attributes[1].size': numElements x elementSize"},
    {"\"size\": 2, \"numElements\": 1", "\"size\": 2, \"numElements\": 4294967296", "'attributes[1].numElements': a count up to 1024"},
    {"\"type\": \"double\"", "\"type\": \"float\"", "'attributes[3].elementSize': the size of float"},
};

TEST(PotreeMetadata, NonsenseIsNamedByItsKey) {
    for (const Nonsense& row : kNonsense) {
        std::string text = valid_text();
        const size_t at = text.find(row.from);
        ASSERT_NE(at, std::string::npos) << row.from;
        text.replace(at, std::string(row.from).size(), row.to);
        const std::string message = message_of(text);
        EXPECT_NE(message.find(row.expected), std::string::npos) << row.to << ": " << message;
    }
    EXPECT_EQ(message_of("[]"), "a JSON object is expected");
    EXPECT_EQ(message_of(std::string(100000, '[')), "JSON nested too deep");
    EXPECT_EQ(message_of(""), "byte 1: not JSON");
}

TEST(PotreeMetadata, LaysOutRecordsAndColumns) {
    const PotreeMetadata plain = parse(valid_text()), brotli = parse(valid_text(true));
    EXPECT_EQ(plain.record_bytes, 12u + 2 + 6 + 8);
    EXPECT_EQ(brotli.column_bytes, 16u + 2 + 8 + 8);
    EXPECT_EQ(plain.fields[3].record_offset, 20u);
    EXPECT_FALSE(plain.fields[2].rgb_morton);
    EXPECT_TRUE(brotli.fields[2].rgb_morton);
    EXPECT_EQ(plain.attributes.size(), 3u);
}

std::array<int64_t, 3> quanta_sums(LayeredCloud& cloud) {
    std::array<int64_t, 3> sums{};
    PointBatch batch;
    for (NodeId id = 0; id < cloud.node_count(); ++id) {
        cloud.read_node(id, {}, batch);
        const std::vector<int32_t>* columns[] = {&batch.x, &batch.y, &batch.z};
        for (size_t axis = 0; axis < 3; ++axis)
            sums[axis] += std::accumulate(columns[axis]->begin(), columns[axis]->end(), int64_t{0});
    }
    return sums;
}

// Written by PotreeConverter 2 (c2328c4) from 500 points of our own simulator. It marks inner nodes as leaves, and its
// BROTLI encoder is one quantum high on each axis, which readers do not undo.
TEST(PotreePeer, PotreeConvertersOutputIsReadWhole) {
    const std::string folder = std::string(STRATA_SOURCE_DIR) + "/tests/io/potree/peer/";
    const auto plain = open_potree(folder + "plain"), brotli = open_potree(folder + "brotli");
    for (LayeredCloud* cloud : {plain.get(), brotli.get()})
        EXPECT_EQ(validate_layered(*cloud, {.read_points = true}).points, 500u);
    const std::array<int64_t, 3> low = quanta_sums(*plain), high = quanta_sums(*brotli);
    for (size_t axis = 0; axis < 3; ++axis) EXPECT_EQ(high[axis] - low[axis], 500);
}

}  // namespace
}  // namespace strata
