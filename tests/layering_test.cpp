// Holds every include to the direction core <- io <- render <- app, and each package behind its few files.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 4> kLayers = {"core", "io", "render",
                                                     "app"};  // each may include those before it

/// A header that only these files may include: a path from the root that begins like one of `homes` and ends in .cpp.
struct PackageRule {
    std::string_view header;  // how the include begins
    std::vector<std::string_view> homes;
};

const std::vector<PackageRule> kPackages = {
    {"CLI/", {"app/options.cpp"}},
    {"tbb/", {"core/parallel.cpp", "io/vdb/vdb_writer.cpp"}},  // OpenVDB's threads are TBB's
    {"oneapi/", {"core/parallel.cpp"}},
    {"nlohmann/", {"io/", "app/"}},
    {"brotli/", {"io/"}},
    {"png.h", {"io/png/"}},
    {"draco/", {"io/draco/draco_decoder.cpp", "io/draco/draco_encoder.cpp"}},
    {"proj", {"io/crs/"}},
    {"geotiff/", {"io/crs/"}},
    {"blosc.h", {"io/vdb/vdb_tree.cpp"}},
    {"openvdb/", {"io/vdb/vdb_writer.cpp"}},
    {"nanovdb/", {}},  // benchmarks compare with it
    {"flann/", {}},  // tests judge by it
    {"tiny_gltf", {}},  // likewise
    {"epoxy/", {"render/"}},
    {"EGL/", {"render/gl/"}},
    {"GL/", {}},  // libepoxy is the one way to GL
    {"GLES", {}},
    {"iostream", {"app/"}},  // its static initializer goes into every file that includes it
};

// Numbers in, numbers out: core opens no file and prints nothing.
constexpr std::array<std::string_view, 5> kNotInCore = {"fstream", "iostream", "filesystem", "fcntl.h", "sys/stat.h"};

int layer_of(const std::string& path) {
    const auto found = std::find(kLayers.begin(), kLayers.end(), path.substr(0, path.find('/')));
    return found == kLayers.end() ? -1 : int(found - kLayers.begin());
}

/// What is wrong with `path` (from the root) including `header`; empty: nothing.
std::string fault_of(const std::string& path, const std::string& header, bool quoted) {
    if (quoted) {
        if (layer_of(header) < 0) return "does not start at the root";
        if (layer_of(header) > layer_of(path)) return "points against core <- io <- render <- app";
        return {};
    }
    if (layer_of(path) == 0 && std::find(kNotInCore.begin(), kNotInCore.end(), header) != kNotInCore.end())
        return "core opens no files and prints nothing";
    if (header == "nlohmann/json_fwd.hpp") return {};  // declares two names, made for headers
    for (const PackageRule& rule : kPackages) {
        if (!header.starts_with(rule.header)) continue;
        const bool at_home = path.ends_with(".cpp") && std::any_of(rule.homes.begin(), rule.homes.end(),
                                                                   [&](auto home) { return path.starts_with(home); });
        if (!at_home) return "stays behind a few .cpp files";
    }
    return {};
}

std::vector<std::string> faults_in(const std::string& path, std::istream& source) {
    static const std::regex include(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"].*)");
    std::vector<std::string> faults;
    std::smatch match;
    int number = 0;
    for (std::string line; std::getline(source, line);) {
        ++number;
        if (!std::regex_match(line, match, include)) continue;
        const std::string fault = fault_of(path, match[2], match[1] == "\"");
        if (!fault.empty()) faults.push_back(path + ":" + std::to_string(number) + ": " + match[2].str() + " " + fault);
    }
    return faults;
}

std::string faults_of_line(const std::string& path, const std::string& line) {
    std::istringstream source(line);
    const std::vector<std::string> faults = faults_in(path, source);
    return faults.empty() ? "" : faults.front();
}

TEST(Layering, EveryIncludePointsAlongTheArrow) {
    const fs::path root = STRATA_SOURCE_DIR;
    size_t files = 0;
    for (const std::string_view layer : kLayers) {
        for (const auto& entry : fs::recursive_directory_iterator(root / layer)) {
            if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
            ++files;
            std::ifstream source(entry.path());
            for (const std::string& fault : faults_in(fs::relative(entry.path(), root).generic_string(), source))
                ADD_FAILURE() << fault;
        }
    }
    EXPECT_GT(files, 20u);  // the folders were found
}

// Planted faults: the test above can fail.
TEST(Layering, FindsAnIncludeAgainstTheArrow) {
    EXPECT_EQ(faults_of_line("core/math/box.h", "#include \"io/byte_source.h\""),
              "core/math/box.h:1: io/byte_source.h points against core <- io <- render <- app");
    EXPECT_NE(faults_of_line("core/math/box.cpp", "  #  include \"app/options.h\"  // why"), "");
    EXPECT_NE(faults_of_line("io/las/las_reader.cpp", "#include \"render/image.h\""), "");
    EXPECT_NE(faults_of_line("render/renderer.h", "#include \"app/options.h\""), "");
    EXPECT_NE(faults_of_line("io/las/las_reader.cpp", "#include \"las_header.h\""), "");
    EXPECT_NE(faults_of_line("app/main.cpp", "#include \"tests/support/scratch_folder.h\""), "");
}

TEST(Layering, FindsAPackageOutsideItsFiles) {
    EXPECT_NE(faults_of_line("app/commands/convert.cpp", "#include <CLI/CLI.hpp>"), "");
    EXPECT_NE(faults_of_line("io/potree/metadata.h", "#include <nlohmann/json.hpp>"), "");
    EXPECT_NE(faults_of_line("io/las/las_crs.cpp", "#include <proj.h>"), "");
    EXPECT_NE(faults_of_line("io/crs/crs_text.h", "#include <geotiff/geo_normalize.h>"), "");
    EXPECT_NE(faults_of_line("render/image.h", "#include <epoxy/gl.h>"), "");
    EXPECT_NE(faults_of_line("render/gl/texture.cpp", "#include <GL/gl.h>"), "");
    EXPECT_NE(faults_of_line("core/octree/octree_builder.cpp", "#include <fstream>"), "");
}

TEST(Layering, AllowsWhatTheArrowAllows) {
    EXPECT_EQ(faults_of_line("app/commands/convert.cpp", "#include \"core/error.h\""), "");
    EXPECT_EQ(faults_of_line("io/byte_source.h", "#include \"io/format.h\""), "");
    EXPECT_EQ(faults_of_line("app/options.cpp", "#include <CLI/CLI.hpp>"), "");
    EXPECT_EQ(faults_of_line("core/parallel.cpp", "#include <tbb/parallel_for.h>"), "");
    EXPECT_EQ(faults_of_line("core/error.h", "// #include \"io/byte_source.h\""), "");
}

}  // namespace
