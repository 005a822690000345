#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/cloud/point_filter.h"
#include "core/cloud/point_source.h"

namespace strata {

/// Which points of a cloud are taken.
struct PointSelection {
    std::vector<ClipBox> clips;
    PointFilter filter;  // made for the cloud
    uint64_t every = 1;  // of the points that the others leave, in their order: the first, and each so-manieth after it

    bool everything() const { return clips.empty() && filter.everything() && every == 1; }
};

/// The points of a source that a selection leaves. Bounds are those of what clips and filter leave.
class SelectedSource : public PointSource {
public:
    /// Reads the source once, to know how many points there are and where.
    /// throws  Error{usage} unless every is 1 or more; what the source throws
    SelectedSource(std::unique_ptr<PointSource> source, PointSelection selection, int threads);

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return source_->batch_count(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override;

private:
    std::vector<uint8_t> passes_of(const PointBatch& batch) const;

    std::unique_ptr<PointSource> source_;
    PointSelection selection_;
    ClipRegion region_;
    CloudInfo info_;
    std::vector<uint64_t> first_;  // [batch] points that pass in the batches before
};

}  // namespace strata
