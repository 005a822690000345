#include "core/voxel/brick_bins.h"

#include <bit>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/math/morton.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 1 << 14;  // triangles
constexpr int kFewBricks = 8;       // so many are taken as the box has them

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

void sort_by_code(std::vector<Entry>& entries, int bits) {
    std::vector<Entry> other(entries.size());
    const int passes = std::max(1, (bits + 11) / 12), digit_bits = (bits + passes - 1) / passes;
    for (int pass = 0; pass < passes && digit_bits > 0; ++pass) {
        const int shift = pass * digit_bits;
        const auto digit = [&](const Entry& e) {
            return size_t((uint64_t{e.high} << 32 | e.low) >> shift) & ((size_t{1} << digit_bits) - 1);
        };
        std::vector<size_t> place(size_t{1} << digit_bits);
        for (const Entry& e : entries) ++place[digit(e)];
        size_t sum = 0;
        for (size_t& p : place) sum += std::exchange(p, sum);
        for (const Entry& e : entries) other[place[digit(e)]++] = e;
        entries.swap(other);
    }
}

}  // namespace

BrickBins::BrickBins(const GridMesh& mesh, int threads, uint64_t memory_bytes) {
    const int32_t last = std::max(int32_t(mesh.frame().side() >> kBrickBits), 1) - 1;
    const CellRange all = {{0, 0, 0}, {last, last, last}};
    std::vector<size_t> offset((mesh.size() + kBlock - 1) / kBlock + 1);
    parallel_blocks(threads, mesh.size(), kBlock, [&](size_t begin, size_t end) {
        TriangleScanner scanner;
        size_t count = 0;
        for (size_t i = begin; i < end; ++i) visit_bricks(mesh, i, all, scanner, [&](uint64_t) { ++count; });
        offset[begin / kBlock + 1] = count;
    });
    for (size_t i = 1; i < offset.size(); ++i) offset[i] += offset[i - 1];
    const size_t count = offset.back();
    if (const uint64_t needed = 2 * count * sizeof(Entry); needed > memory_bytes)
        throw Error(ErrorKind::limit, "triangles by bricks take " + std::to_string((needed >> 20) + 1) + " MiB of memory, " +
                                          std::to_string(memory_bytes >> 20) + " MiB are left");
    std::vector<Entry> entries(count);
    parallel_blocks(threads, mesh.size(), kBlock, [&](size_t begin, size_t end) {
        TriangleScanner scanner;
        Entry* out = entries.data() + offset[begin / kBlock];
        for (size_t i = begin; i < end; ++i)
            visit_bricks(mesh, i, all, scanner, [&](uint64_t code) { *out++ = {uint32_t(code >> 32), uint32_t(code), uint32_t(i)}; });
    });
    sort_by_code(entries, 3 * std::bit_width(uint32_t(last)));
    triangles_.resize(count);
    for (size_t i = 0; i < count; ++i) {
        const uint64_t code = uint64_t{entries[i].high} << 32 | entries[i].low;
        if (bricks_.empty() || bricks_.back().code != code) bricks_.push_back({code, i, i});
        bricks_.back().end = i + 1;
        triangles_[i] = entries[i].triangle;
    }
}

}  // namespace strata
