// strata render of mesh files as users run it, alone and beside points and voxels: the real program, pictures against baselines.
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
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using test::expect_baseline;
using test::ProgramResult;
using test::run_strata;

void write_obj(const std::string& path, const TriangleMesh& mesh) {
    std::ofstream file(path);
    file.precision(17);
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3d& p = mesh.positions[i];
        file << "v " << p.x() << ' ' << p.y() << ' ' << p.z();
        if (!mesh.colors.empty()) file << ' ' << mesh.colors[i][0] / 255.0 << ' ' << mesh.colors[i][1] / 255.0 << ' ' << mesh.colors[i][2] / 255.0;
        file << '\n';
    }
    for (const auto& [a, b, c] : mesh.triangles) file << "f " << a + 1 << ' ' << b + 1 << ' ' << c + 1 << '\n';
}

// A ring, a ball and a slab at the village of the repository's sample data.
TriangleMesh scene_mesh() {
    const Vec3d place(548015, 5327990, 480);
    TriangleMesh mesh = torus_mesh(place + Vec3d(0, 0, 8), 6.0, 2.0, 24);
    append(mesh, sphere_mesh(place + Vec3d(9, -9, 6), 4.0, 12));
    append(mesh, box_mesh(place + Vec3d(3, -3, 1), Vec3d(12, 9, 0.5), Eigen::AngleAxisd(0.3, Vec3d::UnitZ()).toRotationMatrix()));
    for (size_t i = 0; i < mesh.positions.size(); ++i) mesh.colors.push_back({uint8_t(120 + i % 3 * 60), uint8_t(200 - i % 7 * 20), uint8_t(90 + i % 5 * 30), 255});
    return mesh;
}

class RenderMesh : public testing::Test {
protected:
    static void SetUpTestSuite() {
        folder_ = new TemporaryFolder;
        write_obj(file("scene.obj"), scene_mesh());
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
    static std::vector<float> depths_of(const std::string& name, size_t pixels) {
        const std::string pfm = test::file_contents(file(name));
        std::vector<float> depths(pixels);
        EXPECT_GT(pfm.size(), pixels * 4);
        if (pfm.size() > pixels * 4) std::memcpy(depths.data(), pfm.data() + pfm.size() - pixels * 4, pixels * 4);
        return depths;
    }

    static inline TemporaryFolder* folder_ = nullptr;
};

nlohmann::json stats_of(const ProgramResult& result) {
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out);
}

TEST_F(RenderMesh, PicturesAgreeWithTheBaselines) {
    expect_baseline("mesh_smooth", {file("scene.obj"), "--samples", "4"});
    expect_baseline("mesh_wires", {file("scene.obj"), "--mesh", "flat", "--wireframe", "--color", "plain", "--backfaces", "--clip", ",,,,,489.5"});
    expect_baseline("mesh_and_points", {file("scene.obj"), village(), "--eye", "548050,5327950,500", "--target", "548015,5327985,480", "--ssao"});
}

TEST_F(RenderMesh, AStatueAgreesWithItsBaseline) {
    const char* const data = std::getenv("STRATA_DATA");
    const fs::path mesh = fs::path(data ? data : "") / "ply/lucy.ply";
    if (!data || !fs::exists(mesh)) GTEST_SKIP() << "STRATA_DATA names no folder with meshes";
    expect_baseline("mesh_statue", {mesh.string(), "--size", "200x320", "--view", "back"});
}

// A cube of 8 vertices has plain faces, whether its corners have normals, its vertices have their mean, or there are none.
TEST_F(RenderMesh, ACubeIsACubeWhateverItsNormals) {
    const TriangleMesh cube = box_mesh({0, 0, 0}, {1, 1, 1});
    std::string plain, means, faces, corners = "vn 1 0 0\nvn -1 0 0\nvn 0 1 0\nvn 0 -1 0\nvn 0 0 1\nvn 0 0 -1\n", averaged;
    for (const Vec3d& p : cube.positions) {
        const std::string place = std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z());
        plain += "v " + place + "\n";
        means += place + " " + std::to_string(p.x() / std::sqrt(3.0)) + " " + std::to_string(p.y() / std::sqrt(3.0)) + " " + std::to_string(p.z() / std::sqrt(3.0)) + "\n";
    }
    for (const auto& t : cube.triangles) {
        const Vec3d normal = (cube.positions[t[1]] - cube.positions[t[0]]).cross(cube.positions[t[2]] - cube.positions[t[0]]) / 4.0;
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {0, 1})
                if (normal[axis] == (side ? -1.0 : 1.0)) {
                    faces += "f", corners += "f", averaged += "3";
                    for (const uint32_t vertex : t) {
                        faces += " " + std::to_string(vertex + 1);
                        corners += " " + std::to_string(vertex + 1) + "//" + std::to_string(2 * axis + side + 1);
                        averaged += " " + std::to_string(vertex);
                    }
                    faces += "\n", corners += "\n", averaged += "\n";
                }
    }
    std::ofstream(file("none.obj")) << plain << faces;
    std::ofstream(file("corners.obj")) << plain << corners;
    std::ofstream(file("means.ply")) << "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
                                     << "element face 12\nproperty list uchar int vertex_indices\nend_header\n" << means << averaged;
    const auto drawn = [&](const std::string& name, const std::string& shading) {
        EXPECT_EQ(render({file(name), "-o", file(name + ".png"), "--edl", "0", "--mesh", shading, "--eye", "4,-6,3", "--target", "0,0,0"}).exit_code, 0) << name;
        return test::file_contents(file(name + ".png"));
    };
    const std::string flat = drawn("none.obj", "flat");
    EXPECT_EQ(drawn("none.obj", "smooth"), flat);
    EXPECT_EQ(drawn("corners.obj", "smooth"), flat);
    EXPECT_EQ(drawn("means.ply", "smooth"), flat);
}

TEST_F(RenderMesh, SamePixelsForAnyThreadsAndStrips) {
    const std::vector<std::string> all = {file("scene.obj"), village(), "--wireframe", "--ssao", "--fill", "--samples", "2", "--clip", "547960,5327940,,548040,5328010,"};
    const auto drawn = [&](const std::string& name, std::vector<std::string> words) {
        words.insert(words.end(), all.begin(), all.end());
        words.insert(words.end(), {"-o", file(name), "--depth", file(name) + ".pfm"});
        EXPECT_EQ(render(words).exit_code, 0);
        return test::file_contents(file(name)) + test::file_contents(file(name) + ".pfm");
    };
    const std::string one = drawn("one.png", {"--threads", "1"});
    EXPECT_EQ(one, drawn("many.png", {"--threads", "5", "--tile", "37"}));
    EXPECT_EQ(one, drawn("two.png", {"--threads", "2", "--tile", "11"}));
}

// Keys that stay are those of the guide's table.
TEST_F(RenderMesh, TheGuideNamesEveryKeyOfStats) {
    std::ifstream guide(STRATA_SOURCE_DIR "/docs/guide.md");
    std::string row;
    while (std::getline(guide, row) && !row.starts_with("| `render --stats` |")) {}
    ASSERT_TRUE(guide) << "the guide has no row of render --stats";
    const ProgramResult result = render({STRATA_SOURCE_DIR "/sample_data/village.las", "-o", file("keys.png"), "--size", "40x30", "--stats"});
    const nlohmann::json stats = stats_of(result);
    ASSERT_GT(stats.size(), 10u);
    for (const auto& [key, value] : stats.items())
        EXPECT_TRUE(row.find("`" + key + "`") != std::string::npos || row.find("`" + key + " {") != std::string::npos) << key;
}

// An attribute that is the height looks like the height, from PLY files of this program and of others; without it the picture is plain.
TEST_F(RenderMesh, AttributesOfVerticesAreColors) {
    const TriangleMesh mesh = scene_mesh();
    std::ofstream ply(file("heights.ply"));
    ply.precision(17);
    ply << "ply\nformat ascii 1.0\nelement vertex " << mesh.positions.size() << "\nproperty double x\nproperty double y\nproperty double z\nproperty float up_there\nproperty short none\nelement face "
        << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
    for (const Vec3d& p : mesh.positions) ply << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << p.z() << " -7\n";
    for (const auto& [a, b, c] : mesh.triangles) ply << "3 " << a << ' ' << b << ' ' << c << '\n';
    ply.close();
    for (const char* const range : {"475,495", "495,475"}) {
        EXPECT_EQ(render({file("heights.ply"), "-o", file("elevation.png"), "--color", "elevation", "--range", range, "--colormap", "ember"}).exit_code, 0);
        const ProgramResult result = render({file("heights.ply"), "-o", file("attribute.png"), "--color", "up there", "--range", range, "--colormap", "ember", "--reference", file("elevation.png"),
                                             "--threshold", "3", "--stats"});  // weights of corners are floats: a step of 1024
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_EQ(stats_of(result)["color"], "up there");
    }
    EXPECT_EQ(render({file("heights.ply"), "-o", file("own.png"), "--color", "up_there"}).exit_code, 0);
    const ProgramResult missing = render({file("heights.ply"), "-o", file("none.png"), "--color", "down"});
    EXPECT_EQ(missing.exit_code, 2);
    EXPECT_NE(missing.err.find("meshes have no 'down'; expected rgb, elevation, normal, plain or an attribute of vertices, which this one has these of: up_there, none"), std::string::npos) << missing.err;
    // Beside points that have it not, they keep their own colors.
    EXPECT_EQ(render({file("heights.ply"), village(), "-o", file("both.png"), "--color", "up_there"}).exit_code, 0);
    const ProgramResult said = run_strata({"info", file("heights.ply")});
    EXPECT_NE(said.out.find("up_there"), std::string::npos) << said.out;
    const nlohmann::json report = nlohmann::json::parse(run_strata({"info", "--json", file("heights.ply")}).out);
    ASSERT_EQ(report["attributes"].size(), 2u);
    EXPECT_EQ(report["attributes"][1]["name"], "none");
    EXPECT_EQ(report["attributes"][1]["min"], -7);
    EXPECT_EQ(report["attributes"][1]["max"], -7);
    EXPECT_EQ(report["attributes"][1]["unknown"], 0);
}

// A map of a level square: its depth, its size and its stats.
TEST_F(RenderMesh, StatsAndDepthSayWhatIsThere) {
    TriangleMesh square;
    square.positions = {{500000, 5000000, 12.5}, {500010, 5000000, 12.5}, {500010, 5000010, 12.5}, {500000, 5000010, 12.5}};
    square.triangles = {{0, 1, 2}, {0, 2, 3}};
    write_obj(file("square.obj"), square);
    const ProgramResult result = render({file("square.obj"), "-o", file("square.png"), "--depth", file("square.pfm"), "--view", "top", "--ortho", "--meters-per-pixel", "0.1",
                                         "--size", "120x120", "--stats", "--transparent"});
    const nlohmann::json stats = stats_of(result);
    EXPECT_EQ(stats["triangles_drawn"], 2);
    EXPECT_EQ(stats["points_drawn"], 0);
    EXPECT_EQ(stats["color"], "plain");
    EXPECT_TRUE(stats["pass_ms"].contains("meshes"));
    const double eye = stats["camera"]["eye"][2];
    size_t covered = 0;
    for (const float depth : depths_of("square.pfm", 120 * 120)) {
        if (!std::isfinite(depth)) continue;
        ++covered;
        EXPECT_NEAR(eye - depth, 12.5, 1e-5);
    }
    EXPECT_EQ(covered, 100u * 100u);
    const Image picture = read_png(file("square.png"));
    EXPECT_EQ(size_t(std::count_if(picture.pixels.begin(), picture.pixels.end(), [](Rgba8 pixel) { return alpha_of(pixel) == 255; })), covered);
    // Nothing in sight is said.
    const ProgramResult away = render({file("square.obj"), "-o", file("away.png"), "--eye", "0,0,0", "--target", "-1,0,0"});
    EXPECT_EQ(away.exit_code, 0);
    EXPECT_NE(away.err.find("nothing is in sight"), std::string::npos) << away.err;
}

// A model that stands along y looks as the one that stands along z, for views and from a free camera, but for corners that are rounded otherwise.
TEST_F(RenderMesh, ModelsThatStandAlongYAreTurned) {
    TriangleMesh mesh = scene_mesh(), turned;
    const Vec3d middle(548015, 5327990, 480);
    for (Vec3d& p : mesh.positions) p -= middle;
    turned = mesh;
    for (Vec3d& p : turned.positions) p = Vec3d(p.x(), p.z(), -p.y());
    write_obj(file("along_z.obj"), mesh);
    write_obj(file("along_y.obj"), turned);
    for (const std::string name : {"iso", "top", "front", "left"}) {
        ASSERT_EQ(render({file("along_z.obj"), "-o", file("z.png"), "--view", name}).exit_code, 0);
        const ProgramResult result = render({file("along_y.obj"), "-o", file("y.png"), "--view", name, "--up", "y", "--reference", file("z.png"), "--threshold", "2"});
        EXPECT_EQ(result.exit_code, 0) << name << result.err;
        EXPECT_EQ(render({file("along_y.obj"), "-o", file("y.png"), "--view", name, "--reference", file("z.png"), "--threshold", "2"}).exit_code, 1) << name;
    }
    ASSERT_EQ(render({file("along_z.obj"), "-o", file("z.png"), "--eye", "30,-20,25", "--target", "0,0,5"}).exit_code, 0);
    EXPECT_EQ(render({file("along_y.obj"), "-o", file("y.png"), "--eye", "30,25,20", "--target", "0,5,0", "--up", "y", "--reference", file("z.png"), "--threshold", "2"}).exit_code, 0);
    const ProgramResult none = render({file("along_y.obj"), "-o", file("none.png"), "--up", "x", "--eye", "1,2,3"});
    EXPECT_EQ(none.exit_code, 2);
}

// A ball of voxels and the ball that they were made of are one surface: the picture of both shows either where the other one's cells end.
TEST_F(RenderMesh, MeshesAndTheirVoxelsLieAtOneDepth) {
    TriangleMesh ball = sphere_mesh(Vec3d(500000, 5000000, 100), 5.0, 40);
    write_obj(file("ball.obj"), ball);
    ASSERT_EQ(run_strata({"voxelize", file("ball.obj"), "-o", file("ball.svo"), "--voxel-size", "0.05", "--kind", "conservative", "--quiet"}).exit_code, 0);
    const std::vector<std::string> view = {"--eye", "500012,5000000,103", "--target", "500000,5000000,100", "--size", "160x120"};
    const auto depths = [&](const std::string& input, const std::string& name) {
        std::vector<std::string> words = {file(input), "-o", file("ball.png"), "--depth", file(name)};
        words.insert(words.end(), view.begin(), view.end());
        EXPECT_EQ(render(words).exit_code, 0);
        return depths_of(name, 160 * 120);
    };
    const std::vector<float> mesh = depths("ball.obj", "mesh.pfm"), voxels = depths("ball.svo", "voxels.pfm");
    size_t both = 0;
    for (size_t i = 0; i < mesh.size(); ++i) {
        if (std::isfinite(mesh[i])) ASSERT_TRUE(std::isfinite(voxels[i]));  // conservative ones hide the mesh
        if (!std::isfinite(mesh[i])) continue;
        ++both;
        EXPECT_LE(voxels[i], mesh[i] + 1e-4);
        if (mesh[i] < 8.5) EXPECT_GE(voxels[i], mesh[i] - 0.2);  // two cells as large as a pixel, along rays that are not too flat
    }
    EXPECT_GT(both, 3000u);
}

TEST_F(RenderMesh, WrongWordsAndFilesAreRefused) {
    const std::string out = file("none.png");
    std::ofstream(file("points.obj")) << "v 0 0 0\nv 1 0 0\n";
    std::ofstream(file("broken.obj")) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n";
    const struct {
        std::vector<std::string> words;
        int exit_code;
        std::string says;
    } cases[] = {
        {{file("scene.obj"), "--mesh", "round"}, 2, "--mesh: expected flat or smooth, got 'round'"},
        {{file("scene.obj"), "--filter", "class=2"}, 2, "there are none"},
        {{file("scene.obj"), "--color", "intensity"}, 2, "meshes have no 'intensity'"},
        {{file("points.obj"), "--color", "rgb"}, 1, "triangles are expected, there are 2 vertices without any"},
        {{file("broken.obj")}, 1, "broken.obj: line 4: vertex 7"},
        {{file("scene.obj"), "--memory", "100K"}, 1, "scene.obj: "},
    };
    for (const auto& [words, exit_code, says] : cases) {
        std::vector<std::string> all = words;
        all.insert(all.end(), {"-o", out});
        const ProgramResult result = render(all);
        EXPECT_EQ(result.exit_code, exit_code) << says;
        EXPECT_NE(result.err.find(says), std::string::npos) << result.err;
        if (exit_code == 1) EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        EXPECT_FALSE(fs::exists(out));
    }
    // What one of several has is shown of that one.
    EXPECT_EQ(render({file("scene.obj"), village(), "-o", out, "--color", "intensity"}).exit_code, 0);
}

}  // namespace
}  // namespace strata
