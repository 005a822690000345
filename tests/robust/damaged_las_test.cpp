// Damaged LAS files, seeded: small files of every point format, mutated where it hurts.
#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "tests/robust/fault.h"
#include "tests/support/las_file.h"

namespace strata::robust {
namespace {

using Bytes = std::vector<std::byte>;
using test::LasFile;

constexpr int kFullCases = 4000;

class Mutator {
public:
    explicit Mutator(uint64_t seed) : random_(seed) {}

    Bytes damaged_file() {
        Bytes bytes = whole_file();
        for (uint64_t n = 1 + below(4); n > 0; --n) mutate(bytes);
        return bytes;
    }

private:
    uint64_t below(uint64_t n) { return random_() % n; }

    Bytes whole_file() {
        const int format = int(below(11));
        LasFile file{.minor_version = format < 6 ? int(below(5)) : 4, .point_format = format};
        if (below(2)) file.vlrs.push_back({"LASF_Spec", 4, test::extra_bytes_entry("height", 4, 9, {0.01})});
        if (below(2)) file.vlrs.push_back({"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"here\"]")});
        if (below(2)) {
            Bytes keys;
            for (const int word : {1, 1, 0, 2, 3072, 0, 1, 32767, 1026, 34737, 5, 0}) test::put(keys, uint16_t(word));
            file.vlrs.push_back({"LASF_Projection", 34735, keys});
            file.vlrs.push_back({"LASF_Projection", 34737, test::bytes_of("mine|")});
        }
        if (file.minor_version == 4 && below(2)) file.evlrs.push_back({"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"there\"]")});
        for (uint64_t i = 0, n = below(20); i < n; ++i) {
            file.records.push_back(test::las_record(format, {.x = int32_t(random_()), .y = int32_t(random_()), .z = int32_t(random_())}));
            test::put(file.records.back(), int16_t(i));
        }
        if (file.records.empty()) file.record_size = 100;
        return file.bytes();
    }

    void mutate(Bytes& bytes) {
        if (bytes.empty()) return;
        // Most bytes of most files are points, which have no wrong values: aim at what describes them.
        const size_t at = size_t(below(below(4) ? std::min<size_t>(bytes.size(), 700) : bytes.size()));
        const size_t left = bytes.size() - at;
        switch (below(8)) {
            case 0: bytes[at] ^= std::byte(1 << below(8)); break;
            case 1: bytes[at] = std::array{std::byte{0}, std::byte{0xFF}, std::byte{0x80}, std::byte{0x7F}}[below(4)]; break;
            case 2: put_number<uint16_t>(bytes, at); break;
            case 3: put_number<uint32_t>(bytes, at); break;
            case 4: put_number<uint64_t>(bytes, at); break;
            case 5:  // the numbers that place things: sizes, offsets, counts, scales
                put_number<uint32_t>(bytes, std::array<size_t, 8>{94, 96, 100, 105, 107, 235, 243, 247}[below(8)]);
                if (below(2)) put_double(bytes, 131 + 8 * size_t(below(12)));
                break;
            case 6: bytes.resize(at); break;
            case 7: {
                const size_t size = size_t(below(std::min<size_t>(left, 64)));
                const auto from = bytes.begin() + std::ptrdiff_t(at), to = from + std::ptrdiff_t(size);
                if (const Bytes piece(from, to); below(2))
                    bytes.insert(bytes.begin() + std::ptrdiff_t(below(bytes.size())), piece.begin(), piece.end());
                else
                    bytes.erase(from, to);
                break;
            }
        }
    }

    template <typename T>
    void put_number(Bytes& bytes, size_t at) {
        const T values[] = {0, 1, T(-1), T(T(-1) / 2), T(T(-1) / 2 + 1), T(bytes.size()), T(bytes.size() + 1), T(random_())};
        if (at + sizeof(T) <= bytes.size()) test::poke(bytes, at, values[below(8)]);
    }
    void put_double(Bytes& bytes, size_t at) {
        const double values[] = {0.0, -0.0, -1.0, 1e308, 5e-324, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()};
        if (at + sizeof(double) <= bytes.size()) test::poke(bytes, at, values[below(7)]);
    }

    std::mt19937_64 random_;
};

template <typename T>
T peek(const Bytes& bytes, size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

// How many points a file has that was accepted, by the specification alone; nothing when it should have been refused.
std::optional<uint64_t> points_of_file(const Bytes& bytes) {
    if (bytes.size() < 227) return {};
    const uint8_t minor = peek<uint8_t>(bytes, 25);
    if (minor >= 4 && bytes.size() < 375) return {};
    const uint64_t offset = peek<uint32_t>(bytes, 96), record = peek<uint16_t>(bytes, 105), legacy = peek<uint32_t>(bytes, 107);
    const uint64_t points64 = minor >= 4 ? peek<uint64_t>(bytes, 247) : 0, points = points64 ? points64 : legacy;
    constexpr uint16_t kLeastRecord[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    const uint8_t format = peek<uint8_t>(bytes, 104);
    if (minor > 4 || format > 10 || record < kLeastRecord[format] || offset > bytes.size()) return {};
    if (points > (bytes.size() - offset) / record) return {};
    for (size_t axis = 0; axis < 3; ++axis)
        if (const double scale = peek<double>(bytes, 131 + 8 * axis); !(scale > 0.0) || !(scale < 1e300)) return {};
    return points;
}

std::string verdict(const test::ProgramResult& result, const TemporaryFolder& folder) {
    std::ifstream file(folder.file("scan.las"), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    const std::string place = "strata: " + folder.file("scan.las") + ": ";
    if (result.exit_code != 0) return result.err.starts_with(place) ? "" : "the file is not named: " + result.err;
    const std::optional<uint64_t> points = points_of_file(test::bytes_of(text));
    const nlohmann::json report = nlohmann::json::parse(result.out, nullptr, false);
    if (!points) return "wrong-accept: " + result.out;
    if (report.is_discarded() || report["points"] != *points) return "wrong result: " + result.out;
    return "";
}

}  // namespace

std::vector<FaultCase> damaged_las(bool full) {
    std::vector<FaultCase> cases;
    for (int seed = 0; seed < (full ? kFullCases : kFullCases / 10); ++seed)
        cases.push_back({"seed " + std::to_string(seed),
                         [seed](const TemporaryFolder& folder) -> std::vector<std::string> {
                             const Bytes bytes = Mutator(uint64_t(seed)).damaged_file();
                             std::ofstream(folder.file("scan.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
                             return {"info", "--exact", "--json", "--threads", "2", folder.file("scan.las")};
                         },
                         verdict});
    return cases;
}

}  // namespace strata::robust
