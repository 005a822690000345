#include "core/surface/brick_cell_counter.h"

#include <algorithm>
#include <bit>
#include <mutex>
#include <utility>

#include "core/parallel.h"
#include "core/simd_target.h"
#include "core/surface/brick_view.h"
#include "core/surface/cell_cases.h"

namespace strata {
namespace {

using namespace brick_word;

constexpr int kSide = kFieldBrickSide;
constexpr size_t kBlock = 32;  // bricks that a thread takes at a time

std::vector<BrickPlace> united(const std::vector<BrickPlace>& a, const std::vector<BrickPlace>& b) {
    std::vector<BrickPlace> all;
    all.reserve(a.size() + b.size());
    std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all), comes_before);
    return all;
}
std::vector<BrickPlace> all_moved(std::vector<BrickPlace> corners, int32_t bricks_i, int32_t bricks_j) {
    for (BrickPlace& corner : corners) corner = moved(corner, bricks_i, bricks_j);
    return corners;
}

// Most neighbors have the value of the one before; there may be many values.
int32_t constant_of(BrickCells& cells, float value) {
    if (cells.constants.empty() || std::bit_cast<uint32_t>(cells.constants.back()) != std::bit_cast<uint32_t>(value))
        cells.constants.push_back(value);
    return -int32_t(cells.constants.size());
}

struct Ambiguous {
    uint64_t cells = 0, tunnels = 0;
};

struct Job {
    BrickCells& cells;
    const MaskedLayers& layers;
    const BrickLevels& levels;
    const std::vector<double>& isovalues;

    void count(size_t isovalue, size_t brick, Ambiguous& found) const {
        BrickPart& part = cells.parts[isovalue * cells.bricks() + brick];
        std::array<uint64_t, 4> low = cells.corners_of(layers, levels, isovalue, brick, 0);
        int64_t triangles = 0;
        std::optional<BrickView> view;
        for (int k = 0; k < kSide; ++k) {
            const std::array<uint64_t, 4> high = cells.corners_of(layers, levels, isovalue, brick, k + 1);
            const std::array<uint64_t, 8> corner = corner_words(low, high);
            for (size_t axis = 0; axis < 3; ++axis) part.crossed[axis][size_t(k)] = corner[0] ^ corner[size_t(1) << axis];
            const uint64_t whole = cells.whole_cells(brick, size_t(k));
            if (const uint64_t active = active_cells(corner) & whole; active != 0) {
                // As many triangles as crossings, less two for each loop of them; a plain cell has one.
                for (const CellEdge& edge : kCellEdge) triangles += std::popcount((corner[edge.lower] ^ corner[edge.upper]) & whole);
                triangles -= 2 * std::popcount(active);
                for (uint64_t left = undecided_cells(corner) & whole; left != 0; left &= left - 1) {
                    const auto bit = unsigned(std::countr_zero(left));
                    const unsigned cell_case = case_of_cell(corner, bit);
                    if (!view) view.emplace(cells, layers, brick);
                    const CellDecision decision = CellCases::get().decide(
                        cell_case, view->cell(isovalues[isovalue], levels.below, bit & 7, bit >> 3, unsigned(k)));
                    triangles += decision.patch->triangles + 2 - std::popcount(kCrossedEdges[cell_case]);
                    part.inner += decision.patch->inner;
                    ++found.cells;
                    found.tunnels += decision.tunnel;
                }
            }
            low = high;
        }
        part.triangles = uint32_t(triangles);
    }
};

// Compiled for each instruction set.
STRATA_KERNEL_BASELINE void count_baseline(const Job& job, size_t isovalue, size_t brick, Ambiguous& found) {
    job.count(isovalue, brick, found);
}
STRATA_KERNEL_AVX2 void count_avx2(const Job& job, size_t isovalue, size_t brick, Ambiguous& found) {
    job.count(isovalue, brick, found);
}
STRATA_KERNEL_AVX512 void count_avx512(const Job& job, size_t isovalue, size_t brick, Ambiguous& found) {
    job.count(isovalue, brick, found);
}

}  // namespace

std::optional<BrickCells> BrickCellCounter::count(int32_t k, const MaskedLayers& layers, const BrickCells* below) {
    if (layers[0] == nullptr && layers[1] == nullptr) return std::nullopt;
    BrickCells cells = std::exchange(spare_, {});
    cells.k = k;
    cells.corners.clear();
    cells.constants.clear();
    cells.whole.clear();
    cells.parts.clear();
    for (const MaskedLayer* layer : layers)
        if (layer != nullptr) cells.corners = united(cells.corners, layer->layer.corners);
    cells.corners = united(cells.corners, all_moved(cells.corners, -1, 0));
    cells.corners = united(cells.corners, all_moved(cells.corners, 0, -1));
    const size_t bricks = cells.bricks();
    make_room_(bricks * (sizeof cells.corners[0] + 2 * sizeof(AroundBrick) + levels_.isovalues * sizeof(BrickPart) +
                         (settings_.open_at_nan ? sizeof cells.whole[0] + sizeof(AroundBrick) : 0)),
               true);
    const auto corners_of_layer = [&](size_t n) { return layers[n] != nullptr ? &layers[n]->layer.corners : nullptr; };
    find_around(cells.corners, {corners_of_layer(0), corners_of_layer(1)}, 1, settings_.threads, cells.samples);
    for (size_t b = 0; b < bricks; ++b)
        for (size_t n = 0; n < 8; ++n) {
            if (cells.samples[b][n] >= 0) continue;
            const BrickPlace corner = moved(cells.corners[b], int32_t(n & 1), int32_t(n >> 1 & 1));
            cells.samples[b][n] = constant_of(cells, source_.absent_value({corner[0], corner[1], k + (n < 4 ? 0 : kSide)}));
        }
    if (settings_.open_at_nan) find_whole(cells, layers, below);
    cells.parts.resize(levels_.isovalues * bricks);
    std::mutex mutex;
    const auto count = simd_level_ == SimdLevel::avx512 ? count_avx512 : simd_level_ == SimdLevel::avx2 ? count_avx2 : count_baseline;
    const Job job = {cells, layers, levels_, settings_.isovalues};
    parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
        Ambiguous found;
        bool is_open = false;
        for (size_t s = 0; s < levels_.isovalues; ++s)
            for (size_t b = begin; b < end; ++b) {
                count(job, s, b, found);
                if (!cells.whole.empty()) is_open |= leave_out_unused(cells, below, s, b);
            }
        const std::lock_guard lock(mutex);
        ambiguous_ += found.cells;
        tunnels_ += found.tunnels;
        is_open_ |= is_open;
    });
    return cells;
}

// Which cells have no NaN sample, and where those are that lie before them.
void BrickCellCounter::find_whole(BrickCells& cells, const MaskedLayers& layers, const BrickCells* below) {
    const size_t number = levels_.isovalues;  // the level that every number reaches
    cells.whole.resize(cells.bricks());
    parallel_blocks(settings_.threads, cells.bricks(), kBlock, [&](size_t begin, size_t end) {
        const auto all = [](const std::array<uint64_t, 4>& words) { return words[0] & words[1] & words[2] & words[3]; };
        for (size_t b = begin; b < end; ++b) {
            uint64_t low = all(cells.corners_of(layers, levels_, number, b, 0));
            for (int k = 0; k < kSide; ++k) {
                const uint64_t high = all(cells.corners_of(layers, levels_, number, b, k + 1));
                cells.whole[b][size_t(k)] = low & high;
                low = high;
            }
        }
    });
    find_around(cells.corners, {&cells.corners, below != nullptr ? &below->corners : nullptr}, -1, settings_.threads, before_);
}

// Takes the vertices away that no cell has: all four around their edge have a NaN sample. Returns whether the surface is open at an edge,
// which some of the four have.
bool BrickCellCounter::leave_out_unused(BrickCells& cells, const BrickCells* below, size_t isovalue, size_t brick) const {
    BrickPart& part = cells.parts[isovalue * cells.bricks() + brick];
    const AroundBrick& before = before_[brick];
    uint64_t open = 0;
    for (size_t k = 0; k < kSide; ++k) {
        std::array<uint64_t, 8> whole;  // the cells at - (n & 1, n >> 1 & 1, n >> 2)
        for (size_t lower = 0; lower < 2; ++lower) {
            std::array<uint64_t, 4> planes;
            for (size_t n = 0; n < 4; ++n) {
                const bool is_below = lower > k;
                const int32_t there = before[n + (is_below ? 4 : 0)];
                planes[n] = there < 0 ? 0 : (is_below ? *below : cells).whole[size_t(there)][(k - lower) % kSide];
            }
            const uint64_t back = back_along_j(planes[0], planes[2]), back_last = back_along_j(planes[1], planes[3]);
            whole[4 * lower] = planes[0];
            whole[4 * lower + 1] = back_along_i(planes[0], planes[1]);
            whole[4 * lower + 2] = back;
            whole[4 * lower + 3] = back_along_i(back, back_last);
        }
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t u = size_t(1) << (axis + 1) % 3, v = size_t(1) << (axis + 2) % 3;
            uint64_t& crossed = part.crossed[axis][k];
            crossed &= whole[0] | whole[u] | whole[v] | whole[u + v];
            open |= crossed & ~(whole[0] & whole[u] & whole[v] & whole[u + v]);
        }
    }
    return open != 0;
}

}  // namespace strata
