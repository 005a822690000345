// strata render --clip, --clip-out and --filter against what the bytes of the file say.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using test::ProgramResult;
using test::run_strata;

const std::string kVillage = STRATA_SOURCE_DIR "/sample_data/village.las";

// A point record of the village: LAS 1.4, format 7, scale 0.001, offset 548000, 5328000, 0.
struct Record {
    const char* bytes;

    template <typename T>
    T field(size_t at) const {
        T value;
        std::memcpy(&value, bytes + at, sizeof value);
        return value;
    }
    int32_t x() const { return field<int32_t>(0); }
    int32_t y() const { return field<int32_t>(4); }
    int32_t z() const { return field<int32_t>(8); }
    uint16_t intensity() const { return field<uint16_t>(12); }
    int return_number() const { return field<uint8_t>(14) & 15; }
    int classification() const { return field<uint8_t>(16); }
    double gps_time() const { return field<double>(22); }
};

// The file's bytes with only those of its points that pass.
std::string village_of(const std::function<bool(const Record&)>& passes, uint64_t& count) {
    std::string bytes = test::file_contents(kVillage);
    uint32_t begin;
    uint16_t size;
    std::memcpy(&begin, &bytes[96], sizeof begin);
    std::memcpy(&size, &bytes[105], sizeof size);
    std::string kept = bytes.substr(0, begin);
    for (size_t at = begin; at + size <= bytes.size(); at += size)
        if (passes({&bytes[at]})) kept.append(bytes, at, size);
    count = (kept.size() - begin) / size;
    std::memcpy(&kept[247], &count, sizeof count);
    return kept;
}

class RenderCut : public testing::Test {
protected:
    // Straight down on all of the village, every point of it drawn.
    ProgramResult render(const std::string& input, std::vector<std::string> words) {
        std::ofstream(folder_.file("above.json")) << R"({"eye": [548000, 5328000, 900], "target": [548000, 5328000, 470], "up": [0.1, 1, 0], "ortho_height": 200})";
        words.insert(words.begin(), {"render", input, "--camera", folder_.file("above.json"), "--size", "400x400", "--overwrite", "--edl", "0", "--error", "0.0001",
                                     "--point-size", "1", "--stats"});
        return run_strata(words);
    }
    uint64_t points_drawn(std::vector<std::string> words) {
        words.insert(words.end(), {"-o", folder_.file("count.png")});
        const ProgramResult result = render(kVillage, words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return result.exit_code == 0 ? nlohmann::json::parse(result.out)["points_drawn"].get<uint64_t>() : 0;
    }

    TemporaryFolder folder_;
};

TEST_F(RenderCut, AsManyPointsAreDrawnAsTheFileHas) {
    const struct {
        std::vector<std::string> words;
        std::function<bool(const Record&)> passes;
    } cuts[] = {
        {{}, [](const Record&) { return true; }},
        {{"--clip", "547990.123,5327980,475.5,548020.5,5328040.25,481"},
         [](const Record& r) { return r.x() >= -9877 && r.x() <= 20500 && r.y() >= -20000 && r.y() <= 40250 && r.z() >= 475500 && r.z() <= 481000; }},
        {{"--clip", ",5328000,,548000,,;548030,,,,,", "--clip-out", ",,,,,475"},
         [](const Record& r) { return ((r.x() <= 0 && r.y() >= 0) || r.x() >= 30000) && r.z() > 475000; }},
        {{"--filter", "class=2,6;return=1"}, [](const Record& r) { return (r.classification() == 2 || r.classification() == 6) && r.return_number() == 1; }},
        {{"--filter", "intensity=10000:20000", "--clip", ",,,548000,,"},
         [](const Record& r) { return r.intensity() >= 10000 && r.intensity() <= 20000 && r.x() <= 0; }},
        {{"--filter", "elevation=:472.25;gps-time=400000010:400000200"}, [](const Record& r) { return r.z() <= 472250 && r.gps_time() >= 400000010 && r.gps_time() <= 400000200; }},
        {{"--filter", "class=200"}, [](const Record&) { return false; }},
        {{"--clip", "0,0,0,1,1,1"}, [](const Record&) { return false; }},
    };
    for (const auto& [words, passes] : cuts) {
        uint64_t count = 0;
        village_of(passes, count);
        EXPECT_EQ(points_drawn(words), count) << (words.empty() ? "" : words[1]);
    }
}

// What is in a box and what is not are all of the cloud, to the point on its face.
TEST_F(RenderCut, InsideAndOutsideAddUp) {
    const std::string box = "547990.123,5327980,475.5,548020.5,5328040.25,481";
    EXPECT_EQ(points_drawn({"--clip", box}) + points_drawn({"--clip-out", box}), 80'000u);
}

// Points a millimeter apart across a plane at UTM coordinates: the one on it is in, its neighbor is not, also where the
// file's offset makes the sums round.
TEST_F(RenderCut, APointOnTheFaceIsIn) {
    const double plane = 5'328'123.457;
    for (const double offset : {5'327'925.238, 5'000'000.0, 5'300'000.001}) {
        test::LasFile file{.scale = {0.001, 0.001, 0.001}, .offset = {548'000, offset, 0}};
        const auto on_plane = int32_t(5'328'123'457 - std::llround(offset * 1000));  // in whole millimeters
        for (int i = -2; i <= 2; ++i) file.records.push_back(test::las_record(0, {.y = on_plane + i}));
        file.min = {548'000, plane - 1, 0};
        file.max = {548'000, plane + 1, 0};
        const std::vector<std::byte> bytes = file.bytes();
        std::ofstream(folder_.file("five.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        for (const auto& [flag, left] : {std::pair{"--clip", 3}, std::pair{"--clip-out", 2}}) {
            const ProgramResult result = run_strata({"render", folder_.file("five.las"), "-o", folder_.file("five.png"), "--overwrite", "--size", "64x64", "--edl", "0",
                                                     "--eye", "548000,5328120,3", "--target", "548000,5328124,0", flag, ",5328123.457,,,,", "--stats"});
            ASSERT_EQ(result.exit_code, 0) << result.err;
            EXPECT_EQ(nlohmann::json::parse(result.out)["points_drawn"], left) << flag << ' ' << offset;
        }
    }
}

// The picture of a cut cloud is that of a file without the points that were cut. The box is inside the cloud, whose
// extent, and with it every rounding on the way to the picture, stays. From that eye no two points are equally far.
TEST_F(RenderCut, ThePictureIsThatOfAFileWithoutThem) {
    uint64_t count = 0;
    const std::string less = village_of(
        [](const Record& r) {
            const bool in = r.x() >= -20000 && r.x() <= 12345 && r.y() >= -30000 && r.y() <= 31000;
            return !in && r.classification() != 5;
        },
        count);
    std::ofstream(folder_.file("less.las"), std::ios::binary) << less;
    ASSERT_LT(count, 70'000u);
    for (const char* size : {"1", "3"}) {
        std::vector<std::string> words = {"-o", folder_.file("less.png"), "--point-size", size, "--splat", "square"};
        const auto run = [&](const std::string& input, std::vector<std::string> more) {
            std::vector<std::string> all = {"render", input, "--eye", "548151,5327847,561", "--target", "548000,5328000,475", "--size", "400x300", "--edl", "0",
                                            "--error", "0.0001", "--point-size", size, "--splat", "square", "--overwrite"};
            all.insert(all.end(), more.begin(), more.end());
            return run_strata(all);
        };
        ASSERT_EQ(run(folder_.file("less.las"), {"-o", folder_.file("less.png")}).exit_code, 0);
        const ProgramResult result = run(kVillage, {"-o", folder_.file("cut.png"), "--clip-out", "547980,5327970,,548012.345,5328031,", "--filter",
                                                    "class=0:4,6:255", "--reference", folder_.file("less.png"), "--threshold", "0"});
        EXPECT_EQ(result.exit_code, 0) << result.err;
    }
}

// The view of a named direction shows what is kept, large.
TEST_F(RenderCut, ViewsAreFramedAroundTheBoxes) {
    const ProgramResult result = run_strata({"render", kVillage, "-o", folder_.file("near.png"), "--view", "top", "--ortho", "--size", "300x300", "--edl", "0",
                                             "--clip", "547990,5327990,,548010,5328010,", "--stats"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json camera = nlohmann::json::parse(result.out)["camera"];
    EXPECT_NEAR(camera["eye"][0], 548'000, 0.1);
    EXPECT_NEAR(camera["ortho_height"], 20 / (1 - 2 * 0.03), 0.1);  // a margin of 3 % at each side
}

TEST_F(RenderCut, ACutThatLeavesNothingIsSaid) {
    const ProgramResult nothing = render(kVillage, {"--clip", "0,0,0,10,10,3", "-o", folder_.file("a.png")});
    const ProgramResult something = render(kVillage, {"--filter", "class=2", "-o", folder_.file("b.png")});
    EXPECT_EQ(nothing.exit_code, 0);
    EXPECT_NE(nothing.err.find("nothing is in sight"), std::string::npos) << nothing.err;
    EXPECT_EQ(something.err.find("nothing is in sight"), std::string::npos) << something.err;
}

TEST_F(RenderCut, WrongCutsAreUsageErrors) {
    const struct {
        std::vector<std::string> words;
        std::string says;
    } wrong[] = {
        {{"--clip", "5,0,0,1,1,1"}, "least x, 5"},           {{"--clip", "0,0,0,1,1,nan"}, "'nan'"},
        {{"--clip-out", "0,0,0,1,1"}, "--clip-out"},         {{"--filter", "smell=1"}, "elevation, lod, intensity, return number"},
        {{"--filter", "intensity=2000:100"}, "2000:100"},    {{"--filter", "rgb=1"}, "choose one, as rgb[0]"},
        {{"--filter", "intensity"}, "NAME=VALUES"},
    };
    for (const auto& [words, says] : wrong) {
        std::vector<std::string> all = words;
        all.insert(all.end(), {"-o", folder_.file("never.png")});
        const ProgramResult result = render(kVillage, all);
        EXPECT_EQ(result.exit_code, 2) << words[1];
        EXPECT_NE(result.err.find(says), std::string::npos) << result.err;
    }
}

}  // namespace
}  // namespace strata
