// Real files of many makers against facts that were computed from every decoded record by other means.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "io/crs/crs_text.h"
#include "io/format.h"
#include "io/las/laz_source.h"

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
        const std::string kind = entry["format"];
        if (kind != "LAS" && kind != "LAZ" && kind != "COPC") continue;
        const std::string path = data->folder + "/" + entry["file"].get<std::string>();
        SCOPED_TRACE(path);
        ++files;
        ASSERT_EQ(identify_format(path).name, kind == "LAS" ? "las" : kind == "LAZ" ? "laz" : "copc");
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
        const std::string container = kind == "LAS" ? "las " : kind == "LAZ" ? "laz " : "copc 1.0, laz ";
        EXPECT_EQ(info.format, container + version + ", point format " + format);
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
    EXPECT_GE(files, 48u);
}

// FNV-1a of all records as LASzip 3.5.1 decompresses them.
constexpr std::pair<const char*, uint64_t> kRecordHashes[] = {
    {"laz/1_4_w_evlr.laz", 0x7434F969BDDEF559},
    {"laz/append-bug.laz", 0x3F7150BFB85F3A9B},
    {"laz/autzen_trim.laz", 0x77FFEA0676AB2716},
    {"laz/eb.laz", 0x3827D74E5DCE6E78},
    {"laz/example_data.laz", 0xB9A90AA8825297EB},
    {"laz/extrabytes.laz", 0x2779802FD6672310},
    {"laz/laszip-generated_with2bytespadding.laz", 0xAC5CEED2077B659C},
    {"laz/no-points-1.3.laz", 0xCBF29CE484222325},
    {"laz/plane.laz", 0x7CAB9FBEF8FEF539},
    {"laz/point-color-time.las.laz", 0x0360CEED3D71A2C2},
    {"laz/point-color.las.laz", 0x26383F83EF8721F5},
    {"laz/point-time-1.4.las.laz", 0x1732189C0D3744DF},
    {"laz/point-time.las.laz", 0x1732189C0D3744DF},
    {"laz/point10.las.laz", 0xE4A447F17ABA6024},
    {"laz/simple-laszip-compressor-version-1.2r0.laz", 0xAC5CEED2077B659C},
    {"laz/simple.laz", 0xAC5CEED2077B659C},
    {"copc/1.2-with-color.copc.laz", 0x2B9C1BE162ECBE35},
    {"copc/lion_takanawa.copc.laz", 0x3F86B578D5A6EB0F},
};

TEST(LasData, CompressedRecordsAreThoseOfTheReferenceDecoder) {
    const auto data = find_data();
    if (!data) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    for (const auto& [file, expected] : kRecordHashes) {
        const LazSource source(open_file(data->folder + "/" + file));
        uint64_t hash = 14695981039346656037u;
        for (uint64_t i = 0; i < source.batch_count(); ++i)
            for (const std::byte byte : source.read_records(i)) hash = (hash ^ uint64_t(byte)) * 1099511628211u;
        EXPECT_EQ(hash, expected) << file;
    }
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
    // Heights in feet, by a datum's number and a unit: "4_6_crop", New Mexico at 7,100 feet.
    EXPECT_TRUE(same_crs(crs_of("4_6_crop.las"), "EPSG:2903+6360")) << crs_of("4_6_crop.las");
    // Eastings around 2,050,000 are feet, though the code is that of meters.
    EXPECT_NE(crs_of("mvk-thin.las").find("UNIT[\"US survey foot\",0.3048006"), std::string::npos) << crs_of("mvk-thin.las");
    // A projection in parameters alone: the zone CC45 of the French network.
    const auto plane = describe_crs(crs_of("../laz/plane.laz"));
    ASSERT_TRUE(plane);
    EXPECT_EQ(plane->unit, "metre");
    EXPECT_NE(crs_of("../laz/plane.laz").find("PARAMETER[\"standard_parallel_2\",45.75],PARAMETER[\"false_easting\",1700000]"), std::string::npos);
}

TEST(LasData, FormatsThatAreNotReadableAreToldApart) {
    const auto data = find_data();
    if (!data) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    const std::map<std::string, std::string> names = {{"E57", "e57"}, {"PCD", "pcd"}};
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
    EXPECT_GE(files, 16u);
}

}  // namespace
}  // namespace strata
