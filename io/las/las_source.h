#pragma once

#include <memory>

#include "core/cloud/point_source.h"
#include "io/byte_source.h"
#include "io/las/las_columns.h"
#include "io/las/las_header.h"

namespace strata {

/// The points of an uncompressed LAS file, 1.0 to 1.4, point formats 0 to 10.
class LasSource : public PointSource {
public:
    static constexpr uint64_t kBatchPoints = 65536;

    /// throws  Error{malformed, unsupported, io}: file, place, expectation
    explicit LasSource(std::unique_ptr<ByteSource> bytes, las::Damage damage = las::Damage::refuse);

    const CloudInfo& info() const override { return info_; }
    const las::Header& header() const { return header_; }
    uint64_t batch_count() const override { return (header_.points + kBatchPoints - 1) / kBatchPoints; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override { read_first(index, kBatchPoints, wanted, out); }
    void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const override;

private:
    std::unique_ptr<ByteSource> bytes_;
    las::Header header_;
    std::vector<std::string> notes_;
    las::Columns columns_;
    CloudInfo info_;
};

}  // namespace strata
