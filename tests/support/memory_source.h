#pragma once

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// Points in memory as a source: one attribute, "index" (uint32), tells them apart.
class MemorySource : public PointSource {
public:
    explicit MemorySource(std::vector<Vec3i> positions, double scale = 0.001) : positions_(std::move(positions)) {
        info_.format = "memory";
        info_.points = positions_.size();
        info_.quantization.scale = Vec3d::Constant(scale);
        info_.quantization.offset = {500000.0, 5300000.0, 0.0};
        info_.attributes = {{.name = "index", .type = ScalarType::uint32}};
        for (const Vec3i& p : positions_) info_.bounds.extend(info_.quantization.world_from_quanta(p));
    }

    CloudInfo& changeable_info() { return info_; }
    const std::vector<Vec3i>& positions() const { return positions_; }

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (positions_.size() + kBatch - 1) / kBatch; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t begin = index * kBatch, size = std::min(kBatch, positions_.size() - begin);
        resize_batch(out, size, info_.attributes, wanted);
        for (size_t i = 0; i < size; ++i) {
            out.x[i] = positions_[begin + i].x();
            out.y[i] = positions_[begin + i].y();
            out.z[i] = positions_[begin + i].z();
            const uint32_t number = uint32_t(begin + i);
            if (!out.columns[0].empty()) std::memcpy(out.columns[0].data() + 4 * i, &number, 4);
        }
    }

private:
    static constexpr size_t kBatch = 10'000;
    std::vector<Vec3i> positions_;
    CloudInfo info_;
};

}  // namespace strata
