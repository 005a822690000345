// What strata info says of volumes, by the real program.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

void write_text(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

TEST(InfoOfVolumes, SaysWhereSamplesLieAndTheirRange) {
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder.file("data"));
    write_text(folder.file("data/x.raw"), std::string("head\1\2\3\xFF", 8));
    write_text(folder.file("x.mhd"), "ObjectType = Image\nNDims = 3\nDimSize = 2 1 2\nElementSpacing = 2 3 4\nOffset = 10 20 30\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\n"
                                     "HeaderSize = 4\nElementType = MET_CHAR\nElementDataFile = data/x.raw\n");
    const ProgramResult result = run_strata({"info", "--json", folder.file("x.mhd")});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = json::parse(result.out);
    EXPECT_EQ(report["format"], "metaimage");
    EXPECT_EQ(report["dimensions"], json({2, 1, 2}));
    EXPECT_EQ(report["spacing"], json({2.0, 3.0, 4.0}));
    EXPECT_EQ(report["origin"], json({10.0, 20.0, 30.0}));
    EXPECT_EQ(report["directions"][0], json({0.0, 1.0, 0.0}));
    EXPECT_EQ(report["bounds"]["max"], json({10.0, 22.0, 34.0}));
    EXPECT_EQ(report["range"], (json{{"min", -1.0}, {"max", 3.0}}));
    EXPECT_EQ(report["attributes"][0]["type"], "int8");
    const ProgramResult text = run_strata({"info", folder.file("x.mhd")});
    ASSERT_EQ(text.exit_code, 0) << text.err;
    for (const char* const line : {"dimensions    2 x 1 x 2 samples", "spacing       2  3  4", "raw, in data/x.raw", "value  int8         -1 .. 3"})
        EXPECT_NE(text.out.find(line), std::string::npos) << line << "\n" << text.out;
}

// One line that names the file, the place and what was expected; nothing outside of the folder is opened.
TEST(InfoOfVolumes, RefusesWhatIsWrongInOneLine) {
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder.file("in"));
    write_text(folder.file("x.raw"), "12345678");
    const std::string path = folder.file("in/x.mhd"), header = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\n";
    const std::pair<std::string, const char*> rows[] = {{"ElementDataFile = ../x.raw\n", "line 4: a file beside this one"}, {"ElementDataFile = " + folder.file("x.raw") + "\n", "line 4: a file beside this one"},
                                                        {"ElementDataFile = x.raw\n", "No such file"}, {"ElementSpacing = 1 1 0\nElementDataFile = LOCAL\n12345678", "line 4: spacings above 0"},
                                                        {"ElementDataFile = LOCAL\n1234567", "8 bytes; 7 are left"}};
    for (const auto& [lines, said] : rows) {
        write_text(path, header + lines);
        const ProgramResult result = run_strata({"info", path});
        EXPECT_EQ(result.exit_code, 1) << lines;
        EXPECT_TRUE(result.err.starts_with("strata: " + path + ": ")) << result.err;
        EXPECT_NE(result.err.find(said), std::string::npos) << result.err;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    }
}

}  // namespace
}  // namespace strata
