#include "core/cloud/preview_source.h"

#include <algorithm>
#include <numeric>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {

PreviewSource::PreviewSource(const PointSource& source, uint64_t points, int threads) : info_(source.info()) {
    if (points == 0) throw Error(ErrorKind::usage, "a preview of one point at least is possible");
    const uint64_t count = source.batch_count(), step = std::max<uint64_t>(1, count / points);
    batches_.resize(size_t(count / step + (count % step != 0)));
    const uint64_t most = batches_.empty() ? 0 : std::max<uint64_t>(1, points / batches_.size());
    std::vector<int> all(info_.attributes.size());
    std::iota(all.begin(), all.end(), 0);
    parallel_blocks(threads, batches_.size(), 1, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) source.read_first(i * step, most, all, batches_[i]);
    });
    info_.points = 0;
    info_.bounds = {};
    for (const PointBatch& batch : batches_) {
        info_.points += batch.size;
        for (size_t i = 0; i < batch.size; ++i)
            info_.bounds.extend(info_.quantization.world_from_quanta(Vec3i(batch.x[i], batch.y[i], batch.z[i])));
    }
}

void PreviewSource::read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const {
    const PointBatch& batch = batches_[size_t(index)];
    resize_batch(out, batch.size, info_.attributes, wanted);
    out.x = batch.x;
    out.y = batch.y;
    out.z = batch.z;
    for (const int attribute : wanted) out.columns[size_t(attribute)] = batch.columns[size_t(attribute)];
}

}  // namespace strata
