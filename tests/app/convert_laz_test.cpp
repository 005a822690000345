// The commands on LAZ files, by the real program: what comes of them is what comes of the same points uncompressed.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/support/lively_points.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

std::string bytes_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

struct Pair {
    const char* laz;
    int format, extra_bytes;
};

class LazCommands : public ::testing::TestWithParam<Pair> {
protected:
    static constexpr int kPoints = 126;

    void SetUp() override {
        test::LasFile file{.minor_version = GetParam().format < 6 ? 3 : 4, .point_format = GetParam().format};
        file.vlrs = {{"LASF_Spec", 4, {}}};
        for (int b = 0; b < GetParam().extra_bytes; ++b) {
            const auto entry = test::extra_bytes_entry("b" + std::to_string(b), 1);
            file.vlrs[0].payload.insert(file.vlrs[0].payload.end(), entry.begin(), entry.end());
        }
        for (int i = 0; i < kPoints; ++i) file.records.push_back(test::lively_record(GetParam().format, i, GetParam().extra_bytes));
        const std::vector<std::byte> bytes = file.bytes();
        std::ofstream(las(), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        std::filesystem::copy_file(std::string(STRATA_SOURCE_DIR) + "/tests/golden/laz/" + GetParam().laz, laz());
    }
    std::string las() const { return folder_.file("scan.las"); }
    std::string laz() const { return folder_.file("scan.laz"); }

    const TemporaryFolder folder_;
};

TEST_P(LazCommands, InfoSaysTheSame) {
    const ProgramResult compressed = run_strata({"info", "--exact", "--json", laz()});
    ASSERT_EQ(compressed.exit_code, 0) << compressed.err;
    json found = json::parse(compressed.out), expected = json::parse(run_strata({"info", "--exact", "--json", las()}).out);
    EXPECT_EQ(found["points"], kPoints);
    EXPECT_EQ(found["format"], "laz");
    for (json* report : {&found, &expected})
        for (const char* key : {"path", "format", "detail"}) report->erase(key);
    EXPECT_EQ(json::diff(expected, found), json::array());  // names what differs
}

TEST_P(LazCommands, ConvertMakesTheSame) {
    for (const std::string& scan : {las(), laz()}) {
        const ProgramResult result = run_strata({"convert", scan, scan + ".out", "--quiet"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
    }
    EXPECT_EQ(bytes_of(laz() + ".out/octree.bin"), bytes_of(las() + ".out/octree.bin"));
    EXPECT_EQ(bytes_of(laz() + ".out/hierarchy.bin"), bytes_of(las() + ".out/hierarchy.bin"));
    // And the two as one cloud: each point twice.
    const ProgramResult both = run_strata({"convert", las(), laz(), folder_.file("both"), "--json"});
    ASSERT_EQ(both.exit_code, 0) << both.err;
    EXPECT_EQ(json::parse(both.out)["points_written"], 2 * kPoints);
}

TEST_P(LazCommands, RenderDrawsTheSame) {
    for (const std::string& scan : {las(), laz()}) {
        const ProgramResult result = run_strata({"render", scan, "-o", scan + ".png", "--size", "64x64", "--color", "intensity", "--quiet"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
    }
    EXPECT_EQ(bytes_of(laz() + ".png"), bytes_of(las() + ".png"));
}

// A preview of a file that is smaller than what it takes is the whole picture.
TEST_P(LazCommands, APreviewOfAFewPointsIsAllOfThem) {
    for (const std::string& scan : {las(), laz()}) {
        const ProgramResult result = run_strata({"render", scan, "-o", scan + ".png", "--size", "64x64", "--stats", "--preview"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
        EXPECT_EQ(json::parse(result.out)["points_drawn"], kPoints);
    }
    EXPECT_EQ(bytes_of(laz() + ".png"), bytes_of(las() + ".png"));
}

INSTANTIATE_TEST_SUITE_P(Laz, LazCommands,
                         ::testing::Values(Pair{"format5_version2.laz", 5, 3}, Pair{"format8_chunks_of_any_size.laz", 8, 2},
                                           Pair{"format10_version4.laz", 10, 3}),
                         [](const auto& pair) { return "format" + std::to_string(pair.param.format); });

}  // namespace
}  // namespace strata
