#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// What of a damaged source can be read. A batch that cannot is left out whole, and a line in the notes says why.
class SalvagedSource : public PointSource {
public:
    /// Reads the whole source once, all attributes, to know which batches are sound.
    /// stated_points  that there should be; those that the source itself knows to be missing are more than it has
    /// throws         Error{malformed}: no batch can be read; Error of other kinds than malformed and io
    SalvagedSource(std::unique_ptr<PointSource> source, uint64_t stated_points, int threads);

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return sound_.size(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override { source_->read_batch(sound_[size_t(index)], wanted, out); }
    void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const override {
        source_->read_first(sound_[size_t(index)], most, wanted, out);
    }

    /// Points that should be there and are not.
    uint64_t lost_points() const { return stated_points_ - std::min(stated_points_, info_.points); }

private:
    std::unique_ptr<PointSource> source_;
    uint64_t stated_points_;
    CloudInfo info_;
    std::vector<uint64_t> sound_;  // indices of the source's batches
};

}  // namespace strata
