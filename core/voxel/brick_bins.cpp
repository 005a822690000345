#include "core/voxel/brick_bins.h"

#include <atomic>
#include <bit>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/math/morton.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 1 << 14;  // triangles
constexpr size_t kShares = 16;
constexpr int kMostDigitBits = 12;
constexpr int kFewBricks = 8;  // so many are taken as the box has them

struct Entry {
    uint32_t high, low;  // code
    uint32_t triangle;
};

// Calls visit(code) for the bricks that triangle i touches; for a small one also some that only its box touches.
template <class Visit>
void visit_bricks(const GridMesh& mesh, size_t i, const CellRange& all, TriangleScanner& scanner, Visit&& visit) {
    if (!mesh.is_near(i)) return;
    const GridTriangle t = mesh[i];
    const int c = mesh.bits() + kBrickBits;
    const CellRange range = touched_cells(t, c).clipped(all);
    if (range.empty()) return;
    uint64_t count = 1;
    for (size_t a = 0; a < 3; ++a) count *= uint64_t(range.last[a] - range.first[a] + 1);
    const auto at = [&](int32_t x, int32_t y, int32_t z) { visit(octant_code(uint32_t(x), uint32_t(y), uint32_t(z))); };
    if (count <= kFewBricks) {
        for (int32_t x = range.first[0]; x <= range.last[0]; ++x)
            for (int32_t y = range.first[1]; y <= range.last[1]; ++y)
                for (int32_t z = range.first[2]; z <= range.last[2]; ++z) at(x, y, z);
        return;
    }
    scanner.scan_touched(t, c, all, [&](int w, int32_t u, int32_t v, int32_t first, int32_t last) {
        std::array<int32_t, 3> p;
        p[size_t(w + 1) % 3] = u;
        p[size_t(w + 2) % 3] = v;
        for (p[size_t(w)] = first; p[size_t(w)] <= last; ++p[size_t(w)]) at(p[0], p[1], p[2]);
    });
}

// Sorts by a digit of the code, keeping the order of equal ones.
void sort_by_digit(const std::vector<std::span<const Entry>>& from, Entry* to, int shift, int bits, int threads) {
    const auto digit = [&](const Entry& e) { return size_t((uint64_t{e.high} << 32 | e.low) >> shift) & ((size_t{1} << bits) - 1); };
    const size_t digits = size_t{1} << bits;
    std::vector<std::vector<size_t>> counts(from.size());
    parallel_blocks(threads, from.size(), 1, [&](size_t i, size_t) {
        counts[i].resize(digits);
        for (const Entry& e : from[i]) ++counts[i][digit(e)];
    });
    size_t sum = 0;
    for (size_t d = 0; d < digits; ++d)
        for (std::vector<size_t>& count : counts) sum += std::exchange(count[d], sum);
    parallel_blocks(threads, from.size(), 1, [&](size_t i, size_t) {
        for (const Entry& e : from[i]) to[counts[i][digit(e)]++] = e;
    });
}

}  // namespace

BrickBins::BrickBins(const GridMesh& mesh, int threads, uint64_t memory_bytes) {
    const int32_t last = std::max(int32_t(mesh.frame().side() >> kBrickBits), 1) - 1;
    const CellRange all = {{0, 0, 0}, {last, last, last}};
    // A few shares of the triangles, so that the sort has few counts to keep.
    const size_t share = std::max(kBlock, (mesh.size() + kShares - 1) / kShares), shares = (mesh.size() + share - 1) / share;
    std::vector<std::vector<Entry>> found(shares);
    std::atomic<uint64_t> count = 0;
    const uint64_t most = memory_bytes / (2 * sizeof(Entry));
    parallel_blocks(threads, mesh.size(), share, [&](size_t begin, size_t end) {
        TriangleScanner scanner;
        std::vector<Entry>& entries = found[begin / share];
        entries.reserve(std::min<uint64_t>((end - begin) * 5 / 4, most / shares));
        for (size_t block = begin; block < end; block += kBlock) {
            size_t told = entries.size();
            uint64_t more = 0;  // counted only, so that the message can say how many there are
            bool full = count > most;
            for (size_t i = block; i < std::min(end, block + kBlock); ++i)
                visit_bricks(mesh, i, all, scanner, [&](uint64_t code) {
                    if (full) {
                        ++more;
                        return;
                    }
                    entries.push_back({uint32_t(code >> 32), uint32_t(code), uint32_t(i)});
                    if (entries.size() - told < kBlock) return;
                    count += entries.size() - told;  // one triangle may touch millions of bricks
                    told = entries.size();
                    full = count > most;
                });
            count += entries.size() - told + more;
        }
    });
    if (count > most)
        throw Error(ErrorKind::limit, "triangles by bricks take " + std::to_string((2 * count * sizeof(Entry) >> 20) + 1) +
                                          " MiB of memory, " + std::to_string(memory_bytes >> 20) + " MiB are left");
    std::vector<Entry> entries(count), other;
    const int bits = 3 * std::bit_width(uint32_t(last)), passes = std::max(1, (bits + kMostDigitBits - 1) / kMostDigitBits);
    const int digit_bits = (bits + passes - 1) / passes;
    std::vector<std::span<const Entry>> from(found.begin(), found.end());
    for (int pass = 0; pass < passes; ++pass) {
        sort_by_digit(from, entries.data(), pass * digit_bits, digit_bits, threads);
        if (pass + 1 == passes) break;
        found.clear();
        other.resize(count);
        entries.swap(other);
        from.clear();
        const size_t part = (count + kShares - 1) / kShares;
        for (size_t begin = 0; begin < count; begin += part)
            from.push_back(std::span<const Entry>(other).subspan(begin, std::min(part, count - begin)));
    }
    found.clear();
    other = {};
    triangles_.resize(count);
    for (size_t i = 0; i < count; ++i) {
        const uint64_t code = uint64_t{entries[i].high} << 32 | entries[i].low;
        if (bricks_.empty() || bricks_.back().code != code) {
            if (!bricks_.empty()) bricks_.back().end = i;
            bricks_.push_back({code, i, count});
        }
        triangles_[i] = entries[i].triangle;
    }
}

}  // namespace strata
