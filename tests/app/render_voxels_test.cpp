// strata render of voxel files as users run it, alone and beside points: the real program, pictures against baselines.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "render/image.h"
#include "tests/support/baseline.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::expect_baseline;
using test::ProgramResult;
using test::run_strata;

// Voxels of a meter of the village of the repository's sample data.
class RenderVoxels : public testing::Test {
protected:
    static void SetUpTestSuite() {
        folder_ = new TemporaryFolder;
        ASSERT_EQ(run_strata({"voxelize", village(), "-o", file("village.svo"), "--voxel-size", "1", "--attributes", "color,count", "--quiet"}).exit_code, 0);
    }
    static void TearDownTestSuite() {
        delete folder_;
        folder_ = nullptr;
    }
    static std::string file(const std::string& name) { return folder_->file(name); }
    static std::string village() { return STRATA_SOURCE_DIR "/sample_data/village.las"; }

    static ProgramResult render(std::vector<std::string> words) {
        words.insert(words.begin(), {"render", "--overwrite"});
        if (std::find(words.begin(), words.end(), "--size") == words.end()) words.insert(words.end(), {"--size", "320x200"});
        return run_strata(words);
    }

    static inline TemporaryFolder* folder_ = nullptr;
};

const std::vector<std::string> kNear = {"--eye", "548050,5327950,492", "--target", "548015,5327995,476"};

std::vector<std::string> near_with(std::vector<std::string> words) {
    words.insert(words.end(), kNear.begin(), kNear.end());
    return words;
}

TEST_F(RenderVoxels, PicturesAgreeWithTheBaselines) {
    expect_baseline("voxels_flat", near_with({file("village.svo")}));
    expect_baseline("voxels_smooth", near_with({file("village.svo"), "--voxels", "smooth", "--samples", "4"}));
    expect_baseline("voxels_and_points", near_with({file("village.svo"), village(), "--color", "elevation", "--splat", "disc"}));
    expect_baseline("voxels_cut", {file("village.svo"), "--clip", "547990,5327960,,548040,5328010,", "--clip-out", "548000,5327970,,548020,5328000,", "--color", "count"});
}

TEST_F(RenderVoxels, AStatueAgreesWithItsBaseline) {
    const char* const data = std::getenv("STRATA_DATA");
    const fs::path mesh = fs::path(data ? data : "") / "obj/nefertiti.obj";
    if (!data || !fs::exists(mesh)) GTEST_SKIP() << "STRATA_DATA names no folder with meshes";
    ASSERT_EQ(run_strata({"voxelize", mesh.string(), "-o", file("statue.svo"), "--resolution", "256", "--quiet"}).exit_code, 0);
    expect_baseline("voxels_statue", {file("statue.svo"), "--size", "200x320"});
}

TEST_F(RenderVoxels, SamePixelsForAnyThreadsAndStrips) {
    for (const std::string shading : {"flat", "smooth"}) {
        const std::vector<std::string> all = {file("village.svo"), village(), "--voxels", shading, "--ssao", "--fill", "--samples", "2", "--clip", "547960,5327940,,548040,5328020,"};
        const auto drawn = [&](const std::string& name, std::vector<std::string> words) {
            words.insert(words.end(), all.begin(), all.end());
            words.insert(words.end(), {"-o", file(name), "--depth", file(name) + ".pfm"});
            EXPECT_EQ(render(words).exit_code, 0);
            return test::file_contents(file(name)) + test::file_contents(file(name) + ".pfm");
        };
        EXPECT_EQ(drawn("one.png", {"--threads", "1"}), drawn("many.png", {"--threads", "5", "--tile", "37"})) << shading;
    }
}

nlohmann::json stats_of(const ProgramResult& result) {
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out);
}

// Cells get as small as the error asks, down to voxels; where memory holds fewer levels, that is said.
// The shader, on whatever runs it here, against the picture of the CPU's rays: voxels beside points, cut, in a window of several strips.
TEST_F(RenderVoxels, TheGpuDrawsTheSamePicture) {
    for (const char* shading : {"flat", "smooth"}) {
        const std::vector<std::string> words = {file("village.svo"), village(), "--voxels", shading, "--clip", "-500,0,-1,1e6,1e7,1e3", "--stats"};
        std::vector<std::string> cpu = words, gpu = words;
        cpu.insert(cpu.end(), {"--rasterizer", "cpu", "-o", file("by_cpu.png")});
        gpu.insert(gpu.end(), {"--rasterizer", "gpu", "-o", file("by_gpu.png"), "--reference", file("by_cpu.png"), "--threshold", "2"});
        ASSERT_EQ(render(cpu).exit_code, 0);
        const ProgramResult result = render(gpu);
        if (result.exit_code != 0 && result.err.find("no OpenGL 4.5") != std::string::npos) GTEST_SKIP() << result.err;
        EXPECT_EQ(result.exit_code, 0) << shading << ": " << result.err;
        EXPECT_EQ(nlohmann::json::parse(result.out)["rasterizer"], "gpu");
    }
}

TEST_F(RenderVoxels, StatsSayHowFineThePictureIs) {
    const std::string out = file("stats.png");
    const nlohmann::json fine = stats_of(render({file("village.svo"), "-o", out, "--stats", "--error", "0.1"}));
    EXPECT_EQ(fine["voxel_depth"], 8);
    EXPECT_EQ(fine["points_drawn"], 0);
    EXPECT_EQ(fine["error_px"], 0.0);
    EXPECT_EQ(fine["color"], "rgb");
    EXPECT_TRUE(fine["pass_ms"].contains("voxels"));
    const nlohmann::json coarse = stats_of(render({file("village.svo"), "-o", out, "--stats", "--error", "8"}));
    EXPECT_LT(coarse["voxel_depth"], 8);
    EXPECT_GT(coarse["error_px"], 4.0);
    EXPECT_LE(coarse["error_px"], 8.0);
    EXPECT_EQ(coarse["bound_by"], "error");
    const nlohmann::json small = stats_of(render({file("village.svo"), "-o", out, "--stats", "--memory", "64K"}));
    EXPECT_LT(small["voxel_depth"], 8);
    EXPECT_GT(small["error_px"], 1.0);
    EXPECT_EQ(small["bound_by"], "memory");
    // The camera it prints gives the same picture again.
    std::ofstream(file("camera.json")) << fine["camera"];
    EXPECT_EQ(render({file("village.svo"), "-o", file("again.png"), "--error", "0.1", "--camera", file("camera.json")}).exit_code, 0);
    EXPECT_EQ(render({file("village.svo"), "-o", out, "--error", "0.1", "--reference", file("again.png"), "--threshold", "2"}).exit_code, 0);
}

// A map of voxels lies where they do: heights by depth, and a world file.
TEST_F(RenderVoxels, AMapHasAPlaceAndHeights) {
    const ProgramResult result = render({file("village.svo"), "-o", file("map.png"), "--depth", file("map.pfm"), "--view", "top", "--ortho", "--stats"});
    const nlohmann::json stats = stats_of(result);
    EXPECT_TRUE(fs::exists(file("map.pgw")));
    const double eye = stats["camera"]["eye"][2];
    const std::string pfm = test::file_contents(file("map.pfm"));
    std::vector<float> depths(320 * 200);
    ASSERT_GT(pfm.size(), depths.size() * 4);
    std::memcpy(depths.data(), pfm.data() + pfm.size() - depths.size() * 4, depths.size() * 4);
    double lowest = 1e9, highest = -1e9;
    size_t faces = 0;
    for (const float depth : depths) {
        if (!std::isfinite(depth)) continue;
        const double height = eye - depth;
        lowest = std::min(lowest, height);
        highest = std::max(highest, height);
        faces += std::abs(height - std::round(height)) < 1e-3;  // upper faces lie on multiples of the voxel's size
    }
    EXPECT_GT(lowest, 465.0);
    EXPECT_LT(highest, 512.0);
    EXPECT_EQ(faces, size_t(std::count_if(depths.begin(), depths.end(), [](float depth) { return std::isfinite(depth); })));
}

// Grids of OpenVDB are voxels, too.
TEST_F(RenderVoxels, GridsAreDrawn) {
    const char* const data = std::getenv("STRATA_DATA");
    const fs::path grid = fs::path(data ? data : "") / "volume/headsq_quarter.vdb";
    if (!data || !fs::exists(grid)) GTEST_SKIP() << "STRATA_DATA names no folder with grids";
    const nlohmann::json stats = nlohmann::json::parse(render({grid.string(), "-o", file("grid.png"), "--depth", file("grid.pfm"), "--view", "top", "--ortho", "--stats"}).out);
    EXPECT_GE(stats["voxel_depth"], 6);
    EXPECT_EQ(stats["error_px"], 0.0);
    // A fog volume whose points fill a box all but for its borders.
    const Image picture = read_png(file("grid.png"));
    const Rgba8 background = picture.at(0, 0);
    EXPECT_GT(std::count_if(picture.pixels.begin(), picture.pixels.end(), [&](Rgba8 pixel) { return pixel != background; }), 15000);
}

TEST_F(RenderVoxels, WrongWordsAreRefused) {
    const std::string out = file("none.png");
    const struct {
        std::vector<std::string> words;
        std::string says;
    } cases[] = {
        {{"--voxels", "round"}, "--voxels: expected flat or smooth, got 'round'"},
        {{"--filter", "class=2"}, "there are none"},
        {{"--color", "intensity"}, "voxels have no 'intensity'"},
        {{"--color", "normal", "--colormap", "none"}, "none"},
        {{"--color", "count", "--range", "-1,5"}, "positive"},
    };
    for (const auto& [extra, says] : cases) {
        std::vector<std::string> words = {file("village.svo"), "-o", out};
        words.insert(words.end(), extra.begin(), extra.end());
        const ProgramResult result = render(words);
        EXPECT_EQ(result.exit_code, 2) << says;
        EXPECT_NE(result.err.find(says), std::string::npos) << result.err;
        EXPECT_FALSE(fs::exists(out));
    }
    // What one of several has is shown of that one.
    EXPECT_EQ(render({file("village.svo"), village(), "-o", out, "--color", "intensity"}).exit_code, 0);
    EXPECT_EQ(render({file("village.svo"), village(), "-o", out, "--filter", "class=2"}).exit_code, 0);
}

}  // namespace
}  // namespace strata
