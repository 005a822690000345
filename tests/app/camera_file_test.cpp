#include "app/commands/camera_file.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/error.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

TEST(CameraFile, ReadsEveryKeyToTheLastDigit) {
    const CameraSpec camera = parse_camera(R"({"eye": [691000.001, 5335000.002, 512.003], "target": [691100, 5335000, 480],
                                              "up": [0, 1, 0], "fov": 30.5})");
    EXPECT_EQ(camera.eye, Vec3d(691000.001, 5335000.002, 512.003));
    EXPECT_EQ(camera.target, Vec3d(691100, 5335000, 480));
    EXPECT_EQ(camera.up, Vec3d(0, 1, 0));
    EXPECT_EQ(camera.fov_deg, 30.5);
    EXPECT_FALSE(camera.ortho_height);
}

TEST(CameraFile, UpAndAngleHaveDefaults) {
    const CameraSpec camera = parse_camera(R"({"eye": [0, -10, 0], "target": [0, 0, 0], "ortho_height": 25})");
    EXPECT_EQ(camera.up, Vec3d::UnitZ());
    EXPECT_EQ(camera.ortho_height, 25.0);
}

TEST(CameraFile, SaysWhatIsWrong) {
    const std::pair<const char*, const char*> cases[] = {
        {"", "JSON object"},
        {"[1, 2]", "JSON object"},
        {R"({"eye": [0, 0, 1]})", "\"target\" is missing"},
        {R"({"target": [0, 0, 1]})", "\"eye\" is missing"},
        {R"({"eye": [0, 0], "target": [0, 0, 0]})", "\"eye\": three numbers"},
        {R"({"eye": [0, 0, "1"], "target": [0, 0, 0]})", "\"eye\": a number"},
        {R"({"eye": [0, 0, 1e999], "target": [0, 0, 0]})", "JSON object"},  // the parser refuses it itself
        {R"({"eye": [0, 0, null], "target": [0, 0, 0]})", "\"eye\": a number"},
        {R"({"eye": [1, 2, 3], "target": [1, 2, 3]})", "same point"},
        {R"({"eye": [0, 0, 9], "target": [0, 0, 0]})", "\"up\" must not lie along"},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "up": [0, 0, 0]})", "\"up\""},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "fov": 180})", "\"fov\""},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "fov": 0})", "\"fov\""},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "ortho_height": -1})", "\"ortho_height\""},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "ortho_height": 1, "fov": 45})", "exclude"},
        {R"({"eye": [0, 1, 0], "target": [0, 0, 0], "fow": 45})", "\"fow\": is no key"},
    };
    for (const auto& [text, expected] : cases) {
        try {
            parse_camera(text);
            ADD_FAILURE() << text;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::malformed);
            EXPECT_NE(std::string(error.what()).find(expected), std::string::npos) << text << ": " << error.what();
        }
    }
}

TEST(CameraFile, NamesTheFile) {
    const TemporaryFolder folder;
    const std::string path = folder.file("camera.json");
    std::ofstream(path) << "{}";
    try {
        read_camera_file(path);
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(std::string(error.what()), path + ": \"eye\" is missing");
    }
    EXPECT_THROW(read_camera_file(folder.file("none.json")), Error);
}

}  // namespace
}  // namespace strata
