#pragma once

#include <cstdint>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// The first points of each batch of a source, in memory: a first look at a file of any size that costs what these points cost.
class PreviewSource : public PointSource {
public:
    /// Reads at most about `points` points, the same number from each batch that has as many; where there are more batches than
    /// that, one point from each so-manieth.
    /// throws  Error{usage} for no points; what the source throws
    PreviewSource(const PointSource& source, uint64_t points, int threads);

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return batches_.size(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override;

private:
    CloudInfo info_;
    std::vector<PointBatch> batches_;
};

}  // namespace strata
