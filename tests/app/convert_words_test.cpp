// strata convert as users and scripts run it.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

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

class ConvertWords : public testing::Test {
protected:
    // Two small scans of one village in a folder.
    void SetUp() override {
        std::filesystem::create_directory(file("scans"));
        for (const char* seed : {"1", "2"})
            ASSERT_EQ(run_strata({"sample", scan(seed), "--points", "5000", "--seed", seed, "--quiet"}).exit_code, 0);
    }
    std::string file(const std::string& name) const { return folder_.file(name); }
    std::string scan(const std::string& seed) const { return file("scans/" + seed + ".las"); }

    const TemporaryFolder folder_;
};

TEST_F(ConvertWords, JsonHasTheKeysThatOthersRead) {
    const ProgramResult result = run_strata({"convert", scan("1"), file("out"), "--json"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    const json report = json::parse(result.out);
    for (const char* key : {"seconds", "peak_memory_bytes", "temporary_bytes", "nodes", "levels"}) EXPECT_TRUE(report.contains(key)) << key;
    EXPECT_EQ(report["points_read"], 5000);
    EXPECT_EQ(report["points_written"], 5000);
    EXPECT_EQ(report["points_dropped"], 0);
    EXPECT_EQ(report["worst_rounding"], 0.0);
    uint64_t bytes = 0;
    for (const auto& entry : std::filesystem::directory_iterator(file("out"))) bytes += entry.file_size();
    EXPECT_EQ(report["output_bytes"], bytes);
}

TEST_F(ConvertWords, AFolderStandsForTheScansInIt) {
    ASSERT_EQ(run_strata({"convert", file("scans"), file("a"), "--quiet"}).exit_code, 0);
    ASSERT_EQ(run_strata({"convert", scan("1"), scan("2"), file("b"), "--quiet"}).exit_code, 0);
    EXPECT_EQ(json::parse(run_strata({"info", "--json", file("a")}).out)["points"], 10000);
    EXPECT_EQ(bytes_of(file("a/octree.bin")), bytes_of(file("b/octree.bin")));
}

// Against what render counts by itself: classes, and a box open at the top.
TEST_F(ConvertWords, APartIsWhatTheOptionsLeave) {
    const auto points = [&](const std::string& name, std::vector<std::string> words) {
        words.insert(words.begin(), {"convert", scan("1"), file(name), "--json"});
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return json::parse(result.out)["points_written"].get<int>();
    };
    const json exact = json::parse(run_strata({"info", scan("1"), "--exact", "--json"}).out);
    const int ground = exact["points_by_class"]["2"];
    EXPECT_EQ(points("ground", {"--classes", "2"}), ground);
    EXPECT_EQ(points("third", {"--classes", "2", "--every", "3"}), (ground + 2) / 3);
    const double low = exact["bounds"]["min"][0], high = exact["bounds"]["max"][0], middle = 0.5 * (low + high);
    const std::string x = std::to_string(middle);
    const int left = points("left", {"--bounds", ",,," + x + ",,"}), right = points("right", {"--bounds", x + ",,,,,"});
    EXPECT_GT(left, 500);
    EXPECT_GE(left + right, 5000);
    EXPECT_LE(left + right, 5010);  // those on the face are in both
    const json part = json::parse(run_strata({"info", file("left"), "--exact", "--json"}).out);
    EXPECT_LE(part["bounds"]["max"][0].get<double>(), middle + 1e-9);
    EXPECT_EQ(points("none", {"--classes", "77"}), 0);
}

// Of several files a preview takes as much of each.
TEST_F(ConvertWords, APreviewOfAFolderShowsEveryFile) {
    const ProgramResult result = run_strata({"render", file("scans"), "-o", file("look.png"), "--size", "200x200", "--error", "0.001", "--preview", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(json::parse(result.out)["points_drawn"], 10000);
}

// What is in the folder and cannot be read must not be missing in silence.
TEST_F(ConvertWords, ADamagedScanInTheFolderIsNamed) {
    std::string bytes = bytes_of(scan("2"));
    bytes[104] = char(bytes[104] | 0x80);  // what LASzip sets; its record is missing
    std::ofstream(file("scans/3.LAZ"), std::ios::binary) << bytes;
    const ProgramResult result = run_strata({"convert", file("scans"), file("out"), "--quiet"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_TRUE(result.err.starts_with("strata: " + file("scans/3.LAZ") + ": record 'laszip encoded'")) << result.err;
    EXPECT_FALSE(std::filesystem::exists(file("out")));
}

TEST_F(ConvertWords, FailuresAreOneLineAndComeFirst) {
    std::filesystem::create_directory(file("empty"));
    ASSERT_EQ(run_strata({"convert", scan("1"), file("there"), "--quiet"}).exit_code, 0);
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"convert", file("empty"), file("out")}, {"convert", scan("1"), file("there")}, {"convert", scan("1"), file("out"), "--memory", "1M"}}) {
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 1) << result.err;
        EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
    }
}

TEST_F(ConvertWords, WrongOptionsAreUsageErrorsBeforeAnythingIsRead) {
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"--encoding", "zip"}, {"--quality", "12", "--encoding", "brotli"}, {"--quality", "5"}, {"--format", "xyz"}, {"--memory", "0"},
             {"--every", "0"}, {"--classes", "x"}, {"--bounds", "1,2"}}) {
        std::vector<std::string> line = {"convert", file("not there.las"), file("out")};
        line.insert(line.end(), words.begin(), words.end());
        const ProgramResult result = run_strata(line);
        EXPECT_EQ(result.exit_code, 2) << words[0] << ": " << result.err;
        EXPECT_TRUE(result.err.starts_with("strata: --")) << result.err;
    }
}

}  // namespace
}  // namespace strata
