// strata bench as users run it. What it measures depends on the machine; what it writes and what must hold does not.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::ProgramResult;
using test::run_strata;

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
    const std::string report = test::file_contents(folder.file("out/accuracy.md"));
    EXPECT_NE(report.find("Machine: "), std::string::npos);
    EXPECT_NE(report.find("(accuracy_splats_far.svg)"), std::string::npos);
    EXPECT_NE(test::file_contents(folder.file("out/accuracy_splats_far.svg")).find("</svg>"), std::string::npos);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.file("out")), fs::directory_iterator()), 3) << "the scene is gone";
}

// Where visibility is known, the pass is off by no more than its directions and steps may be (see ssao_kernel_test.cpp); below a sphere in the air
// a depth buffer's floor can only be too dark, for pass and twin alike, but for their own errors.
TEST(Bench, AccuracyOfAmbientOcclusionInClosedForm) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "ssao_forms", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_ssao_forms.csv"));
    ASSERT_EQ(rows.size(), 4u);
    const auto value = [&](const std::string& form, const char* column) { return std::stod(rows.at("ssao_forms/" + form).at(column)); };
    EXPECT_EQ(value("plane", "pass_worst"), 0.0);
    EXPECT_LT(value("plane", "twin_worst"), 1e-6);
    for (const char* form : {"wall", "dome"}) {
        EXPECT_LT(value(form, "pass_worst"), 0.05) << form;
        EXPECT_LT(value(form, "twin_worst"), 0.015) << form;
        EXPECT_LT(value(form, "least"), 0.8) << form << ": occlusion is to be found";
    }
    EXPECT_LT(value("sphere", "pass_bias"), 0.0);
    EXPECT_LT(value("sphere", "twin_bias"), 0.0);
}

// Occluders near by darken, and less than no occlusion would be off: the pass is nearer to the true scene's visibility than white is.
TEST(Bench, AccuracyOfAmbientOcclusionOfTheScene) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "ssao/near/4", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_ssao.csv"));
    ASSERT_EQ(rows.size(), 1u);
    const auto& row = rows.at("ssao/near/4");
    EXPECT_GT(std::stod(row.at("pixels")), 10.0);
    EXPECT_GT(std::stod(row.at("ssao_ms")), 0.0);
    EXPECT_GT(std::stod(row.at("unlit_rms")), 0.05) << "the scene has occlusion to find";
    EXPECT_LT(std::stod(row.at("truth_rms")), std::stod(row.at("unlit_rms")));
    EXPECT_GT(std::stod(row.at("sky_bias")), std::stod(row.at("truth_bias"))) << "what lies beyond the radius occludes too";
    EXPECT_NE(test::file_contents(folder.file("out/accuracy.md")).find("(accuracy_ssao_error.svg)"), std::string::npos);
}

// Linear interpolation errs by the square of the cell; on distances to a sphere there is a bound.
TEST(Bench, AccuracyOfIsosurfaces) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "contour/", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_contour.csv"));
    ASSERT_EQ(rows.size(), 15u);
    const auto value = [&](const std::string& name, const char* column) { return std::stod(rows.at("contour/" + name).at(column)); };
    for (const char* name : {"sphere/65", "sphere/129", "sphere/257", "torus/65", "torus/129", "torus/257"}) EXPECT_NEAR(value(name, "order"), 2.0, 0.1) << name;
    for (const char* name : {"gyroid/129", "gyroid/257"}) EXPECT_NEAR(value(name, "order"), 2.0, 0.2) << name;  // its field bends more
    for (const char* samples : {"17", "33", "65", "129", "257"}) {
        const std::string name = std::string("sphere/") + samples;
        EXPECT_LE(value(name, "largest"), value(name, "bound") + 1e-7) << name;  // and floats
    }
    EXPECT_NE(test::file_contents(folder.file("out/accuracy.md")).find("(accuracy_contour_error.svg)"), std::string::npos);
}

// More cones, and more rays, come nearer to the truth; one cone does better than its mean.
TEST(Bench, AccuracyOfCones) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "cones/sphere/0.2/", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_cones.csv"));
    ASSERT_EQ(rows.size(), 11u);
    const auto rms = [&](const char* method) { return std::stod(rows.at(std::string("cones/sphere/0.2/") + method).at("rms")); };
    for (const char* sampling : {"nearest", "linear"}) {
        const std::string name = sampling;
        EXPECT_LT(rms((name + "1").c_str()), rms("mean0"));
        EXPECT_LT(rms((name + "16").c_str()), 0.7 * rms((name + "1").c_str()));
    }
    EXPECT_LT(rms("rays16"), 0.5 * rms("rays1"));
    EXPECT_LT(rms("rays64"), 0.05);
}

// On flat surfaces angles are what 2 sigma / (r sqrt k) says, to a few tens of percent: neighbors do not fill a disc evenly, and k, not k - 3,
// is counted. Rounding alone is far below noise of 2 cm.
TEST(Bench, AccuracyOfNormals) {
    const TemporaryFolder folder;
    const ProgramResult result = run_strata(small({"accuracy", "--only", "normals/0.02", "-o", folder.file("out")}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto rows = rows_of(folder.file("out/accuracy_normals.csv"));
    ASSERT_EQ(rows.size(), 3u) << "three k";
    double before = 90.0;
    for (const char* k : {"8", "16", "64"}) {
        const auto& row = rows.at(std::string("normals/0.02/") + k);
        const double angle = std::stod(row.at("flat_median_deg")), ratio = angle / std::stod(row.at("expected_deg"));
        EXPECT_GT(std::stod(row.at("flat_points")), 500.0);
        EXPECT_GT(ratio, 0.8) << k;
        EXPECT_LT(ratio, 1.6) << k;
        EXPECT_LT(angle, 0.6 * before) << "neighbors average noise, and lie farther away";
        before = angle;
    }
    EXPECT_NE(test::file_contents(folder.file("out/accuracy_normals_noise.svg")).find("stroke-dasharray"), std::string::npos);
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
    EXPECT_EQ(test::file_contents(folder.file("speed_steps.csv")), "precious");
    EXPECT_EQ(run_strata(small({"speed", "--only", "select", "-o", folder.path(), "--overwrite"})).exit_code, 0);
    EXPECT_NE(test::file_contents(folder.file("speed_steps.csv")), "precious");
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
