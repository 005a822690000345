#include "io/format.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "core/error.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

void write(const std::string& path, const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

TEST(Format, TheListHasNoNameTwice) {
    std::set<std::string_view> names;
    for (const Format& format : all_formats()) EXPECT_TRUE(names.insert(format.name).second) << format.name;
}

// By content, whatever the name says.
TEST(Format, FirstBytesDecide) {
    const TemporaryFolder folder;
    const std::string path = folder.file("scan.ply");
    test::LasFile las{.point_format = 0};
    las.records = {test::las_record(0, {.x = 42})};
    const std::vector<std::pair<std::string, std::vector<std::byte>>> files = {
        {"las", las.bytes()},
        {"ply", test::bytes_of("ply\nformat ascii 1.0\n")},
        {"pcd", test::bytes_of("# .PCD v0.7 - Point Cloud Data\n")},
        {"e57", test::bytes_of("ASTM-E57\1")},
        {"drc", test::bytes_of("DRACO\2\2")},
        {"3dtiles", test::bytes_of("pnts\1")},
        {"glb", test::bytes_of(std::string("glTF\2\0\0\0", 8))},
        {"nrrd", test::bytes_of("NRRD0004\ntype: short\n")},
        {"vtk", test::bytes_of("# vtk DataFile Version 3.0\n")},
        {"metaimage", test::bytes_of("ObjectType = Image\nNDims = 3\n")},
        {"metaimage", test::bytes_of("NDims=3\r\nDimSize=1 1 1\r\n")},
    };
    for (const auto& [name, bytes] : files) {
        write(path, bytes);
        EXPECT_EQ(identify_format(path).name, name);
    }
    write(path, las.bytes());
    EXPECT_EQ(test::points_of(*open_points({&path, 1})).x, std::vector<int32_t>{42});
}

TEST(Format, FoldersAreKnownByTheirMainFile) {
    const TemporaryFolder folder;
    const std::pair<const char*, const char*> kinds[] = {{"metadata.json", "potree"}, {"tileset.json", "3dtiles"}, {"ept.json", "ept"}};
    for (const auto& [file, name] : kinds) {
        const std::string path = folder.file(name);
        fs::create_directory(path);
        std::ofstream(path + "/" + file) << "{}";
        EXPECT_EQ(identify_format(path).name, name);
    }
    EXPECT_EQ(identify_format(folder.file("potree") + "/metadata.json").name, "potree");
}

TEST(Format, WhatIsNotKnownNamesWhatIs) {
    const TemporaryFolder folder;
    const std::string empty = folder.file("empty.las"), text = folder.file("text.las"), bare = folder.file("bare");
    write(empty, {});
    write(text, test::bytes_of("hello"));
    fs::create_directory(bare);
    for (const auto& [path, part] : {std::pair(empty, "an empty file"), std::pair(text, "reads las, laz, "), std::pair(bare, "a folder without data")}) try {
            identify_format(path);
            FAIL() << path;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::unsupported);
            EXPECT_EQ(std::string(error.what()).rfind(path + ": ", 0), 0u) << error.what();
            EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
        }
    EXPECT_THROW(identify_format(folder.file("none")), Error);
}

TEST(Format, AFolderStandsForItsScansByName) {
    const TemporaryFolder folder;
    for (const char* name : {"b.LAS", "a.las", "c.laz", "notes.txt"}) write(folder.file(name), {});
    fs::create_directory(folder.file("set"));
    write(folder.file("set/metadata.json"), {});
    const std::vector<std::string> words = {"typed.xyz", folder.path(), folder.file("set")};
    EXPECT_EQ(point_files(words), (std::vector<std::string>{"typed.xyz", folder.file("a.las"), folder.file("b.LAS"),
                                                            folder.file("c.laz"), folder.file("set")}));
    fs::create_directory(folder.file("empty"));
    const std::vector<std::string> empty = {folder.file("empty")};
    EXPECT_THROW(point_files(empty), Error);
}

TEST(Format, SeveralFilesAreOneCloud) {
    const TemporaryFolder folder;
    std::vector<std::string> paths;
    for (int i = 0; i < 5; ++i) {
        test::LasFile las{.point_format = 0};
        las.records = {test::las_record(0, {.x = i})};
        paths.push_back(folder.file(std::to_string(i)));
        write(paths.back(), las.bytes());
    }
    EXPECT_EQ(test::points_of(*open_points(paths)).x, (std::vector<int32_t>{0, 1, 2, 3, 4}));
    paths.push_back(folder.file("none"));
    EXPECT_THROW(open_points(paths), Error);
    EXPECT_THROW(open_points({}), Error);
}

TEST(Format, AnOutputIsWhatItsEndingSays) {
    EXPECT_EQ(format_of_name("a/b.laz"), "laz");
    EXPECT_EQ(format_of_name("b.COPC.LAZ"), "copc");  // the longer of two that fit
    EXPECT_EQ(format_of_name("b.las"), "las");
    EXPECT_EQ(format_of_name("b.drc"), "drc");
    EXPECT_EQ(format_of_name("b.las/village"), "potree");
    EXPECT_EQ(format_of_name("village.v2"), "potree");
}

}  // namespace
}  // namespace strata
