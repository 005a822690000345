// Real files of many makers against facts that were computed from every decoded record by other means.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "io/format.h"

namespace strata {
namespace {

using nlohmann::json;

struct Data {
    std::string folder;
    json index;
};

std::optional<Data> find_data() {
    const char* const folder = std::getenv("STRATA_DATA");
    if (!folder) return std::nullopt;
    std::ifstream file(std::string(folder) + "/index.json");
    if (!file) return std::nullopt;
    return Data{folder, json::parse(file)};
}

// "extra[a,b]" lists the names of extra bytes.
std::set<std::string> expected_names(const json& entry) {
    static const std::map<std::string, std::vector<std::string>> kNames = {
        {"intensity", {"intensity"}}, {"returns", {"return number", "number of returns"}}, {"classification", {"classification"}},
        {"gps", {"gps-time"}}, {"rgb", {"rgb"}}, {"nir", {"nir"}}};
    std::set<std::string> names;
    for (const std::string word : entry["attributes"]) {
        if (const auto found = kNames.find(word); found != kNames.end()) names.insert(found->second.begin(), found->second.end());
        if (!word.starts_with("extra[")) continue;
        std::stringstream list(word.substr(6, word.size() - 7));
        for (std::string name; std::getline(list, name, ',');) names.insert(name);
    }
    return names;
}

TEST(LasData, EveryFileIsWhatTheIndexSays) {
    const auto data = find_data();
    if (!data) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    size_t files = 0;
    for (const json& entry : data->index) {
        if (entry["format"] != "LAS") continue;
        const std::string path = data->folder + "/" + entry["file"].get<std::string>();
        SCOPED_TRACE(path);
        ++files;
        ASSERT_EQ(identify_format(path).name, "las");
        if (path.ends_with("clipped.las")) {  // its header counts one point more than there are
            EXPECT_THROW(open_points({&path, 1}), Error);
            continue;
        }
        const auto source = open_points({&path, 1});
        const CloudInfo& info = source->info();
        const CloudStatistics found = measure_cloud(*source, 2);
        EXPECT_EQ(found.points, entry["points"].get<uint64_t>());
        EXPECT_EQ(info.points, found.points);
        // "1.2 pf 3, record 34" against "las 1.2, point format 3"
        const std::string detail = entry["detail"];
        const std::string version = detail.substr(0, 3), format = detail.substr(7, detail.find(',') - 7);
        EXPECT_EQ(info.format, "las " + version + ", point format " + format);
        for (int axis = 0; axis < 3 && found.points > 0; ++axis) {
            EXPECT_NEAR(found.bounds.min[axis], entry["min"][size_t(axis)].get<double>(), info.quantization.scale[axis]);
            EXPECT_NEAR(found.bounds.max[axis], entry["max"][size_t(axis)].get<double>(), info.quantization.scale[axis]);
        }
        for (const std::string& name : expected_names(entry)) EXPECT_GE(find_attribute(info.attributes, name), 0) << name;
        for (const char* const optional : {"gps-time", "rgb", "nir"})
            EXPECT_EQ(find_attribute(info.attributes, optional) >= 0, expected_names(entry).contains(optional)) << optional;
        const std::string note = entry["note"];
        if (note.find("WKT") != std::string::npos) {
            EXPECT_TRUE(info.crs.empty() || info.crs.find('[') != std::string::npos || info.crs.starts_with("EPSG:") || info.crs.size() <= 3)
                << info.crs;
        }
        if (note.empty()) {
            EXPECT_EQ(info.crs, "");
        }
    }
    EXPECT_GE(files, 30u);
}

// Read from the files by eye.
TEST(LasData, ReferenceSystems) {
    const auto data = find_data();
    if (!data) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    const auto crs_of = [&](const char* file) {
        const std::string path = data->folder + "/las/" + file;
        return open_points({&path, 1})->info().crs;
    };
    EXPECT_EQ(crs_of("epsg_4326.las"), "EPSG:4326");
    EXPECT_EQ(crs_of("1.2-with-color.las"), "");
    EXPECT_TRUE(crs_of("test1_4.las").starts_with("PROJCS[\"NAD83(HARN) / New Mexico Central (ftUS)"));
    EXPECT_TRUE(crs_of("autzen_trim_7.las").starts_with("PROJCS["));
}

TEST(LasData, FormatsThatAreNotReadableAreToldApart) {
    const auto data = find_data();
    if (!data) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    const std::map<std::string, std::string> names = {{"LAZ", "laz"}, {"COPC", "copc"}, {"E57", "e57"}, {"PCD", "pcd"}};
    size_t files = 0;
    for (const json& entry : data->index) {
        const auto expected = names.find(entry["format"]);
        if (expected == names.end()) continue;
        const std::string path = data->folder + "/" + entry["file"].get<std::string>();
        SCOPED_TRACE(path);
        EXPECT_EQ(identify_format(path).name, expected->second);
        EXPECT_EQ(identify_format(path).kind, FormatKind::not_readable);
        EXPECT_THROW(open_points({&path, 1}), Error);
        ++files;
    }
    EXPECT_GE(files, 20u);
}

}  // namespace
}  // namespace strata
