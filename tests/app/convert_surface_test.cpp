// strata convert --normals and --density as users run them: what is stored, listed and drawn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/octree/layered_points.h"
#include "io/format.h"
#include "render/image.h"
#include "tests/support/points_of.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

const std::string kVillage = STRATA_SOURCE_DIR "/sample_data/village.las";

class ConvertSurface : public testing::Test {
protected:
    std::string converted(std::vector<std::string> words, const std::string& name = "set") const {
        words.insert(words.begin(), {"convert", kVillage, folder_.file(name), "--quiet", "--no-sync", "--overwrite"});
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return folder_.file(name);
    }
    static std::vector<double> values_of(const std::string& set, const std::string& name) {
        const std::unique_ptr<LayeredCloud> cloud = open_layered(set);
        const LayeredPoints points(*cloud);
        return test::values_of(points, test::points_of(points), name);
    }

    const TemporaryFolder folder_;
};

TEST_F(ConvertSurface, NormalsAreUnitVectorsThatLookUpOrToTheScanner) {
    const std::string set = converted({"--normals"});
    const std::vector<double> x = values_of(set, "NormalX"), y = values_of(set, "NormalY"), z = values_of(set, "NormalZ");
    ASSERT_FALSE(x.empty());
    size_t steep = 0;
    for (size_t i = 0; i < x.size(); ++i) {
        const double length = std::hypot(x[i], y[i], z[i]);
        EXPECT_TRUE(length == 0.0 || std::abs(length - 1.0) < 1e-6) << length;
        EXPECT_GE(z[i], 0.0);
        steep += z[i] < 0.3;
    }
    EXPECT_GT(steep, x.size() / 50);  // walls and trees
    EXPECT_LT(steep, x.size() / 2);   // most of it is land

    const std::string below = converted({"--normals", "--viewpoint", "548000,5328000,-100000"});
    for (const double down : values_of(below, "NormalZ")) EXPECT_LE(down, 0.02);  // up to 150 m beside 100 km
}

TEST_F(ConvertSurface, ListedByInfo) {
    const ProgramResult info = run_strata({"info", "--json", "--exact", converted({"--normals", "24", "--density"})});
    EXPECT_EQ(info.exit_code, 0) << info.err;
    const json report = json::parse(info.out);
    std::vector<std::string> found;
    for (const json& attribute : report["attributes"]) {
        const std::string name = attribute["name"];
        if (!name.starts_with("Normal") && name != "density") continue;
        found.push_back(name);
        EXPECT_EQ(attribute["type"], "float");
        const double low = attribute["min"].is_array() ? attribute["min"][0] : attribute["min"];
        const double high = attribute["max"].is_array() ? attribute["max"][0] : attribute["max"];
        EXPECT_LT(low, high);
        if (name == "NormalZ") EXPECT_NEAR(high, 1.0, 1e-3);
        if (name == "density") EXPECT_GT(high, 1.0);
    }
    EXPECT_EQ(found, (std::vector<std::string>{"NormalX", "NormalY", "NormalZ", "density"}));
}

TEST_F(ConvertSurface, SameBytesForAnyThreadsAndMemory) {
    const std::string set = converted({"--normals", "--density", "--encoding", "brotli"});
    const std::string one = converted({"--normals", "--density", "--encoding", "brotli", "--threads", "1", "--memory", "300M"}, "one");
    const std::string seven = converted({"--normals", "--density", "--encoding", "brotli", "--threads", "7"}, "seven");
    for (const char* file : {"/octree.bin", "/hierarchy.bin"}) {
        EXPECT_TRUE(test::file_contents(set + file) == test::file_contents(one + file));
        EXPECT_TRUE(test::file_contents(set + file) == test::file_contents(seven + file));
    }
}

TEST_F(ConvertSurface, DensityAloneTakesNoRoomForNormals) {
    const std::string set = converted({"--density"});
    EXPECT_EQ(find_attribute(open_layered(set)->info().attributes, "NormalX"), -1);
    for (const double density : values_of(set, "density")) EXPECT_GT(density, 0.0);
}

TEST_F(ConvertSurface, WrongWordsAreUsageErrors) {
    const auto refused = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"convert", kVillage, folder_.file("out")});
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 2);
        return result.err;
    };
    EXPECT_NE(refused({"--normals", "2"}).find("--normals: expected a whole number from 3 to 256, got '2'"), std::string::npos);
    EXPECT_NE(refused({"--normals=many"}).find("--normals: expected a whole number"), std::string::npos);
    EXPECT_NE(refused({"--density", "--viewpoint", "1,2,3"}).find("--viewpoint needs --normals"), std::string::npos);
    EXPECT_NE(refused({"--normals", "--viewpoint", "1,2"}).find("--viewpoint: expected 3 numbers"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder_.file("out")));
}

TEST_F(ConvertSurface, AFileMayFollowTheFlag) {
    const ProgramResult result = run_strata({"convert", "--quiet", "--normals", kVillage, folder_.file("set")});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_GE(find_attribute(open_layered(folder_.file("set"))->info().attributes, "NormalZ"), 0);
}

// Land looks up: seen from above, blue (z) is high nearly everywhere, red and green (x and y) are about the middle.
TEST_F(ConvertSurface, RenderShowsNormalsAndDensity) {
    const std::string set = converted({"--normals", "--density"});
    const auto render = [&](const std::string& color, const std::string& name) {
        const ProgramResult result = run_strata({"render", set, "-o", folder_.file(name), "--size", "160x120", "--view", "top", "--ortho",
                                                 "--color", color, "--edl", "0", "--transparent", "--quiet"});
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return read_png(folder_.file(name));
    };
    const Image normals = render("normal", "normal.png");
    double sums[3] = {0, 0, 0};
    size_t drawn = 0;
    for (const Rgba8 pixel : normals.pixels) {
        if (pixel >> 24 == 0) continue;
        ++drawn;
        for (int channel = 0; channel < 3; ++channel) sums[channel] += double(pixel >> (8 * channel) & 0xff);
    }
    ASSERT_GT(drawn, 1000u);
    EXPECT_NEAR(sums[0] / double(drawn), 128.0, 25.0);
    EXPECT_NEAR(sums[1] / double(drawn), 128.0, 25.0);
    EXPECT_GT(sums[2] / double(drawn), 200.0);
    EXPECT_NE(render("density", "density.png").pixels, normals.pixels);
}

TEST_F(ConvertSurface, RenderSaysHowToGetWhatIsMissing) {
    const auto refusal = [&](const std::string& color) {
        const ProgramResult result = run_strata({"render", kVillage, "-o", folder_.file("none.png"), "--color", color});
        EXPECT_EQ(result.exit_code, 2);
        return result.err;
    };
    EXPECT_NE(refusal("normal").find("the cloud has no normals; 'strata convert --normals' computes them"), std::string::npos);
    EXPECT_NE(refusal("density").find("the cloud has no densities; 'strata convert --density' computes them"), std::string::npos);
}

}  // namespace
}  // namespace strata
