#include "core/cloud/point_rounds.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/parallel.h"

namespace strata {

void read_in_rounds(const PointSource& source, int threads, uint64_t round_points,
                    const std::function<void(std::span<const PointBatch>)>& take) {
    const uint64_t batches = source.batch_count();
    if (batches == 0) return;
    const uint64_t batch_points = std::max<uint64_t>(source.info().points / batches, 1);
    std::vector<PointBatch> round(size_t(std::clamp<uint64_t>(round_points / batch_points, 1, batches)));
    std::vector<int> all(source.info().attributes.size());
    std::iota(all.begin(), all.end(), 0);
    for (uint64_t first = 0; first < batches; first += round.size()) {
        const std::span<PointBatch> filled = std::span(round).first(size_t(std::min<uint64_t>(round.size(), batches - first)));
        parallel_blocks(threads, filled.size(), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) source.read_batch(first + i, all, filled[i]);
        });
        take(filled);
    }
}

uint64_t points_of_round(int threads, uint64_t memory_bytes, uint64_t point_bytes) {
    // Rounds wait for their slowest batch, so each thread gets several: a batch of LAS and LAZ has 50,000 to 65,536 points.
    constexpr uint64_t kPointsOfThread = 4 * 65'536;
    return std::min(uint64_t(std::max(threads, 1)) * kPointsOfThread, memory_bytes / std::max<uint64_t>(point_bytes, 1));
}

}  // namespace strata
