// Clouds of shapes that break converters: every point comes out, the set is valid. 10^5 points; 10^6 in a full run.
#include <climits>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/robust/fault.h"
#include "tests/support/las_file.h"

namespace strata::robust {
namespace {

using Quanta = std::array<int32_t, 3>;

struct Shape {
    const char* name;
    /// Point i of n. `random` is seeded.
    Quanta (*point)(int i, int n, std::mt19937& random);
    int points = 0;  // 0: many
    const char* encoding = "default";
};

int32_t between(std::mt19937& random, int32_t low, int32_t high) {
    return int32_t(low + int64_t(random() % (uint64_t(int64_t(high) - low) + 1)));
}

constexpr Shape kShapes[] = {
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
};

int point_count(const Shape& shape, bool full) { return shape.points < 0 ? 0 : shape.points > 0 ? shape.points : full ? 1'000'000 : 100'000; }

std::vector<std::string> prepare(const Shape& shape, bool full, const TemporaryFolder& folder) {
    std::mt19937 random(1);
    test::LasFile file{.record_size = 20};
    Quanta least{INT_MAX, INT_MAX, INT_MAX}, most{INT_MIN, INT_MIN, INT_MIN};
    for (int i = 0, n = point_count(shape, full); i < n; ++i) {
        const Quanta at = shape.point(i, n, random);
        for (size_t axis = 0; axis < 3; ++axis) {
            least[axis] = std::min(least[axis], at[axis]);
            most[axis] = std::max(most[axis], at[axis]);
        }
        file.records.push_back(test::las_record(0, {.x = at[0], .y = at[1], .z = at[2]}));
    }
    for (size_t axis = 0; axis < 3 && !file.records.empty(); ++axis) {
        file.min[axis] = 0.01 * least[axis];
        file.max[axis] = 0.01 * most[axis];
    }
    const std::vector<std::byte> bytes = file.bytes();
    std::ofstream(folder.file("scan.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    return {"convert", folder.file("scan.las"), folder.file("out"), "--json", "--no-sync", "--encoding", shape.encoding};
}

std::string verdict(int points, const test::ProgramResult& result, const TemporaryFolder& folder) {
    if (result.exit_code != 0) return "wrong-reject: " + result.err;
    const nlohmann::json report = nlohmann::json::parse(result.out, nullptr, false);
    if (report.is_discarded() || report["points_written"] != points || report["points_dropped"] != 0) return "wrong result: " + result.out;
    const test::ProgramResult info = test::run_strata({"info", "--exact", "--json", folder.file("out")});
    if (info.exit_code != 0) return "not valid: " + info.err;
    const nlohmann::json found = nlohmann::json::parse(info.out, nullptr, false);
    if (found.is_discarded() || found["points"] != points || found["valid"] != true) return "wrong result: " + info.out;
    if (found["levels"] > 33) return "deeper than 32 bits: " + info.out;
    const test::ProgramResult drawn = test::run_strata({"render", folder.file("out"), "-o", folder.file("a.png"), "--size", "64x64", "--edl", "0", "--quiet"});
    if (points > 0 && drawn.exit_code != 0) return "no picture: " + drawn.err;
    return drawn.exit_code == 0 || drawn.exit_code == 1 ? "" : "no clear answer: " + drawn.err;
}

}  // namespace

std::vector<FaultCase> adversarial_clouds(bool full) {
    std::vector<FaultCase> cases;
    for (const Shape& shape : kShapes)
        cases.push_back({shape.name, [&shape, full](const TemporaryFolder& folder) { return prepare(shape, full, folder); },
                         [&shape, full](const test::ProgramResult& result, const TemporaryFolder& folder) {
                             return verdict(point_count(shape, full), result, folder);
                         }});
    return cases;
}

}  // namespace strata::robust
