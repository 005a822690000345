// strata bench as users run it. What it measures depends on the machine; what it writes and what must hold does not.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::ProgramResult;
using test::run_strata;

std::string text_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

// Rows of a CSV file without quoted cells, by their first column, then by the heading.
std::map<std::string, std::map<std::string, std::string>> rows_of(const std::string& path) {
    std::ifstream file(path);
    const auto cells = [](const std::string& line) {
        std::vector<std::string> parts;
        std::istringstream in(line + ",");
        for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
        return parts;
    };
    std::string line;
    std::getline(file, line);
    const std::vector<std::string> headings = cells(line);
    std::map<std::string, std::map<std::string, std::string>> rows;
    while (std::getline(file, line)) {
        const std::vector<std::string> row = cells(line);
        EXPECT_EQ(row.size(), headings.size()) << line;
        for (size_t i = 0; i < std::min(row.size(), headings.size()); ++i) rows[row[0]][headings[i]] = row[i];
    }
    return rows;
}

std::vector<std::string> small(std::vector<std::string> words) {
    words.insert(words.begin(), "bench");
    words.insert(words.end(), {"--points", "60000", "--size", "160x90", "--runs", "1", "--threads", "2"});
    return words;
}

TEST(Bench, AccuracyOfOneKindOfSplat) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "splats/far/disc", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_splats.csv"));
    ASSERT_EQ(rows.size(), 6u) << "five targets and the reference";
    EXPECT_EQ(rows.at("splats/far/reference").at("psnr_db"), "inf");
    EXPECT_EQ(rows.at("splats/far/reference").at("ssim"), "1");
    EXPECT_EQ(rows.at("splats/far/reference").at("points_drawn"), "60000");
    const double reference_depth = std::stod(rows.at("splats/far/reference").at("depth_median_m"));
    double points = 0.0;
    for (const char* target : {"8", "4", "2", "1", "0.5"}) {
        const auto& row = rows.at(std::string("splats/far/disc/") + target);
        EXPECT_EQ(row.at("target_px"), target);
        EXPECT_GT(std::stod(row.at("frame_ms")), 0.0);
        EXPECT_GE(std::stod(row.at("points_drawn")), points) << "a finer target draws more";
        points = std::stod(row.at("points_drawn"));
        // Discs in the planes of surfaces are nearer to them than discs that face the eye, at any target.
        EXPECT_LT(reference_depth, 0.7 * std::stod(row.at("depth_median_m")));
        for (const char* share : {"holes_percent", "bleed_percent"}) {
            EXPECT_GE(std::stod(row.at(share)), 0.0);
            EXPECT_LE(std::stod(row.at(share)), 100.0);
        }
    }
    const std::string report = text_of(folder.file("out/accuracy.md"));
    EXPECT_NE(report.find("Machine: "), std::string::npos);
    EXPECT_NE(report.find("(accuracy_splats_far.svg)"), std::string::npos);
    EXPECT_NE(text_of(folder.file("out/accuracy_splats_far.svg")).find("</svg>"), std::string::npos);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.file("out")), fs::directory_iterator()), 3) << "the scene is gone";
}

TEST(Bench, SpeedOfAStep) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"speed", "--only", "las", "-o", folder.file("out"), "--quiet"}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    const auto rows = rows_of(folder.file("out/speed_steps.csv"));
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows.at("las").at("items"), "60000");
    EXPECT_GT(std::stod(rows.at("las").at("mega_per_s")), 0.0);
}

TEST(Bench, KeepsAnEarlierReport) {
    const TemporaryFolder folder;
    std::ofstream(folder.file("speed_steps.csv")) << "precious";
    const ProgramResult result = run_strata(small({"speed", "--only", "select", "-o", folder.path()}));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.err.find("--overwrite"), std::string::npos) << result.err;
    EXPECT_EQ(text_of(folder.file("speed_steps.csv")), "precious");
    EXPECT_EQ(run_strata(small({"speed", "--only", "select", "-o", folder.path(), "--overwrite"})).exit_code, 0);
    EXPECT_NE(text_of(folder.file("speed_steps.csv")), "precious");
}

TEST(Bench, WrongWordsAreUsageErrors) {
    const TemporaryFolder folder;
    for (const std::vector<std::string>& words : {std::vector<std::string>{"beauty", "-o", folder.path()}, {"speed"}, {"speed", "-o", folder.path(), "--only", "nonsense"}})
        EXPECT_EQ(run_strata(small(words)).exit_code, 2) << words[0];
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 0);
    EXPECT_EQ(run_strata({"bench", "accuracy", "-o", folder.path(), "--runs", "0"}).exit_code, 2);
}

}  // namespace
}  // namespace strata
