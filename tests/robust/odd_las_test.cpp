// Legal but odd LAS files, and every real file there is: all are accepted, with exact counts and true bounds.
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/robust/fault.h"
#include "tests/support/las_file.h"

namespace strata::robust {
namespace {

using Bytes = std::vector<std::byte>;
using nlohmann::json;
using test::LasFile;

// Least and greatest corner of the points; empty for a cloud without points.
struct Expected {
    uint64_t points = 0;
    std::vector<double> min, max;
    double tolerance = 0.0;  // world units
};

std::string compare(const Expected& expected, const test::ProgramResult& result) {
    if (result.exit_code != 0) return "wrong-reject: " + result.err;
    const json report = json::parse(result.out, nullptr, false);
    if (report.is_discarded()) return "no JSON: " + result.out;
    if (report["points"] != expected.points) return "counts " + report["points"].dump();
    for (const auto& [key, corner] : {std::pair("min", &expected.min), std::pair("max", &expected.max)})
        for (size_t axis = 0; axis < corner->size(); ++axis) {
            const double found = report["bounds"][key][axis].get<double>();
            if (!(std::abs(found - (*corner)[axis]) <= expected.tolerance)) return std::string(key) + " is " + report["bounds"][key].dump();
        }
    return "";
}

FaultCase odd_case(std::string name, Bytes bytes, Expected expected) {
    return {std::move(name),
            [bytes](const TemporaryFolder& folder) -> std::vector<std::string> {
                std::ofstream(folder.file("odd.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
                return {"info", "--exact", "--json", "--threads", "2", folder.file("odd.las")};
            },
            [expected](const test::ProgramResult& result, const TemporaryFolder&) { return compare(expected, result); }};
}

// Two points, (1 2 3) and (4 5 6) in quanta of 1.
LasFile two_points(int format = 0, int minor = 2) {
    LasFile file{.minor_version = minor, .point_format = format, .scale = {1.0, 1.0, 1.0}};
    file.records = {test::las_record(format, {.x = 1, .y = 2, .z = 3}), test::las_record(format, {.x = 4, .y = 5, .z = 6})};
    return file;
}

void add_hand_made(std::vector<FaultCase>& cases) {
    const Expected two{2, {1, 2, 3}, {4, 5, 6}};
    const auto poked = [](LasFile file, auto change) {
        Bytes bytes = file.bytes();
        change(bytes);
        return bytes;
    };
    const auto padded = [](const LasFile& file, size_t count) {
        Bytes bytes = file.bytes();
        bytes.resize(bytes.size() + count, std::byte{0xAB});
        return bytes;
    };
    cases.push_back(odd_case("bytes behind the points", padded(two_points(), 1000), two));
    cases.push_back(odd_case("half a record behind the points", padded(two_points(), 10), two));
    cases.push_back(odd_case("bytes between header and points", poked(two_points(), [](Bytes& b) {
                                 b.insert(b.begin() + 227, 100, std::byte{0xDC});
                                 test::poke<uint32_t>(b, 96, 327);
                             }), two));
    cases.push_back(odd_case("a header larger than the version needs", poked(two_points(), [](Bytes& b) {
                                 b.insert(b.begin() + 227, 20, std::byte{0});
                                 test::poke<uint16_t>(b, 94, 247);
                                 test::poke<uint32_t>(b, 96, 247);
                             }), two));
    cases.push_back(odd_case("fewer points counted than the file holds", poked(two_points(), [](Bytes& b) { test::poke<uint32_t>(b, 107, 1); }),
                             {1, {1, 2, 3}, {1, 2, 3}}));
    cases.push_back(odd_case("64-bit count alone, format 1", poked(two_points(1, 4), [](Bytes& b) { test::poke<uint32_t>(b, 107, 0); }), two));
    cases.push_back(odd_case("legacy count alone, LAS 1.4", poked(two_points(1, 4), [](Bytes& b) { test::poke<uint64_t>(b, 247, 0); }), two));
    cases.push_back(odd_case("no points, zero bounds", LasFile{.point_format = 3, .record_size = 34}.bytes(), {0, {}, {}}));
    cases.push_back(odd_case("no points, LAS 1.4 format 6", LasFile{.minor_version = 4, .point_format = 6, .record_size = 30}.bytes(), {0, {}, {}}));
    cases.push_back(odd_case("bounds that are no numbers", poked(two_points(), [](Bytes& b) { for (size_t at = 179; at < 227; at += 8) test::poke(b, at, std::nan("")); }), two));
    cases.push_back(odd_case("bounds turned round", poked(two_points(), [](Bytes& b) { test::poke(b, 179, -9.0), test::poke(b, 187, 9.0); }), two));
    cases.push_back(odd_case("text fields without a NUL", poked(two_points(), [](Bytes& b) { std::fill(b.begin() + 26, b.begin() + 90, std::byte{'x'}); }), two));
    cases.push_back(odd_case("day 0 of year 0", poked(two_points(), [](Bytes& b) { test::poke<uint32_t>(b, 90, 0); }), two));
    LasFile ends = two_points();
    ends.records = {test::las_record(0, {.x = INT32_MIN, .y = INT32_MIN, .z = INT32_MIN}), test::las_record(0, {.x = INT32_MAX, .y = INT32_MAX, .z = INT32_MAX})};
    cases.push_back(odd_case("INT_MIN to INT_MAX", ends.bytes(), {2, {-0x1p31, -0x1p31, -0x1p31}, {0x1p31 - 1, 0x1p31 - 1, 0x1p31 - 1}}));
    LasFile many = two_points();
    for (int i = 0; i < 2000; ++i) many.vlrs.push_back({"empty", uint16_t(i), {}});
    cases.push_back(odd_case("2000 empty records", many.bytes(), two));
    LasFile strange = two_points();
    strange.vlrs = {{"other maker", 4, test::bytes_of("not extra bytes")}, {"LASF_Projection", 34735, {}}, {"LASF_Projection", 2112, {}},
                    {std::string("\xff\xfe\x01", 3), 65535, Bytes(65535)}};
    cases.push_back(odd_case("strange records", strange.bytes(), two));
    LasFile wide = two_points();
    for (Bytes& record : wide.records) record.resize(60000);
    cases.push_back(odd_case("records of 60000 bytes", wide.bytes(), two));
    for (int format = 0; format <= 10; ++format)
        cases.push_back(odd_case("point format " + std::to_string(format), two_points(format, format < 6 ? 2 : 4).bytes(), two));
}

void add_real(std::vector<FaultCase>& cases) {
    const char* const folder = std::getenv("STRATA_DATA");
    std::ifstream file(std::string(folder ? folder : "") + "/index.json");
    if (!folder || !file) return;
    for (const json& entry : json::parse(file)) {
        if (entry["format"] != "LAS") continue;
        const std::string path = std::string(folder) + "/" + entry["file"].get<std::string>();
        Expected expected{entry["points"], entry["min"], entry["max"]};
        const bool clipped = entry["note"].get<std::string>().find("header says") != std::string::npos;
        cases.push_back({path,
                         [path](const TemporaryFolder&) -> std::vector<std::string> { return {"info", "--exact", "--json", "--threads", "2", path}; },
                         [expected, clipped](const test::ProgramResult& result, const TemporaryFolder&) mutable -> std::string {
                             // More points counted than there are: the one file among them that is damaged.
                             if (clipped) return result.exit_code == 1 ? "" : "wrong-accept";
                             const json report = json::parse(result.out, nullptr, false);
                             if (!report.is_discarded())
                                 for (const json& scale : report["scale"]) expected.tolerance = std::max(expected.tolerance, scale.get<double>());
                             if (expected.points == 0) expected.min = expected.max = {};
                             return compare(expected, result);
                         }});
    }
}

}  // namespace

std::vector<FaultCase> odd_las(bool) {
    std::vector<FaultCase> cases;
    add_hand_made(cases);
    add_real(cases);
    return cases;
}

}  // namespace strata::robust
