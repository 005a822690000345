// strata render as users run it: the real program, real files, pictures against baselines.
#include <gtest/gtest.h>

#include <cmath>
#include <algorithm>
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

using test::ProgramResult;
using test::run_strata;

// The village of the repository's sample data.
class Render : public testing::Test {
protected:
    static void SetUpTestSuite() { folder_ = new TemporaryFolder; }
    static void TearDownTestSuite() {
        delete folder_;
        folder_ = nullptr;
    }
    static std::string file(const std::string& name) { return folder_->file(name); }
    static std::string village() { return STRATA_SOURCE_DIR "/sample_data/village.las"; }

    // Renders without lighting unless the words say otherwise.
    static ProgramResult render(std::vector<std::string> words) {
        words.insert(words.begin(), {"render", village(), "--size", "320x200", "--overwrite"});
        if (std::find(words.begin(), words.end(), "--edl") == words.end()) words.insert(words.end(), {"--edl", "0"});
        return run_strata(words);
    }

    static inline TemporaryFolder* folder_ = nullptr;
};

// Positions, selection and splats are the same on every machine of IEEE floats, and so is lighting without a GPU; with one it goes
// through the driver's exp and pow, which differ by a step of 8 bits. A tile may therefore be off by 2 steps: a missing point
// is off by far more.
TEST_F(Render, PicturesAgreeWithTheBaselines) {
    const struct {
        std::string name;
        std::vector<std::string> words;
    } pictures[] = {
        {"village_iso", {}},
        {"village_top_classes", {"--view", "top", "--ortho", "--color", "classification", "--background", "#ffffff"}},
        {"village_front_height", {"--view", "front", "--color", "elevation", "--splat", "disc", "--transparent"}},
    };
    for (const auto& [name, extra] : pictures) {
        std::vector<std::string> words = {village(), "--edl", "0.7"};
        words.insert(words.end(), extra.begin(), extra.end());
        test::expect_baseline(name, words);
    }
}

TEST_F(Render, PlainFilesThatDoNotFitAreRefusedByName) {
    const ProgramResult result = render({"-o", file("none.png"), "--memory", "3M"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.err.find("village.las: "), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("do not fit under --memory 3.0 MiB; `strata convert`"), std::string::npos) << result.err;
    EXPECT_FALSE(std::filesystem::exists(file("none.png")));
}

TEST_F(Render, SamePixelsForAnyThreadsAndStrips) {
    for (const std::string kind : {"square", "disc", "paraboloid", "gaussian"}) {
        ASSERT_EQ(render({"-o", file("one.png"), "--threads", "1", "--splat", kind}).exit_code, 0);
        ASSERT_EQ(render({"-o", file("many.png"), "--threads", "7", "--tile", "13", "--splat", kind}).exit_code, 0);
        EXPECT_EQ(test::file_contents(file("one.png")), test::file_contents(file("many.png"))) << kind;
    }
}

// A view from near, where splats are many pixels wide; discs and paraboloids have baselines above. Surfels need normals, the others do not look at them.
TEST_F(Render, EachSplatKindAgreesWithItsBaseline) {
    ASSERT_EQ(run_strata({"convert", village(), file("village"), "--normals", "--quiet"}).exit_code, 0);
    for (const std::string kind : {"square", "gaussian", "surfel"}) {
        const std::string name = "splat_" + kind + ".png";
        std::vector<std::string> words = {"render", file("village"), "-o", file(name), "--size", "320x240", "--eye", "548050,5327950,492", "--target",
                                          "548015,5327995,476", "--splat", kind, "--edl", "0", "--overwrite", "--reference",
                                          STRATA_SOURCE_DIR "/tests/baselines/" + name, "--threshold", "2"};
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;

        // With everything that can be combined, strips do not show either.
        const std::vector<std::string> all = {"render", file("village"), "--size", "240x160", "--view", "front", "--ortho", "--splat", kind, "--edl",
                                              "0.7", "--fill", "--ssao", "--samples", "2", "--clip", "547960,5327940,,548020,5328000,", "--overwrite", "-o"};
        const auto drawn = [&](const std::string& path, std::vector<std::string> more) {
            more.insert(more.begin(), all.begin(), all.end());
            more.insert(more.begin() + ptrdiff_t(all.size()), path);
            EXPECT_EQ(run_strata(more).exit_code, 0);
            return test::file_contents(path);
        };
        EXPECT_EQ(drawn(file("whole.png"), {"--threads", "1"}), drawn(file("strips.png"), {"--threads", "5", "--tile", "37"})) << kind;
    }
    // Without normals: one line that names what makes them.
    const ProgramResult refused = render({"-o", file("refused.png"), "--splat", "surfel"});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_NE(refused.err.find("strata convert --normals"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(file("refused.png")));
}

// Clamps act on adaptive sizes: equal ones give a fixed size.
TEST_F(Render, PointSizesAreClamped) {
    ASSERT_EQ(render({"-o", file("fixed.png"), "--splat", "square", "--point-size", "3"}).exit_code, 0);
    ASSERT_EQ(render({"-o", file("clamped.png"), "--splat", "square", "--min-point-size", "3", "--max-point-size", "3"}).exit_code, 0);
    EXPECT_EQ(test::file_contents(file("fixed.png")), test::file_contents(file("clamped.png")));
}

// Fewer pixels show the background, in parts of the picture as in the whole; given without a number, it goes by the points.
TEST_F(Render, FillClosesHoles) {
    const auto empty = [&](const std::string& name, std::vector<std::string> words) {
        words.insert(words.begin(), {"-o", file(name), "--transparent", "--splat", "disc", "--point-size", "2"});
        EXPECT_EQ(render(words).exit_code, 0);
        const Image picture = read_png(file(name));
        return std::count_if(picture.pixels.begin(), picture.pixels.end(), [](Rgba8 pixel) { return alpha_of(pixel) == 0; });
    };
    const auto open = empty("open.png", {}), by_points = empty("by_points.png", {"--fill"}), wide = empty("wide.png", {"--fill", "6"});
    EXPECT_LT(by_points, open);
    EXPECT_LT(wide, by_points);
    EXPECT_EQ(empty("equals.png", {"--fill=6", "--tile", "17", "--threads", "3"}), wide);
    EXPECT_EQ(test::file_contents(file("equals.png")), test::file_contents(file("wide.png")));
}

// Darker somewhere and lighter nowhere; the radius may be left to the cloud; strips and threads do not show.
TEST_F(Render, AmbientOcclusionDarkens) {
    const auto picture = [&](const std::string& name, std::vector<std::string> words) {
        words.insert(words.begin(), {"-o", file(name)});
        EXPECT_EQ(render(words).exit_code, 0);
        return read_png(file(name));
    };
    const Image plain = picture("plain.png", {}), lit = picture("lit.png", {"--ssao"}), small = picture("narrow.png", {"--ssao", "0.2"});
    size_t darker = 0, differ = 0;
    for (size_t i = 0; i < plain.pixels.size(); ++i) {
        EXPECT_LE(green_of(lit.pixels[i]), green_of(plain.pixels[i]));
        darker += green_of(lit.pixels[i]) < green_of(plain.pixels[i]);
        differ += lit.pixels[i] != small.pixels[i];
    }
    EXPECT_GT(darker, plain.pixels.size() / 40);
    EXPECT_GT(differ, plain.pixels.size() / 40);
    picture("strips.png", {"--ssao", "--tile", "31", "--threads", "3"});
    EXPECT_EQ(test::file_contents(file("strips.png")), test::file_contents(file("lit.png")));
}

TEST_F(Render, StatsAreOneObjectWithTheKeysThatOthersRead) {
    const ProgramResult result = render({"-o", file("stats.png"), "--stats", "--rasterizer", "cpu"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json stats = nlohmann::json::parse(result.out);
    for (const char* key : {"points_drawn", "nodes_drawn", "error_px", "bound_by", "rasterizer", "gl_renderer", "frame_ms", "pass_ms"})
        EXPECT_TRUE(stats.contains(key)) << key;
    EXPECT_EQ(stats["rasterizer"], "cpu");
    EXPECT_EQ(stats["gl_renderer"], "");  // without lighting no GL is started
    EXPECT_EQ(stats["edl_by"], "");
    EXPECT_EQ(result.err, "");

    // The camera it prints gives the same picture again.
    std::ofstream(file("camera.json")) << stats["camera"];
    ASSERT_EQ(render({"-o", file("again.png"), "--camera", file("camera.json"), "--reference", file("stats.png"), "--threshold", "2"}).exit_code, 0);
}

// What lights says so, and its radius is a share of the height: the same picture twice as large has the same shades.
TEST_F(Render, LightingSaysWhoDidItAndFollowsTheSize) {
    std::vector<Image> pictures;
    for (const char* size : {"320x200", "640x400"}) {
        const std::string path = file(std::string("lit") + size + ".png");
        const ProgramResult result = run_strata({"render", village(), "-o", path, "--size", size, "--edl", "2,10", "--point-size",
                                                 size[0] == '3' ? "6" : "12", "--splat", "square", "--error", "0.5", "--stats"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
        const nlohmann::json stats = nlohmann::json::parse(result.out);
        EXPECT_TRUE(stats["edl_by"] == "cpu" || stats["edl_by"] == "gl") << stats["edl_by"];
        EXPECT_EQ(stats["gl_renderer"].get<std::string>().empty(), stats["edl_by"] == "cpu");
        pictures.push_back(read_png(path));
    }
    double sums[2] = {};
    for (int i = 0; i < 2; ++i)
        for (const Rgba8 pixel : pictures[size_t(i)].pixels) sums[i] += double(green_of(pixel)) / double(pictures[size_t(i)].pixels.size());
    EXPECT_NEAR(sums[0], sums[1], 0.3);  // of 255; with a radius in pixels they differ by 1.1
}

// The compute shader draws the picture of the CPU, on whatever OpenGL there is: equal with software GL, whose division is exact;
// a GPU's may move the rims of a few splats. Cuts, strips and samples are part of it.
TEST_F(Render, RasterizersAgree) {
    const auto render_by = [&](const std::string& rasterizer, std::vector<std::string> words) {
        words.insert(words.end(), {"-o", file(rasterizer + ".png"), "--depth", file(rasterizer + ".pfm"), "--stats", "--rasterizer", rasterizer});
        return render(words);
    };
    const std::vector<std::string> pictures[] = {
        {},
        {"--point-size", "1", "--view", "front"},
        {"--splat", "disc", "--view", "top", "--ortho", "--filter", "class=2,6", "--fill"},
        {"--splat", "square", "--point-size", "5", "--samples", "3", "--tile", "37", "--edl", "0.7"},
        {"--ortho", "--clip", ",,470,548040,,478", "--ssao"},
        {"--splat", "gaussian"},
    };
    for (const std::vector<std::string>& words : pictures) {
        const ProgramResult gpu = render_by("gpu", words);
        if (gpu.exit_code == 1 && gpu.err.find("no OpenGL") != std::string::npos) GTEST_SKIP() << gpu.err;
        ASSERT_EQ(gpu.exit_code, 0) << gpu.err;
        const ProgramResult cpu = render_by("cpu", words);
        ASSERT_EQ(cpu.exit_code, 0) << cpu.err;
        const nlohmann::json gpu_stats = nlohmann::json::parse(gpu.out), cpu_stats = nlohmann::json::parse(cpu.out);
        EXPECT_EQ(gpu_stats["rasterizer"], "gpu");
        EXPECT_EQ(cpu_stats["rasterizer"], "cpu");
        EXPECT_EQ(gpu_stats["points_drawn"], cpu_stats["points_drawn"]);
        EXPECT_GT(gpu_stats["uploaded_bytes"], 0);
        EXPECT_EQ(cpu_stats["uploaded_bytes"], 0);
        if (gpu_stats["gl_renderer"].get<std::string>().find("llvmpipe") != std::string::npos) {
            EXPECT_EQ(test::file_contents(file("gpu.png")), test::file_contents(file("cpu.png")));
            EXPECT_EQ(test::file_contents(file("gpu.pfm")), test::file_contents(file("cpu.pfm")));
        } else {
            const Image a = read_png(file("gpu.png")), b = read_png(file("cpu.png"));
            size_t differ = 0;
            for (size_t i = 0; i < a.pixels.size(); ++i) differ += std::abs(green_of(a.pixels[i]) - green_of(b.pixels[i])) > 8;
            EXPECT_LT(differ, a.pixels.size() / 100);
        }
    }
}

TEST_F(Render, AnUnknownRasterizerIsRefused) {
    const ProgramResult result = render({"-o", file("none.png"), "--rasterizer", "vulkan"});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.err.find("--rasterizer: expected auto, cpu or gpu"), std::string::npos) << result.err;
}

// Without any OpenGL the CPU draws, and asking for the other is an error of one line. EGL is told that it has no driver.
TEST_F(Render, WithoutOpenGlTheCpuDraws) {
    const auto render_without = [&](const std::string& rasterizer) {
        return test::run_program({"/usr/bin/env", "__EGL_VENDOR_LIBRARY_FILENAMES=" + file("no_such_vendor.json"), STRATA_PROGRAM, "render", village(),
                                  "--size", "320x200", "-o", file("no_gl.png"), "--overwrite", "--stats", "--rasterizer", rasterizer});
    };
    const ProgramResult cpu = render_without("auto");
    ASSERT_EQ(cpu.exit_code, 0) << cpu.err;
    EXPECT_EQ(nlohmann::json::parse(cpu.out)["rasterizer"], "cpu");
    const ProgramResult gpu = render_without("gpu");
    if (gpu.exit_code == 0) GTEST_SKIP() << "EGL finds its driver in another way here";
    EXPECT_EQ(gpu.exit_code, 1);
    EXPECT_NE(gpu.err.find("the rasterizer gpu: no OpenGL 4.5 without a window"), std::string::npos) << gpu.err;
    EXPECT_EQ(std::count(gpu.err.begin(), gpu.err.end(), '\n'), 1);
}

TEST_F(Render, BudgetBindsAndSaysSo) {
    const ProgramResult result = render({"-o", file("budget.png"), "--budget", "20000", "--error", "0.1", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json stats = nlohmann::json::parse(result.out);
    EXPECT_LE(stats["points_drawn"], 20000);
    EXPECT_EQ(stats["bound_by"], "budget");
    EXPECT_GT(stats["error_px"], 0.1);
}

// A map at half a metre a pixel: the world file names the pixel's size and lies on the cloud.
TEST_F(Render, MapsComeWithAWorldFile) {
    const ProgramResult result = run_strata({"render", village(), "-o", file("map.png"), "--ortho", "--view", "top", "--edl", "0",
                                             "--meters-per-pixel", "0.5", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json info = nlohmann::json::parse(run_strata({"info", village(), "--json"}).out);
    std::ifstream world(file("map.pgw"));
    double a = 0, d = 0, b = 0, e = 0, x = 0, y = 0;
    ASSERT_TRUE(world >> a >> d >> b >> e >> x >> y);
    EXPECT_DOUBLE_EQ(a, 0.5);
    EXPECT_DOUBLE_EQ(e, -0.5);
    EXPECT_DOUBLE_EQ(d, 0);
    EXPECT_DOUBLE_EQ(b, 0);
    const Image map = read_png(file("map.png"));
    const double least_x = info["bounds"]["min"][0], most_x = info["bounds"]["max"][0], most_y = info["bounds"]["max"][1];
    EXPECT_NEAR(x, least_x, 1.0);  // two pixels: the size is rounded up
    EXPECT_NEAR(y, most_y, 1.0);
    EXPECT_NEAR(x + a * map.width, most_x, 1.0);
}

TEST_F(Render, TransparentAndBackgroundPixels) {
    ASSERT_EQ(render({"-o", file("clear.png"), "--transparent", "--point-size", "1"}).exit_code, 0);
    EXPECT_EQ(alpha_of(read_png(file("clear.png")).at(0, 0)), 0);
    ASSERT_EQ(render({"-o", file("blue.png"), "--background", "#203040"}).exit_code, 0);
    EXPECT_EQ(read_png(file("blue.png")).at(0, 0), make_rgba(0x20, 0x30, 0x40));
}

TEST_F(Render, ADifferentPictureFailsAndLeavesTheDifference) {
    ASSERT_EQ(render({"-o", file("front.png"), "--view", "front"}).exit_code, 0);
    const ProgramResult result = render({"-o", file("back.png"), "--view", "back", "--reference", file("front.png"), "--stats"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.err.find("back.png"), std::string::npos);
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
    const nlohmann::json difference = nlohmann::json::parse(result.out)["difference"];
    for (const char* key : {"worst_tile", "max_channel", "rms", "psnr_db", "ssim"}) EXPECT_TRUE(difference[key].is_number()) << key;
    EXPECT_EQ(difference["threshold"], 4);
    EXPECT_GT(difference["worst_tile"], 4);

    // The two pictures and where they differ, side by side or alone: as high as they are, and not black all over.
    const Image shown = read_png(file("back.difference.png"));
    EXPECT_EQ(shown.height, 200u);
    EXPECT_EQ(shown.width % 320u, 0u);
    EXPECT_TRUE(std::any_of(shown.pixels.begin(), shown.pixels.end(), [&](Rgba8 pixel) { return pixel != shown.pixels[0]; }));
}

TEST_F(Render, TheSamePicturePassesAtThresholdZero) {
    ASSERT_EQ(render({"-o", file("first.png")}).exit_code, 0);
    const ProgramResult result = render({"-o", file("second.png"), "--reference", file("first.png"), "--threshold", "0", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json difference = nlohmann::json::parse(result.out)["difference"];
    EXPECT_EQ(difference["worst_tile"], 0.0);
    EXPECT_EQ(difference["rms"], 0.0);
    EXPECT_FALSE(std::filesystem::exists(file("second.difference.png")));
}

// A test against a missing reference, or one of another size, fails before the picture of the last run is replaced.
TEST_F(Render, AReferenceThatCannotBeComparedIsAFailure) {
    ASSERT_EQ(render({"-o", file("small.png"), "--size", "100x100"}).exit_code, 2);  // given twice: render() gives one too
    ASSERT_EQ(run_strata({"render", village(), "-o", file("small.png"), "--size", "32x16", "--edl", "0"}).exit_code, 0);
    std::ofstream(file("last.png")) << "the last run";
    for (const std::string& reference : {file("small.png"), file("no reference.png"), village()}) {
        const ProgramResult result = render({"-o", file("last.png"), "--reference", reference});
        EXPECT_EQ(result.exit_code, 1) << result.err;
        EXPECT_NE(result.err.find(reference), std::string::npos) << result.err;
        EXPECT_EQ(test::file_contents(file("last.png")), "the last run");
    }
}

// Pixels of a picture straight down have a place; the world file of an earlier picture of that name would give them another.
TEST_F(Render, AWorldFileNeverOutlivesItsPicture) {
    const std::vector<std::string> map = {"-o", file("plan.png"), "--view", "top", "--ortho"};
    ASSERT_EQ(render(map).exit_code, 0);
    ASSERT_TRUE(std::filesystem::exists(file("plan.pgw")));
    EXPECT_EQ(test::file_contents(file("plan.pgw")).find("-0\n"), std::string::npos);
    ASSERT_EQ(render({"-o", file("plan.png")}).exit_code, 0);
    EXPECT_FALSE(std::filesystem::exists(file("plan.pgw")));

    std::ofstream(file("other.pgw")) << "mine";
    EXPECT_EQ(run_strata({"render", village(), "-o", file("other.png"), "--size", "32x16", "--edl", "0"}).exit_code, 1);
    EXPECT_EQ(test::file_contents(file("other.pgw")), "mine");
}

TEST_F(Render, AFolderOfScansIsDrawnAsOne) {
    std::filesystem::create_directory(file("scans"));
    std::filesystem::copy_file(village(), file("scans/a.las"));
    ASSERT_EQ(render({"-o", file("file.png")}).exit_code, 0);
    ASSERT_EQ(run_strata({"render", file("scans"), "-o", file("folder.png"), "--size", "320x200", "--edl", "0"}).exit_code, 0);
    EXPECT_EQ(test::file_contents(file("file.png")), test::file_contents(file("folder.png")));
}

TEST_F(Render, WrongCommandLinesAreUsageErrors) {
    const std::vector<std::vector<std::string>> wrong = {
        {"--size", "0x10"}, {"--size", "16385x1"}, {"--size", "10"}, {"--view", "above"}, {"--fov", "180"}, {"--fov", "nan"},
        {"--eye", "0,0,nan"}, {"--eye", "1,2,3", "--target", "1,2,3"}, {"--eye", "1,2,3", "--view", "top"}, {"--up", "0,0,1"},
        {"--color", "smell"}, {"--colormap", "plaid"}, {"--background", "red"}, {"--edl", "-1"}, {"--fill", "0"}, {"--ssao", "0"}, {"--ssao=far", "-q"}, {"--fill", "17"}, {"--fill=wide", "-q"}, {"--edl", "1,2,3"},
        {"--point-size", "0"}, {"--splat", "star"}, {"--min-point-size", "0"}, {"--max-point-size", "257"},
        {"--min-point-size", "9", "--max-point-size", "8"}, {"--min-point-size", "2", "--point-size", "3"}, {"--splat", "surfel"}, {"--error", "0"}, {"--budget", "0"}, {"--meters-per-pixel", "1"},
        {"--reference", "a.png", "--threshold", "-1"}, {"--threshold", "1"},
        {"--depth", file("never.png")}, {"--depth", file("depth.png")}, {"--samples", "0"}, {"--samples", "1025"}, {"--time-budget", "-1"},
    };
    for (std::vector<std::string> words : wrong) {
        const std::string what = words[0] + " " + words[1];
        words.insert(words.end(), {"-o", file("never.png")});
        const ProgramResult result = render(words);
        EXPECT_EQ(result.exit_code, 2) << what << ": " << result.err;
        EXPECT_FALSE(std::filesystem::exists(file("never.png"))) << what;
    }
}

// Samples smooth the picture and leave the depth as it is; one sample is the picture without.
TEST_F(Render, SamplesSmoothEdges) {
    ASSERT_EQ(render({"-o", file("plain.png"), "--depth", file("plain.pfm")}).exit_code, 0);
    ASSERT_EQ(render({"-o", file("one.png"), "--samples", "1"}).exit_code, 0);
    EXPECT_EQ(test::file_contents(file("plain.png")), test::file_contents(file("one.png")));
    ASSERT_EQ(render({"-o", file("four.png"), "--samples", "4", "--depth", file("four.pfm"), "--tile", "33"}).exit_code, 0);
    EXPECT_EQ(test::file_contents(file("plain.pfm")), test::file_contents(file("four.pfm")));
    // It is the same scene, with fewer jumps from pixel to pixel.
    EXPECT_EQ(render({"-o", file("again.png"), "--samples", "4", "--reference", file("four.png"), "--threshold", "0"}).exit_code, 0);
    const auto roughness = [](const Image& image) {
        uint64_t sum = 0;
        for (uint32_t y = 0; y < image.height; ++y)
            for (uint32_t x = 1; x < image.width; ++x) sum += uint64_t(std::abs(green_of(image.at(x, y)) - green_of(image.at(x - 1, y))));
        return double(sum);
    };
    EXPECT_LT(roughness(read_png(file("four.png"))), 0.9 * roughness(read_png(file("plain.png"))));
}

// A picture that has no time shows what the root has.
TEST_F(Render, LittleTimeIsSaid) {
    const ProgramResult result = render({"-o", file("hasty.png"), "--time-budget", "0.000001", "--error", "0.1", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json stats = nlohmann::json::parse(result.out);
    EXPECT_EQ(stats["bound_by"], "time");
    EXPECT_GT(stats["points_drawn"], 0);
    EXPECT_LT(stats["points_drawn"], 80'000);
    EXPECT_GT(stats["error_px"], 0.1);
}

TEST_F(Render, APictureIsCalledPng) {
    for (const std::string name : {"picture", "picture.jpg", ".png"}) {
        EXPECT_EQ(render({"-o", file(name)}).exit_code, 2) << name;
        EXPECT_FALSE(std::filesystem::exists(file(name)));
    }
    EXPECT_EQ(render({"-o", file("picture.PNG")}).exit_code, 0);
}

TEST_F(Render, AnExistingPictureNeedsOverwrite) {
    std::ofstream(file("kept.png")) << "mine";
    EXPECT_NE(run_strata({"render", village(), "-o", file("kept.png"), "--edl", "0"}).exit_code, 0);
    EXPECT_EQ(test::file_contents(file("kept.png")), "mine");
}

}  // namespace
}  // namespace strata
