// Damaged Potree folders: seeded mutations of the three files of small sets, and lies put together with care.
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/robust/fault.h"
#include "tests/support/memory_source.h"
#include "tests/support/potree_files.h"

namespace strata::robust {
namespace {

using test::PotreeFiles;

constexpr int kFullCases = 2000;
constexpr size_t kRecordBytes = 22;

/// Three levels, two hierarchy chunks, 24 points a node.
PotreeFiles whole_set(bool brotli) {
    test::PotreeSet set{.brotli = brotli, .step = 1};
    for (const char* name : {"r", "r0", "r07", "r3", "r35"}) {
        std::array<int32_t, 3> low{};
        int32_t side = 128'000;  // quanta
        for (const char* digit = name + 1; *digit; ++digit) {
            side /= 2;
            for (int axis = 0; axis < 3; ++axis) low[size_t(axis)] += (*digit - '0') >> (2 - axis) & 1 ? side : 0;
        }
        for (int i = 0; i < 24; ++i)
            set.nodes[name].push_back({.quanta = {low[0] + i * 7, low[1] + i * 11, low[2] + i * 13}, .intensity = uint16_t(i), .rgb = {1, 2, 3}, .gps_time = double(i)});
    }
    return test::make_potree(set);
}

using Answer = std::function<std::string(const test::ProgramResult&, const TemporaryFolder&)>;

// A folder that was accepted must hold what its own files state; what it states is checked by the program itself, so this
// asks for no more than the sum.
std::string damaged_verdict(const test::ProgramResult& result, const TemporaryFolder& folder) {
    if (result.exit_code != 0)
        return result.err.find(folder.path()) != std::string::npos ? "" : "the folder is not named: " + result.err;
    if (std::filesystem::exists(folder.file("a.png"))) return "";
    const nlohmann::json report = nlohmann::json::parse(result.out, nullptr, false);
    if (report.is_discarded() || report["valid"] != true) return "wrong-accept: " + result.out;
    uint64_t points = 0;
    for (const nlohmann::json& level : report["points_per_level"]) points += level.get<uint64_t>();
    return report["points"] == points ? "" : "wrong result: " + result.out;
}

// That a lie is refused, and what is said of it.
Answer refused(std::string reason) {
    return [reason](const test::ProgramResult& result, const TemporaryFolder& folder) -> std::string {
        if (result.exit_code == 0) return "wrong-accept: " + result.out;
        if (result.err.find(folder.path()) == std::string::npos) return "the folder is not named: " + result.err;
        return result.err.find(reason) != std::string::npos ? "" : "not because of '" + reason + "': " + result.err;
    };
}

std::vector<std::string> info_words(const TemporaryFolder& folder) {
    return {"info", "--exact", "--json", "--threads", "2", folder.file("set")};
}
std::vector<std::string> render_words(const TemporaryFolder& folder) {
    return {"render", folder.file("set"), "-o", folder.file("a.png"), "--size", "64x64", "--edl", "0", "--quiet", "--threads", "2"};
}

void write_set(const TemporaryFolder& folder, const PotreeFiles& files) {
    std::filesystem::create_directory(folder.file("set"));
    test::write_potree_files(files, folder.file("set"));
}

class Mutator {
public:
    explicit Mutator(uint64_t seed) : random_(seed) {}

    PotreeFiles damaged_set() {
        PotreeFiles files = whole_set(below(2));
        for (uint64_t n = 1 + below(3); n > 0; --n) {
            switch (below(4)) {
                case 0: mutate_text(files.metadata); break;
                case 1:
                case 2: mutate_hierarchy(files.hierarchy); break;
                case 3: mutate_bytes(files.octree); break;
            }
        }
        return files;
    }

private:
    uint64_t below(uint64_t n) { return random_() % n; }
    uint64_t number(uint64_t near) {
        const uint64_t values[] = {0, 1, 2, near, near + 1, near - 1, 0x7fffffff, 0xffffffff, uint64_t(-1), uint64_t(1) << 63, random_()};
        return values[below(std::size(values))];
    }

    void mutate_bytes(std::vector<std::byte>& bytes) {
        if (bytes.empty()) return;
        const size_t at = size_t(below(bytes.size()));
        switch (below(4)) {
            case 0: bytes[at] ^= std::byte(1 << below(8)); break;
            case 1: bytes[at] = std::byte(random_()); break;
            case 2: bytes.resize(at); break;
            case 3: bytes.insert(bytes.begin() + std::ptrdiff_t(at), std::byte(random_())); break;
        }
    }

    void mutate_hierarchy(std::vector<std::byte>& bytes) {
        if (bytes.size() < kRecordBytes || below(4) == 0) return mutate_bytes(bytes);
        std::byte* const record = bytes.data() + kRecordBytes * size_t(below(bytes.size() / kRecordBytes));
        const uint64_t value = number(bytes.size());
        switch (below(5)) {
            case 0: record[0] = std::byte(below(4)); break;
            case 1: record[1] = std::byte(random_()); break;
            case 2: std::memcpy(record + 2, &value, 4); break;
            case 3: std::memcpy(record + 6, &value, 8); break;
            case 4: std::memcpy(record + 14, &value, 8); break;
        }
    }

    void mutate_text(std::string& text) {
        if (text.empty()) return;
        const size_t at = size_t(below(text.size()));
        switch (below(4)) {
            case 0: text[at] = char(random_()); break;
            case 1: text.resize(at); break;
            case 2: text.erase(at, size_t(below(20))); break;
            case 3: {  // another number
                const size_t first = text.find_first_of("0123456789", at);
                if (first == std::string::npos) break;
                const size_t last = text.find_first_not_of("0123456789.", first);
                constexpr std::array kNumbers = {"0", "-1", "1e308", "1e-308", "4294967296", "18446744073709551616", "null", "\"1\"", "[]", "1e999"};
                text.replace(first, last == std::string::npos ? last : last - first, kNumbers[size_t(below(kNumbers.size()))]);
                break;
            }
        }
    }

    std::mt19937_64 random_;
};

void replace(std::string& text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    if (at == std::string::npos) throw std::runtime_error(from + " is not in metadata.json");
    text.replace(at, from.size(), to);
}

template <typename T>
void poke_record(PotreeFiles& files, size_t record, size_t at, T value) {
    std::memcpy(files.hierarchy.data() + kRecordBytes * record + at, &value, sizeof value);
}

/// A stream of zeros, `size` bytes when decoded: some hundred bytes stored.
std::vector<std::byte> bomb(size_t size) { return test::potree_detail::compressed(std::vector<std::byte>(size)); }

struct Lie {
    const char* name;
    std::function<void(PotreeFiles&)> tell;
    const char* reason;
    bool brotli = false;
};

// Records of whole_set: chunk 0 is r, r0, r3 (proxies); their chunks follow: r0, r07 and r3, r35.
const Lie kLies[] = {
    {"a proxy that names its own chunk", [](PotreeFiles& f) { poke_record<uint64_t>(f, 1, 6, 0); }, "part of another"},
    {"a chunk within a chunk that leads back", [](PotreeFiles& f) { poke_record<uint64_t>(f, 2, 6, 3 * kRecordBytes); }, "part of another"},
    {"a chunk that begins with a proxy", [](PotreeFiles& f) { poke_record<uint8_t>(f, 3, 0, 2); }, "begins with a proxy"},
    {"2^32 - 1 points in a node", [](PotreeFiles& f) { poke_record<uint32_t>(f, 0, 2, uint32_t(-1)); }, "bytes expected"},
    {"2^63 bytes in a node", [](PotreeFiles& f) { poke_record<uint64_t>(f, 0, 14, uint64_t(1) << 63); }, "lie beyond"},
    {"an offset that wraps around", [](PotreeFiles& f) { poke_record<uint64_t>(f, 0, 6, uint64_t(-16)); }, "lie beyond"},
    {"two nodes with the same bytes", [](PotreeFiles& f) { poke_record<uint64_t>(f, 4, 6, 0); }, "overlap"},
    {"a mask that names more children than there are", [](PotreeFiles& f) { poke_record<uint8_t>(f, 0, 1, 0xff); }, "more children than records"},
    {"more points in metadata.json than in the nodes", [](PotreeFiles& f) { replace(f.metadata, "\"points\": 120", "\"points\": 121"); }, "121"},
    {"fewer points in metadata.json than in the nodes", [](PotreeFiles& f) { replace(f.metadata, "\"points\": 120", "\"points\": 119"); }, "119"},
    {"a first chunk of 2^40 bytes", [](PotreeFiles& f) { replace(f.metadata, "\"firstChunkSize\": 66", "\"firstChunkSize\": 1099511627776"); }, "beyond"},
    {"JSON nested a million deep", [](PotreeFiles& f) { f.metadata = std::string(1'000'000, '['); }, "metadata.json"},
    {"an encoding that is a path", [](PotreeFiles& f) { replace(f.metadata, "DEFAULT", "../../etc/passwd"); }, "DEFAULT or BROTLI is expected"},
    {"an empty hierarchy", [](PotreeFiles& f) { f.hierarchy.clear(); }, "hierarchy.bin"},
    {"no points' bytes", [](PotreeFiles& f) { f.octree.clear(); }, "octree.bin"},
    {"an empty metadata.json", [](PotreeFiles& f) { f.metadata.clear(); }, "metadata.json"},
    {"a stream of 64 MiB in a node of 24 points",
     [](PotreeFiles& f) {
         f.octree = bomb(size_t{1} << 26);
         poke_record<uint64_t>(f, 0, 6, 0);
         poke_record<uint64_t>(f, 0, 14, f.octree.size());
     },
     "", true},
    {"10^9 points in a node of a few bytes",
     [](PotreeFiles& f) {
         replace(f.metadata, "\"points\": 120", "\"points\": 4294967295");
         poke_record<uint32_t>(f, 0, 2, 1'000'000'000);
     },
     "", true},
};

struct Missing {
    const char* file;
    bool a_folder;  // of that name is there instead
};
constexpr Missing kMissing[] = {{"metadata.json", false}, {"hierarchy.bin", false}, {"octree.bin", false}, {"hierarchy.bin", true}, {"octree.bin", true}};

}  // namespace

std::vector<FaultCase> damaged_potree(bool full) {
    std::vector<FaultCase> cases;
    for (int seed = 0; seed < (full ? kFullCases : kFullCases / 10); ++seed)
        cases.push_back({"seed " + std::to_string(seed),
                         [seed](const TemporaryFolder& folder) {
                             write_set(folder, Mutator(uint64_t(seed)).damaged_set());
                             // Drawing takes longer than reading: every fourth.
                             return seed % 4 == 0 ? render_words(folder) : info_words(folder);
                         },
                         damaged_verdict});
    return cases;
}

std::vector<FaultCase> lying_potree(bool) {
    std::vector<FaultCase> cases;
    for (const Lie& lie : kLies)
        for (const bool drawn : {false, true}) {
            const auto prepare = [&lie, drawn](const TemporaryFolder& folder) {
                PotreeFiles files = whole_set(lie.brotli);
                lie.tell(files);
                write_set(folder, files);
                return drawn ? render_words(folder) : info_words(folder);
            };
            // A picture needs no more of the hierarchy than it shows, so some lies do not matter to it.
            const Answer answer = drawn ? Answer([](const test::ProgramResult&, const TemporaryFolder&) { return std::string(); }) : refused(lie.reason);
            cases.push_back({lie.name + std::string(drawn ? ", drawn" : ""), prepare, answer});
        }
    for (const Missing& missing : kMissing)
        cases.push_back({std::string(missing.a_folder ? "a folder instead of " : "without ") + missing.file,
                         [&missing](const TemporaryFolder& folder) {
                             write_set(folder, whole_set(false));
                             std::filesystem::remove(folder.file("set/") + missing.file);
                             if (missing.a_folder) std::filesystem::create_directory(folder.file("set/") + missing.file);
                             return info_words(folder);
                         },
                         refused(missing.file)});
    cases.push_back({"an empty folder",
                     [](const TemporaryFolder& folder) {
                         std::filesystem::create_directory(folder.file("set"));
                         return info_words(folder);
                     },
                     refused("a folder without data")});
    return cases;
}

}  // namespace strata::robust
