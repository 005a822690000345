// Clouds of shapes that break converters: every point comes out, the set is valid. 10^5 points; 10^6 in a full run.
#include <algorithm>
#include <climits>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "io/format.h"
#include "tests/robust/fault.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"

namespace strata::robust {
namespace {

using Quanta = std::array<int32_t, 3>;

using RandomPoint = Quanta (*)(int i, int n, std::mt19937& random);

struct Shape {
    const char* name;
    /// Point i of n. `random` is seeded.
    RandomPoint point;
    int points = 0;  // 0: many
    const char* encoding = "default";
    std::vector<double> times = {};  // of the points in turn; empty: the format without GPS times
    double scale = 0.01;
    std::array<double, 3> offset = {};
};

int32_t between(std::mt19937& random, int32_t low, int32_t high) {
    return int32_t(low + int64_t(random() % (uint64_t(int64_t(high) - low) + 1)));
}

Quanta anywhere(int, int, std::mt19937& random) { return {between(random, 0, 99'999), between(random, 0, 99'999), between(random, 0, 999)}; }

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

const Shape kShapes[] = {
    {"equal points", [](int, int, std::mt19937&) { return Quanta{7, -7, 7}; }},
    {"equal points, brotli", [](int, int, std::mt19937&) { return Quanta{7, -7, 7}; }, 0, "brotli"},
    {"two places", [](int i, int, std::mt19937&) { return i % 2 ? Quanta{INT_MIN, INT_MIN, INT_MIN} : Quanta{INT_MAX, INT_MAX, INT_MAX}; }},
    {"a dense spot in a box of 10^9",
     [](int i, int, std::mt19937& random) {
         if (i < 2) return i ? Quanta{500'000'000, 500'000'000, 500'000'000} : Quanta{-500'000'000, -500'000'000, -500'000'000};
         return Quanta{between(random, 0, 20), between(random, 0, 20), between(random, 0, 20)};
     }},
    {"an outlier", [](int i, int, std::mt19937& random) { return i ? Quanta{between(random, 0, 9999), between(random, 0, 9999), 0} : Quanta{1'000'000'000, 0, 0}; }},
    {"no points", [](int, int, std::mt19937&) { return Quanta{}; }, -1},
    {"no points, brotli", [](int, int, std::mt19937&) { return Quanta{}; }, -1, "brotli"},
    {"one point", [](int, int, std::mt19937&) { return Quanta{INT_MAX, INT_MIN, 0}; }, 1},
    {"two points", [](int i, int, std::mt19937&) { return Quanta{i, 0, 0}; }, 2},
    {"a line", [](int i, int, std::mt19937&) { return Quanta{i, 0, 0}; }},
    {"a diagonal", [](int i, int n, std::mt19937&) { const auto at = int32_t(int64_t(UINT_MAX) * i / (n - 1) + INT_MIN); return Quanta{at, at, at}; }},
    {"a plane", [](int i, int, std::mt19937&) { return Quanta{i % 317, i / 317, 5}; }},
    {"all there is", [](int, int, std::mt19937& random) { return Quanta{int32_t(random()), int32_t(random()), int32_t(random())}; }},
    // Neighbours in space, as far apart as can be in Morton order.
    {"both sides of the middle", [](int i, int, std::mt19937& random) { return Quanta{i & 1 ? 0 : -1, i & 2 ? 0 : -1, between(random, INT_MIN, INT_MAX)}; }},
    {"a lattice", [](int i, int, std::mt19937&) { return Quanta{i % 47, i / 47 % 47, i / 2209}; }},
    {"each half as far", [](int i, int, std::mt19937&) { return Quanta{INT_MAX >> (i % 31), INT_MAX >> (i / 31 % 31), INT_MAX >> (i / 961 % 31)}; }},
    {"no GPS time is a number", anywhere, 1000, "default", {kNaN}},
    {"GPS times of every kind", anywhere, 0, "default", {kNaN, 0.0, -0.0, kInfinity, -kInfinity, -kNaN, 1e308, 5e-324}},
    {"GPS times of minus zero", anywhere, 1000, "default", {-0.0}},
    {"earth-centred, to 0.1 mm", [](int, int, std::mt19937& random) { return Quanta{between(random, 0, 10'000'000), between(random, 0, 10'000'000), between(random, -1'000'000, 1'000'000)}; }, 0, "default", {}, 0.0001, {4.0e6, -3.2e6, 3.8e6}},
};

int point_count(const Shape& shape, bool full) { return shape.points < 0 ? 0 : shape.points > 0 ? shape.points : full ? 1'000'000 : 100'000; }

void write_scan(const Shape& shape, bool full, const std::string& path) {
    std::mt19937 random(1);
    const int format = shape.times.empty() ? 0 : 1;
    test::LasFile file{.point_format = format, .scale = {shape.scale, shape.scale, shape.scale}, .offset = shape.offset, .record_size = uint16_t(format == 0 ? 20 : 28)};
    Quanta least{INT_MAX, INT_MAX, INT_MAX}, most{INT_MIN, INT_MIN, INT_MIN};
    for (int i = 0, n = point_count(shape, full); i < n; ++i) {
        const Quanta at = shape.point(i, n, random);
        for (size_t axis = 0; axis < 3; ++axis) {
            least[axis] = std::min(least[axis], at[axis]);
            most[axis] = std::max(most[axis], at[axis]);
        }
        file.records.push_back(test::las_record(format, {.x = at[0], .y = at[1], .z = at[2], .gps_time = format == 0 ? 0.0 : shape.times[size_t(i) % shape.times.size()]}));
    }
    for (size_t axis = 0; axis < 3 && !file.records.empty(); ++axis) {
        file.min[axis] = shape.scale * least[axis] + shape.offset[axis];
        file.max[axis] = shape.scale * most[axis] + shape.offset[axis];
    }
    const std::vector<std::byte> bytes = file.bytes();
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

std::string verdict(const std::string& out, int points, const test::ProgramResult& result, const TemporaryFolder& folder) {
    if (result.exit_code != 0) return "wrong-reject: " + result.err;
    const nlohmann::json report = nlohmann::json::parse(result.out, nullptr, false);
    if (report.is_discarded() || report["points_written"] != points || report["points_dropped"] != 0) return "wrong result: " + result.out;
    const test::ProgramResult info = test::run_strata({"info", "--exact", "--json", folder.file(out)});
    if (info.exit_code != 0) return "not valid: " + info.err;
    const nlohmann::json found = nlohmann::json::parse(info.out, nullptr, false);
    if (found.is_discarded() || found["points"] != points || found["valid"] != true) return "wrong result: " + info.out;
    if (found["levels"] > 33) return "deeper than 32 bits: " + info.out;
    const test::ProgramResult drawn = test::run_strata({"render", folder.file(out), "-o", folder.file("a.png"), "--size", "64x64", "--edl", "0", "--quiet"});
    if (points > 0 && drawn.exit_code != 0) return "no picture: " + drawn.err;
    return drawn.exit_code == 0 || drawn.exit_code == 1 ? "" : "no clear answer: " + drawn.err;
}

// Every point as its integers and the bits of its time, in an order of their own.
std::vector<std::array<uint64_t, 4>> sorted_points(const std::string& path) {
    const std::unique_ptr<PointSource> source = open_points(std::span(&path, 1));
    const PointBatch points = test::points_of(*source);
    const int time = find_attribute(source->info().attributes, attribute_name::kGpsTime);
    std::vector<std::array<uint64_t, 4>> all(points.size);
    for (size_t i = 0; i < all.size(); ++i) {
        all[i] = {uint32_t(points.x[i]), uint32_t(points.y[i]), uint32_t(points.z[i]), 0};
        if (time >= 0) std::memcpy(&all[i][3], points.columns[size_t(time)].data() + 8 * i, 8);
    }
    std::sort(all.begin(), all.end());
    return all;
}

// The points of the octree are those of the scan, and those of a LAZ file made of it. Coordinates over more than 31 bits lost
// their last: then as many points come, each within its node, but not their integers.
std::string copc_verdict(int points, const test::ProgramResult& result, const TemporaryFolder& folder) {
    if (const std::string first = verdict("out.copc.laz", points, result, folder); !first.empty()) return first;
    const test::ProgramResult back = test::run_strata({"convert", folder.file("out.copc.laz"), folder.file("back.laz"), "--quiet", "--no-sync"});
    if (back.exit_code != 0) return "not read back: " + back.err;
    const std::vector<std::array<uint64_t, 4>> set = sorted_points(folder.file("out.copc.laz"));
    if (set.size() != size_t(points)) return "not all points";
    if (set != sorted_points(folder.file("back.laz"))) return "the LAZ file has other points than the set";
    const bool exact = nlohmann::json::parse(result.out)["worst_rounding"] == 0.0;
    return exact && set != sorted_points(folder.file("scan.las")) ? "other points than the scan's" : "";
}

}  // namespace

std::vector<FaultCase> adversarial_clouds(bool full) {
    std::vector<FaultCase> cases;
    for (const Shape& shape : kShapes) {
        const int points = point_count(shape, full);
        const auto prepare = [&shape, full](const std::string& out) {
            return [&shape, full, out](const TemporaryFolder& folder) -> std::vector<std::string> {
                write_scan(shape, full, folder.file("scan.las"));
                std::vector<std::string> words = {"convert", folder.file("scan.las"), folder.file(out), "--json", "--no-sync"};
                if (out == "out") words.insert(words.end(), {"--encoding", shape.encoding});
                return words;
            };
        };
        cases.push_back({shape.name, prepare("out"), [points](const auto& result, const auto& folder) { return verdict("out", points, result, folder); }});
        if (shape.encoding != std::string("default")) continue;
        cases.push_back({std::string(shape.name) + ", COPC", prepare("out.copc.laz"),
                         [points](const auto& result, const auto& folder) { return copc_verdict(points, result, folder); }});
    }
    return cases;
}

}  // namespace strata::robust
