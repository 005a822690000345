// strata render --iso as users run it: volumes and grids, several isovalues, beside meshes and points.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "render/image.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::ProgramResult;
using test::run_strata;

// Two balls that touch, by a sum of two bells, at UTM coordinates.
class RenderIsosurface : public testing::Test {
protected:
    static void SetUpTestSuite() {
        folder_ = new TemporaryFolder;
        std::ofstream out(file("bells.mha"), std::ios::binary);
        out << "ObjectType = Image\nNDims = 3\nDimSize = 48 40 36\nElementSpacing = 0.5 0.5 0.75\nOffset = 500000 5300000 120\nElementType "
               "= MET_FLOAT\nElementDataFile = LOCAL\n";
        for (int k = 0; k < 36; ++k)
            for (int j = 0; j < 40; ++j)
                for (int i = 0; i < 48; ++i) {
                    const auto bell = [&](double x, double y, double z) {
                        return std::exp(-((i - x) * (i - x) + (j - y) * (j - y) + 2.25 * (k - z) * (k - z)) / 90.0);
                    };
                    const float value = float(100.0 * (bell(15, 19, 16) + bell(32, 21, 19)));
                    out.write(reinterpret_cast<const char*>(&value), sizeof value);
                }
    }
    static void TearDownTestSuite() {
        delete folder_;
        folder_ = nullptr;
    }
    static std::string file(const std::string& name) { return folder_->file(name); }
    static ProgramResult render(std::vector<std::string> words) {
        words.insert(words.begin(), {"render", "--overwrite"});
        words.insert(words.end(), {"--size", "320x240"});
        return run_strata(words);
    }

    static inline TemporaryFolder* folder_ = nullptr;
};

TEST_F(RenderIsosurface, TheMeshGivesTheSamePicture) {
    ASSERT_EQ(run_strata({"surface", file("bells.mha"), "--iso", "50", "-o", file("bells.ply"), "--normals", "--quiet"}).exit_code, 0);
    for (const char* view : {"front", "top", "iso"}) {
        // One camera for both: that of the mesh.
        const ProgramResult mesh =
            render({file("bells.ply"), "--view", view, "-o", file("mesh.png"), "--stats", "--depth", file("mesh.pfm")});
        ASSERT_EQ(mesh.exit_code, 0) << mesh.err;
        std::ofstream(file("camera.json")) << nlohmann::json::parse(mesh.out)["camera"];
        const ProgramResult rays = render({file("bells.mha"), "--iso", "50", "--camera", file("camera.json"), "-o", file("rays.png"),
                                           "--stats", "--reference", file("mesh.png"), "--threshold", "12"});
        EXPECT_EQ(rays.exit_code, 0) << view << ": " << rays.err;
        EXPECT_TRUE(nlohmann::json::parse(rays.out)["pass_ms"].contains("isosurfaces"));
    }
}

// Two nested surfaces, the outer one cut open: each has in the mesh the color that it is shown in.
TEST_F(RenderIsosurface, TheMeshOfSeveralHasTheSameColors) {
    ASSERT_EQ(run_strata({"surface", file("bells.mha"), "--iso", "30,60", "-o", file("nested.ply"), "--normals", "--quiet"}).exit_code, 0);
    const std::vector<std::string> cut = {"--clip-out", "499990,5299990,100,500030,5300007,160"};
    const auto with_cut = [&](std::vector<std::string> words) {
        words.insert(words.end(), cut.begin(), cut.end());
        return render(words);
    };
    const ProgramResult mesh = with_cut({file("nested.ply"), "--view", "front", "-o", file("nested.png"), "--stats"});
    ASSERT_EQ(mesh.exit_code, 0) << mesh.err;
    std::ofstream(file("nested.json")) << nlohmann::json::parse(mesh.out)["camera"];
    const ProgramResult rays = with_cut({file("bells.mha"), "--iso", "30,60", "--camera", file("nested.json"), "-o", file("nested_rays.png"),
                                         "--reference", file("nested.png"), "--threshold", "12"});
    EXPECT_EQ(rays.exit_code, 0) << rays.err;
}

TEST_F(RenderIsosurface, SeveralIsovaluesAndWhatIsBesideThem) {
    ASSERT_EQ(run_strata({"surface", file("bells.mha"), "--iso", "80", "-o", file("core.ply"), "--quiet"}).exit_code, 0);
    const ProgramResult two = render({file("bells.mha"), file("core.ply"), "--iso", "30,60", "--clip-out",
                                      "500000,5300000,120,500030,5300010,160", "-o", file("two.png")});
    EXPECT_EQ(two.exit_code, 0) << two.err;
    EXPECT_NE((two.out + two.err).find("triangles and 2 isosurfaces"), std::string::npos) << two.out << two.err;
    const ProgramResult strips =
        render({file("bells.mha"), file("core.ply"), "--iso", "30,60", "--clip-out", "500000,5300000,120,500030,5300010,160", "-o",
                file("strips.png"), "--tile", "37", "--threads", "3", "--reference", file("two.png"), "--threshold", "0"});
    EXPECT_EQ(strips.exit_code, 0) << strips.err;
}

// An outer surface lets an inner one show through; over nothing the picture is as transparent.
TEST_F(RenderIsosurface, OuterSurfacesLetInnerOnesShow) {
    const auto picture = [&](std::vector<std::string> words, const char* name) {
        words.insert(words.begin(), {file("bells.mha"), "--view", "front", "--ortho", "--edl", "0", "-o", file(name)});
        const ProgramResult result = render(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return read_png(file(name));
    };
    const Image outer = picture({"--iso", "30"}, "outer.png"), both = picture({"--iso", "30,60"}, "opaque.png");
    EXPECT_EQ(outer.pixels, both.pixels);  // which hides the inner one
    const Image through = picture({"--iso", "30,60", "--opacity", "0.4,1"}, "through.png");
    const Image alone = picture({"--iso", "30", "--opacity", "0.4"}, "alone.png");
    const Image nothing_behind = picture({"--iso", "30", "--opacity", "0.4", "--transparent"}, "nothing_behind.png");
    size_t inner = 0, only_outer = 0;
    for (size_t i = 0; i < through.pixels.size(); ++i) {
        if (through.pixels[i] != alone.pixels[i]) {
            ++inner;
            EXPECT_EQ(alpha_of(nothing_behind.pixels[i]), 163);  // two layers, (1 - 0.4)^2 pass
        } else if (alpha_of(nothing_behind.pixels[i]) > 0) {
            ++only_outer;
        }
        EXPECT_EQ(alpha_of(nothing_behind.pixels[i]) > 0, outer.pixels[i] != outer.pixels[0]);
    }
    EXPECT_GT(inner, 500u);
    EXPECT_GT(only_outer, 500u);
    for (const char* words : {"0", "1.5", "0.5,0.5,0.5", "x", "0.5,"})
        EXPECT_EQ(render({file("bells.mha"), "--iso", "30,60", "--opacity", words, "-o", file("none.png")}).exit_code, 2) << words;
    EXPECT_EQ(render({file("bells.mha"), "--opacity", "0.5", "-o", file("none.png")}).exit_code, 2);
}

// What the picture is made of, and what has no say in it.
TEST_F(RenderIsosurface, StatisticsAndNotes) {
    const ProgramResult two = render({file("bells.mha"), "--iso", "30,60", "-o", file("two.png"), "--stats", "--wireframe", "--backfaces"});
    ASSERT_EQ(two.exit_code, 0) << two.err;
    const nlohmann::json stats = nlohmann::json::parse(two.out)["isosurfaces"];
    EXPECT_EQ(stats["isovalues"], nlohmann::json({30.0, 60.0}));
    EXPECT_EQ(stats["bricks"], 6 * 5 * 5);
    EXPECT_EQ(stats["rays"], 2 * 320 * 240);
    EXPECT_GT(stats["hits"], 10'000);
    EXPECT_GT(stats["bytes"], 6 * 5 * 5 * 512 * 4);
    EXPECT_GT(stats["cells"], 1000);
    EXPECT_NE(two.err.find("note: --wireframe is for triangles of meshes, and there are none"), std::string::npos) << two.err;
    EXPECT_NE(two.err.find("note: --backfaces is for triangles of meshes, and there are none"), std::string::npos) << two.err;
    EXPECT_EQ(render({file("bells.mha"), "--iso", "30", "-o", file("two.png"), "--wireframe", "--quiet"}).err, "");
}

TEST_F(RenderIsosurface, WhatHidesOthersIsSaidOnce) {
    const std::string said = "note: isosurfaces hide those inside of them; --opacity 0.3";
    const std::string err = render({file("bells.mha"), "--iso", "30,60,90", "-o", file("nested.png")}).err;
    ASSERT_NE(err.find(said), std::string::npos) << err;
    EXPECT_EQ(err.find(said, err.find(said) + 1), std::string::npos) << err;
    const auto says = [&](std::vector<std::string> words) {
        words.insert(words.begin(), file("bells.mha"));
        words.insert(words.end(), {"-o", file("nested.png")});
        const ProgramResult result = render(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return result.err.find(said) != std::string::npos;
    };
    EXPECT_FALSE(says({"--iso", "30"}));
    EXPECT_FALSE(says({"--iso", "30,1e6"}));  // of which there is one
    EXPECT_FALSE(says({"--iso", "30,60", "--opacity", "1"}));
    EXPECT_FALSE(says({"--iso", "30,60", "--quiet"}));
}

// Views are framed around the surface and what clip boxes leave of it, not around the grid.
TEST_F(RenderIsosurface, ViewsAreFramedAroundTheSurface) {
    const auto rows_and_columns = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {file("bells.mha"), "--iso", "90", "--view", "front", "--ortho", "--edl", "0", "--transparent", "-o", file("framed.png")});
        EXPECT_EQ(render(words).exit_code, 0);
        const Image image = read_png(file("framed.png"));
        uint32_t top = image.height, bottom = 0, left = image.width, right = 0;
        for (uint32_t y = 0; y < image.height; ++y)
            for (uint32_t x = 0; x < image.width; ++x) {
                if (alpha_of(image.at(x, y)) == 0) continue;
                top = std::min(top, y);
                bottom = std::max(bottom, y + 1);
                left = std::min(left, x);
                right = std::max(right, x + 1);
            }
        return std::pair(bottom > top ? bottom - top : 0, right > left ? right - left : 0);
    };
    // Two small balls side by side, 10 units apart, then one alone, in a box that is much higher than it: each fills the picture in one direction,
    // but for the margins and parts of cells, of which a ball has six.
    EXPECT_GT(rows_and_columns({}).second, 260u);
    EXPECT_GT(rows_and_columns({"--clip", "500000,,100,500011,,160"}).first, 170u);
    EXPECT_GT(rows_and_columns({"--clip-out", "500011,,,,,"}).first, 170u);
}

TEST_F(RenderIsosurface, WrongWordsAreRefused) {
    const ProgramResult none = render({file("bells.mha"), "-o", file("none.png")});
    EXPECT_EQ(none.exit_code, 2);
    EXPECT_NE(none.err.find("--iso V is expected; the values of"), std::string::npos) << none.err;
    EXPECT_EQ(render({file("bells.mha"), "--iso", "x", "-o", file("none.png")}).exit_code, 2);
    EXPECT_EQ(render({file("bells.mha"), "--iso", "50", "--color", "intensity", "-o", file("none.png")}).exit_code, 2);
    EXPECT_EQ(render({STRATA_SOURCE_DIR "/sample_data/village.las", "--iso", "50", "-o", file("none.png")}).exit_code, 2);
    const ProgramResult little = render({file("bells.mha"), "--iso", "50", "--memory", "200K", "-o", file("none.png")});
    EXPECT_EQ(little.exit_code, 1);
    EXPECT_NE(little.err.find("bytes of memory"), std::string::npos) << little.err;
    // The samples fit, the cells of a surface fit, those of two hundred do not.
    std::string many = "50";
    for (int number = 1; number < 200; ++number) many += "," + std::to_string(50.0 + 0.1 * number);
    EXPECT_EQ(render({file("bells.mha"), "--iso", "50", "--memory", "374000", "-o", file("fits.png")}).exit_code, 0);
    const ProgramResult many_surfaces = render({file("bells.mha"), "--iso", many, "--memory", "374000", "-o", file("none.png")});
    EXPECT_EQ(many_surfaces.exit_code, 1);
    EXPECT_NE(many_surfaces.err.find("bells.mha: the cells of a surface need"), std::string::npos) << many_surfaces.err;
    EXPECT_NE(many_surfaces.err.find("--memory gives more"), std::string::npos) << many_surfaces.err;
    EXPECT_FALSE(fs::exists(file("none.png")));
    const ProgramResult beyond = render({file("bells.mha"), "--iso", "1e6", "-o", file("beyond.png")});
    EXPECT_EQ(beyond.exit_code, 0);
    EXPECT_NE(beyond.err.find("no surface at isovalue 1000000; values are from"), std::string::npos) << beyond.err;
}

// A real volume and a level set: something is in sight from everywhere.
TEST_F(RenderIsosurface, RealFieldsAreDrawn) {
    const char* const data = std::getenv("STRATA_DATA");
    const std::string volume = std::string(data ? data : "") + "/volume/HeadMRVolume.mhd",
                      mesh = std::string(data ? data : "") + "/obj/spot.obj";
    if (!data || !fs::exists(volume) || !fs::exists(mesh)) GTEST_SKIP() << "STRATA_DATA names no folder with volumes and meshes";
    const ProgramResult head = render({volume, "--iso", "40", "-o", file("head.png")});
    EXPECT_EQ(head.exit_code, 0) << head.err;
    EXPECT_EQ(head.err.find("nothing is in sight"), std::string::npos) << head.err;
    const ProgramResult grid =
        run_strata({"voxelize", mesh, "-o", file("spot.vdb"), "--kind", "level-set", "--resolution", "96", "--quiet"});
    if (grid.exit_code != 0 && grid.err.find("this build has no OpenVDB") != std::string::npos) GTEST_SKIP() << grid.err;
    ASSERT_EQ(grid.exit_code, 0) << grid.err;
    const ProgramResult surface = render({file("spot.vdb"), "--iso", "0", "-o", file("spot.png"), "--stats"});
    EXPECT_EQ(surface.exit_code, 0) << surface.err;
    EXPECT_EQ(surface.err.find("nothing is in sight"), std::string::npos) << surface.err;
}

}  // namespace
}  // namespace strata
