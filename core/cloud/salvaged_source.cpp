#include "core/cloud/salvaged_source.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kMostNotes = 10;  // of batches; the rest is counted

}  // namespace

SalvagedSource::SalvagedSource(std::unique_ptr<PointSource> source, uint64_t stated_points, int threads)
    : source_(std::move(source)), stated_points_(stated_points), info_(source_->info()) {
    const size_t batches = size_t(source_->batch_count());
    std::vector<uint64_t> points(batches, 0);
    std::vector<std::string> faults(batches);
    std::vector<int> all(info_.attributes.size());
    std::iota(all.begin(), all.end(), 0);
    parallel_blocks(threads, batches, 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t index = begin; index < end; ++index) {
            try {
                source_->read_batch(index, all, batch);
                points[index] = batch.size;
            } catch (const Error& error) {
                if (error.kind != ErrorKind::malformed && error.kind != ErrorKind::io) throw;
                faults[index] = error.what();
            }
        }
    });
    info_.points = std::accumulate(points.begin(), points.end(), uint64_t{0});
    size_t damaged = 0;
    for (size_t index = 0; index < batches; ++index) {
        if (faults[index].empty()) {
            sound_.push_back(index);
        } else if (++damaged <= kMostNotes) {
            info_.notes.push_back("left out: " + faults[index]);
        }
    }
    if (damaged > kMostNotes) info_.notes.push_back("left out: " + std::to_string(damaged - kMostNotes) + " more damaged parts");
}

}  // namespace strata
