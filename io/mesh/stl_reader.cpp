// STL, binary and ASCII. Source: "StereoLithography Interface Specification", 3D Systems, 1989, as M. Burns, "Automated
// Fabrication", section 6.5, has it. The normals of facets follow from their corners and are not kept, nor is the attribute word.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "io/mesh/mesh_memory.h"
#include "io/mesh/mesh_reader.h"
#include "io/text_words.h"

namespace strata {
namespace {

constexpr size_t kHeader = 84, kFacet = 50;

uint32_t count_of(const void* head) {
    uint32_t count;
    std::memcpy(&count, static_cast<const char*>(head) + 80, sizeof count);
    return count;
}

// Corners at equal places are one vertex.
class DistinctPositions {
public:
    DistinctPositions(MeshMemory& memory, std::vector<Vec3d>& positions) : memory_(memory), positions_(positions) { grow(1024); }

    uint32_t index_of(const Vec3d& corner) {
        const Vec3d position = corner.array() + 0.0;  // -0 is 0
        const uint64_t hash = hash_of(position);
        for (size_t slot = size_t(hash >> shift_);; slot = (slot + 1) & (slots_.size() - 1)) {
            if (slots_[slot] == kFree) {
                const uint32_t index = uint32_t(positions_.size());
                memory_.push(positions_, position);
                slots_[slot] = index;
                if (positions_.size() * 2 > slots_.size()) grow(slots_.size() * 2);
                return index;
            }
            if (positions_[slots_[slot]] == position) return slots_[slot];
        }
    }

private:
    static constexpr uint32_t kFree = 0xFFFFFFFF;

    static uint64_t hash_of(const Vec3d& position) {
        uint64_t hash = 0;
        for (const double part : position) hash = std::rotl((hash ^ std::bit_cast<uint64_t>(part)) * 0x9E3779B97F4A7C15u, 29);
        hash = (hash ^ hash >> 32) * 0xD6E8FEB86659FD93u;
        return hash ^ hash << 32;
    }

    void grow(size_t count) {
        std::vector<uint32_t> wider;
        memory_.lengthen(wider, count, kFree);
        shift_ = 64 - std::countr_zero(count);
        for (uint32_t index = 0; index < positions_.size(); ++index) {
            size_t slot = size_t(hash_of(positions_[index]) >> shift_);
            while (wider[slot] != kFree) slot = (slot + 1) & (count - 1);
            wider[slot] = index;
        }
        memory_.release(slots_);
        slots_ = std::move(wider);
    }

    MeshMemory& memory_;
    std::vector<Vec3d>& positions_;
    std::vector<uint32_t> slots_;  // indices of positions; a power of two, at most half of them taken
    int shift_ = 0;
};

class StlReader {
public:
    StlReader(const ByteSource& source, uint64_t most_bytes) : source_(source), stream_(source), memory_(stream_, most_bytes), vertices_(memory_, mesh_.positions) {}

    TriangleMesh read(MeshReport& report) {
        std::array<char, 1024> bytes;
        const size_t size = size_t(std::min<uint64_t>(bytes.size(), source_.size()));
        source_.read(0, std::as_writable_bytes(std::span(bytes).first(size)));
        const std::string_view head(bytes.data(), size);
        // Headers of binary files begin with 'solid' as well, so the size comes first.
        const bool is_text = !is_binary_stl(head, source_.size()) && is(TextWords(head).word(), "solid") && head.find('\0') == std::string_view::npos;
        report.format = is_text ? "STL, ASCII" : "STL, binary";
        if (is_text)
            read_text();
        else
            read_binary();
        report.faces = facets_;
        if (nowhere_ > 0) report.notes.push_back(std::to_string(nowhere_) + " triangles without a finite position at each corner are left out");
        return std::move(mesh_);
    }

private:
    void add(const std::array<Vec3d, 3>& corners) {
        ++facets_;
        if (!corners[0].allFinite() || !corners[1].allFinite() || !corners[2].allFinite()) {
            ++nowhere_;
            return;
        }
        // Each has three corners, all of which may be distinct.
        if (mesh_.triangles.size() == 0xFFFFFFFF || mesh_.positions.size() > 0xFFFFFFFF - 4)
            throw Error(ErrorKind::limit, stream_.name() + ": at most 4,294,967,291 vertices and triangles can be read");
        memory_.push(mesh_.triangles, {vertices_.index_of(corners[0]), vertices_.index_of(corners[1]), vertices_.index_of(corners[2])});
    }

    void read_binary() {
        const uint64_t count = count_of(stream_.take(kHeader).data());
        const uint64_t bytes = count * kFacet, left = stream_.left();
        const std::string counted = "the header counts " + std::to_string(count) + " triangles, which are " + std::to_string(bytes) + " bytes; ";
        // A few bytes behind the last are padding; as many as a triangle has are triangles that the header does not count.
        if (bytes > left || left - bytes >= kFacet) stream_.fail_at_byte(counted + std::to_string(left) + " are left");
        memory_.reserve(mesh_.triangles, count);
        for (uint64_t i = 0; i < count; ++i) {
            const std::byte* const facet = stream_.take(kFacet).data();
            std::array<Vec3d, 3> corners;
            for (size_t k = 0; k < 3; ++k) {
                std::array<float, 3> parts;
                std::memcpy(parts.data(), facet + 12 + 12 * k, sizeof parts);
                corners[k] = Vec3d(parts[0], parts[1], parts[2]);
            }
            add(corners);
        }
    }

    // Words count, not lines.
    void read_text() {
        next_line();
        words_.word();  // solid; the rest of the line is its name
        words_ = TextWords(std::string_view());
        for (bool in_solid = true;;) {
            const std::string_view word = next_word(in_solid);
            if (word.empty()) return;
            if (in_solid && is(word, "endsolid")) {
                words_ = TextWords(std::string_view());
                in_solid = false;
            } else if (!in_solid && is(word, "solid")) {
                words_ = TextWords(std::string_view());
                in_solid = true;
            } else if (in_solid && is(word, "facet")) {
                read_facet();
            } else {
                stream_.fail_at_line(in_solid ? "'facet' or 'endsolid' is expected" : "'solid' is expected, or the file's end");
            }
        }
    }
    void read_facet() {
        expect("normal");
        read_vector();
        expect("outer");
        expect("loop");
        std::array<Vec3d, 3> corners;
        for (Vec3d& corner : corners) {
            expect("vertex");
            corner = read_vector();
        }
        expect("endloop");
        expect("endfacet");
        add(corners);
    }
    Vec3d read_vector() {
        Vec3d vector;
        for (double& part : vector) {
            if (!words_.more()) next_word_is_near();
            if (!words_.number(part)) stream_.fail_at_line("a number is expected");
        }
        return vector;
    }
    void expect(std::string_view wanted) {
        if (!is(next_word(true), wanted)) stream_.fail_at_line("'" + std::string(wanted) + "' is expected");
    }
    // Programs write 'facet', 'FACET' and 'Facet'.
    static bool is(std::string_view word, std::string_view wanted) {
        return std::equal(word.begin(), word.end(), wanted.begin(), wanted.end(),
                          [](char a, char b) { return (a >= 'A' && a <= 'Z' ? char(a + ('a' - 'A')) : a) == b; });
    }

    bool next_line() {
        std::string_view line;
        if (!stream_.next_line(line)) return false;
        words_ = TextWords(line);
        return true;
    }
    void next_word_is_near() {
        while (!words_.more())
            if (!next_line()) stream_.fail_at_line("the file ends within a solid, 'endsolid' is expected");
    }
    // Empty: the file is at its end, which `needed` makes an error.
    std::string_view next_word(bool needed) {
        if (needed) next_word_is_near();
        while (!words_.more())
            if (!next_line()) return {};
        return words_.word();
    }

    const ByteSource& source_;
    ByteStream stream_;
    MeshMemory memory_;
    TriangleMesh mesh_;
    DistinctPositions vertices_;
    TextWords words_{std::string_view()};
    uint64_t facets_ = 0, nowhere_ = 0;
};

}  // namespace

bool is_binary_stl(std::string_view head, uint64_t size) { return head.size() >= kHeader && size == kHeader + kFacet * uint64_t{count_of(head.data())}; }

TriangleMesh read_stl(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report) { return StlReader(source, settings.most_bytes).read(report); }

}  // namespace strata
