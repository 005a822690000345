#include "core/cloud/selected_source.h"

#include <algorithm>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

struct Extent {
    Vec3i low = Vec3i::Constant(INT32_MAX), high = Vec3i::Constant(INT32_MIN);

    void extend(const PointBatch& batch, std::span<const uint8_t> passes) {
        for (size_t i = 0; i < batch.size; ++i) {
            if (passes[i] == 0) continue;
            const Vec3i p(batch.x[i], batch.y[i], batch.z[i]);
            low = low.cwiseMin(p);
            high = high.cwiseMax(p);
        }
    }
};

// Rows whose flag is set move to the front. returns how many
template <typename T>
void keep_rows(std::vector<T>& values, size_t row_values, std::span<const uint8_t> kept, size_t count) {
    if (values.empty()) return;
    size_t to = 0;
    for (size_t i = 0; i < kept.size(); ++i)
        if (kept[i] != 0) std::copy_n(values.begin() + std::ptrdiff_t(i * row_values), row_values, values.begin() + std::ptrdiff_t(to++ * row_values));
    values.resize(count * row_values);
}

}  // namespace

SelectedSource::SelectedSource(std::unique_ptr<PointSource> source, PointSelection selection, int threads)
    : source_(std::move(source)), selection_(std::move(selection)), region_(selection_.clips, source_->info().quantization), info_(source_->info()) {
    if (selection_.every == 0) throw Error(ErrorKind::usage, "every point, every second, and so on are possible: not every 0th");
    first_.resize(size_t(source_->batch_count()) + 1);
    Extent extent;
    std::mutex mutex;
    parallel_blocks(threads, size_t(source_->batch_count()), 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t index = begin; index < end; ++index) {
            source_->read_batch(index, selection_.filter.wanted(), batch);
            const std::vector<uint8_t> passes = passes_of(batch);
            first_[index + 1] = uint64_t(std::count(passes.begin(), passes.end(), uint8_t{1}));
            Extent own;
            own.extend(batch, passes);
            const std::lock_guard lock(mutex);
            extent.low = extent.low.cwiseMin(own.low);
            extent.high = extent.high.cwiseMax(own.high);
        }
    });
    for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
    info_.points = (first_.back() + selection_.every - 1) / selection_.every;
    info_.bounds = {};
    if (info_.points == 0) return;
    info_.bounds.extend(info_.quantization.world_from_quanta(extent.low));
    info_.bounds.extend(info_.quantization.world_from_quanta(extent.high));
}

std::vector<uint8_t> SelectedSource::passes_of(const PointBatch& batch) const {
    std::vector<uint8_t> passes(batch.size, 1);
    if (!region_.everything()) region_.test(batch.x, batch.y, batch.z, passes);
    if (!selection_.filter.everything()) selection_.filter.test(batch, 0, passes);
    return passes;
}

void SelectedSource::read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const {
    std::vector<int> read(wanted.begin(), wanted.end());
    for (const int attribute : selection_.filter.wanted())
        if (std::find(read.begin(), read.end(), attribute) == read.end()) read.push_back(attribute);
    source_->read_batch(index, read, out);
    std::vector<uint8_t> kept = passes_of(out);
    uint64_t rank = first_[size_t(index)];
    for (uint8_t& flag : kept)
        if (flag != 0) flag = rank++ % selection_.every == 0;
    const size_t count = size_t(std::count(kept.begin(), kept.end(), uint8_t{1}));
    keep_rows(out.x, 1, kept, count);
    keep_rows(out.y, 1, kept, count);
    keep_rows(out.z, 1, kept, count);
    for (size_t a = 0; a < out.columns.size(); ++a) {
        const bool is_wanted = std::find(wanted.begin(), wanted.end(), int(a)) != wanted.end();
        if (is_wanted)
            keep_rows(out.columns[a], info_.attributes[a].size_bytes(), kept, count);
        else
            out.columns[a].clear();
    }
    out.size = count;
}

}  // namespace strata
