// The commands on Draco files, by the real program.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/io/draco/draco_cloud.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::DracoCloud;
using test::ProgramResult;
using test::run_strata;

void write(const std::string& path, const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

// A lattice of red points in whole metres, as another program writes it.
std::vector<std::byte> red_lattice() {
    DracoCloud cloud(1000);
    std::vector<int32_t> places;
    std::vector<uint8_t> colors;
    for (int i = 0; i < 1000; ++i) {
        places.insert(places.end(), {i % 10, i / 10 % 10, i / 100});
        colors.insert(colors.end(), {255, 0, uint8_t(i % 2)});
    }
    cloud.add(draco::GeometryAttribute::POSITION, draco::DT_INT32, 3, places);
    cloud.add(draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, colors);
    return cloud.encode();
}

TEST(DracoCommands, InfoReadsEveryPoint) {
    const TemporaryFolder folder;
    const std::string path = folder.file("lattice.drc");
    write(path, red_lattice());
    const ProgramResult result = run_strata({"info", "--exact", "--json", path});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = json::parse(result.out);
    EXPECT_EQ(report["format"], "drc");
    EXPECT_EQ(report["points"], 1000);
    EXPECT_EQ(report["bounds"]["max"], json({9.0, 9.0, 9.0}));
    EXPECT_EQ(report["rgb_bits"], 8);
    EXPECT_EQ(report["attributes"][0]["max"], json({255, 0, 1}));
    EXPECT_FALSE(report.contains("warnings"));
}

TEST(DracoCommands, ConvertAndRenderTakeThem) {
    const TemporaryFolder folder;
    const std::string path = folder.file("lattice.drc");
    write(path, red_lattice());
    const ProgramResult converted = run_strata({"convert", path, folder.file("set"), "--json"});
    ASSERT_EQ(converted.exit_code, 0) << converted.err;
    EXPECT_EQ(json::parse(converted.out)["points_written"], 1000);
    // What is drawn is what is drawn of the same points from levels of detail, all of which this small view takes.
    for (const std::string& input : {path, folder.file("set")}) {
        const ProgramResult rendered = run_strata({"render", input, "-o", input + ".png", "--size", "64x64", "--edl", "0", "--quiet"});
        ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
    }
    EXPECT_EQ(test::file_contents(path + ".png"), test::file_contents(folder.file("set.png")));
}

TEST(DracoCommands, AFolderOfFilesIsOneCloud) {
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder.file("tiles"));
    write(folder.file("tiles/a.drc"), red_lattice());
    write(folder.file("tiles/b.drc"), red_lattice());
    const ProgramResult result = run_strata({"convert", folder.file("tiles"), folder.file("set"), "--json"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(json::parse(result.out)["points_written"], 2000);
}

TEST(DracoCommands, ABadFileIsOneLine) {
    const TemporaryFolder folder;
    const std::string path = folder.file("cut.drc");
    std::vector<std::byte> bytes = red_lattice();
    bytes.resize(bytes.size() / 2);
    write(path, bytes);
    EXPECT_EQ(test::refusal_verdict(run_strata({"info", path})), "");
}

}  // namespace
}  // namespace strata
