// strata convert of parts: nodes of level-of-detail sets, and what is left of damaged files. By the real program.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/byte_source.h"
#include "io/las/las_header.h"
#include "io/las/laz_chunk_table.h"
#include "io/las/laz_header.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::file_contents;
using test::ProgramResult;
using test::run_strata;

constexpr uint64_t kPoints = 120'000;
constexpr uint64_t kChunkPoints = 50'000;  // of plain LAZ

class ConvertParts : public testing::Test {
protected:
    void SetUp() override { ASSERT_EQ(run_strata({"sample", file("scan.las"), "--points", std::to_string(kPoints), "--quiet"}).exit_code, 0); }

    std::string file(const std::string& name) const { return folder_.file(name); }
    static ProgramResult convert(std::vector<std::string> words) {
        words.insert(words.begin(), {"convert", "--json", "--no-sync", "--overwrite"});
        return run_strata(words);
    }
    static json converted(const std::vector<std::string>& words) {
        const ProgramResult result = convert(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return json::parse(result.out, nullptr, false);
    }
    void write(const std::string& name, const std::string& bytes) const { std::ofstream(file(name), std::ios::binary) << bytes; }
    std::vector<las::LazChunk> chunks_of(const std::string& name) const {
        const std::unique_ptr<ByteSource> bytes = open_file(file(name));
        const las::Header header = las::read_header(*bytes);
        return las::read_laz_chunks(*bytes, header, las::read_laz_header(*bytes, header)).chunks;
    }
    /// Bytes in the middle of a chunk become others.
    static void damage(std::string& bytes, const las::LazChunk& chunk) {
        for (uint64_t at = chunk.offset + chunk.size / 3; at < chunk.offset + chunk.size / 2; ++at) bytes[size_t(at)] = char(bytes[size_t(at)] ^ 0x5A);
    }

    const TemporaryFolder folder_;
};

TEST_F(ConvertParts, LevelsOfASetAreItsCoarserNodes) {
    for (const char* const name : {"set.copc.laz", "set"}) {
        (void)converted({file("scan.las"), file(name)});
        const json levels = json::parse(run_strata({"info", "--json", file(name)}).out)["points_per_level"];
        ASSERT_GE(levels.size(), 3u);
        uint64_t down_to = 0;
        for (size_t level = 0; level < levels.size(); ++level) {
            down_to += levels[level].get<uint64_t>();
            EXPECT_EQ(converted({file(name), file("part.las"), "--level", std::to_string(level)})["points_written"], down_to) << name;
        }
        EXPECT_EQ(down_to, kPoints);
    }
    const ProgramResult refused = convert({file("scan.las"), file("part.las"), "--level", "1"});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_NE(refused.err.find("scan.las: las has no levels to choose from"), std::string::npos) << refused.err;
}

// Nodes beside the box are damaged, which nobody notices; and the points are those of the plain file.
TEST_F(ConvertParts, ABoxReadsTheNodesThatItMeets) {
    (void)converted({file("scan.las"), file("set.copc.laz")});
    const json box = json::parse(run_strata({"info", "--json", file("scan.las")}).out)["bounds"];
    const auto at = [&](int axis, double share) {
        return std::to_string(box["min"][size_t(axis)].get<double>() * (1 - share) + box["max"][size_t(axis)].get<double>() * share);
    };
    const std::string bounds = at(0, 0.02) + "," + at(1, 0.02) + ",," + at(0, 0.1) + "," + at(1, 0.1) + ",";
    const json whole = converted({file("scan.las"), file("part.las"), "--bounds", bounds});
    EXPECT_GT(whole["points_written"], 200);
    EXPECT_EQ(converted({file("set.copc.laz"), file("part.las"), "--bounds", bounds})["points_written"], whole["points_written"]);

    std::string bytes = file_contents(file("set.copc.laz"));
    size_t damaged = 0;
    for (const las::LazChunk& chunk : chunks_of("set.copc.laz")) {
        std::string alone = file_contents(file("set.copc.laz"));
        damage(alone, chunk);
        write("alone.copc.laz", alone);
        if (convert({file("alone.copc.laz"), file("part.las"), "--bounds", bounds}).exit_code != 0) continue;  // a node that is needed
        damage(bytes, chunk);
        ++damaged;
    }
    EXPECT_GE(damaged, 5u);
    write("set.copc.laz", bytes);
    EXPECT_EQ(converted({file("set.copc.laz"), file("part.las"), "--bounds", bounds})["points_written"], whole["points_written"]);
    EXPECT_EQ(convert({file("set.copc.laz"), file("part.las")}).exit_code, 1);
}

TEST_F(ConvertParts, DamageCostsItsChunk) {
    (void)converted({file("scan.las"), file("scan.laz")});
    const std::vector<las::LazChunk> chunks = chunks_of("scan.laz");
    ASSERT_EQ(chunks.size(), 3u);
    std::string bytes = file_contents(file("scan.laz"));
    damage(bytes, chunks[1]);
    write("scan.laz", bytes);
    EXPECT_EQ(convert({file("scan.laz"), file("part.las")}).exit_code, 1);
    const json report = converted({file("scan.laz"), file("part.las"), "--salvage"});
    EXPECT_EQ(report["points_written"], kPoints - kChunkPoints);
    EXPECT_EQ(report["points_dropped"], kChunkPoints);
    EXPECT_NE(report["notes"].dump().find("scan.laz: chunk 2 of 3: "), std::string::npos) << report["notes"];
    // The records before and behind are the scan's own.
    const std::string scan = file_contents(file("scan.las")), part = file_contents(file("part.las"));
    const auto records = [](const std::string& las) {
        uint32_t offset;
        std::memcpy(&offset, las.data() + 96, sizeof offset);
        return las.substr(offset);
    };
    std::string expected = records(scan);
    const size_t record_size = expected.size() / kPoints;
    expected.erase(kChunkPoints * record_size, kChunkPoints * record_size);
    EXPECT_TRUE(records(part) == expected);
}

// A transfer that broke off took the chunk table along.
TEST_F(ConvertParts, AFileCutShortGivesWhatItHas) {
    (void)converted({file("scan.las"), file("scan.laz")});
    const las::LazChunk last = chunks_of("scan.laz")[2];
    const std::string laz = file_contents(file("scan.laz")), las = file_contents(file("scan.las"));
    write("cut.laz", laz.substr(0, last.offset + last.size / 2));
    EXPECT_EQ(convert({file("cut.laz"), file("part.las")}).exit_code, 1);
    json report = converted({file("cut.laz"), file("part.las"), "--salvage"});
    EXPECT_EQ(report["points_written"], 2 * kChunkPoints);
    EXPECT_EQ(report["points_dropped"], kPoints - 2 * kChunkPoints);

    const size_t record_size = 36;
    write("cut.las", las.substr(0, las.size() - 1000 * record_size - 1));
    EXPECT_EQ(convert({file("cut.las"), file("part.las")}).exit_code, 1);
    report = converted({file("cut.las"), file("part.laz"), "--salvage"});
    EXPECT_EQ(report["points_written"], kPoints - 1001);
    EXPECT_EQ(report["points_dropped"], 1001);
    EXPECT_NE(report["notes"].dump().find("the header counts 120000 points of 36 bytes, the file holds 118999"), std::string::npos) << report["notes"];
}

TEST_F(ConvertParts, SoundFilesLoseNothingBySalvage) {
    const json report = converted({file("scan.las"), file("part.laz"), "--salvage"});
    EXPECT_EQ(report["points_written"], kPoints);
    EXPECT_EQ(report["points_dropped"], 0);
    EXPECT_EQ(report["notes"], json::array());
}

}  // namespace
}  // namespace strata
