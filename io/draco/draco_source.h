#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "core/cloud/point_source.h"
#include "io/byte_source.h"
#include "io/draco/draco_header.h"

namespace strata {

namespace drc {
struct Plan;
struct Points;
}  // namespace drc

/// The points of a Draco file, or the vertices of its mesh. Draco decodes whole files: a file of one batch is decoded for
/// each reading, a longer one is kept decoded until its last batch was read. What strata wrote opens without decoding; other
/// files are decoded once to find their bounds and scale.
class DracoSource : public PointSource {
public:
    static constexpr uint64_t kWholeBatchPoints = 1 << 18;  // a file up to this is one batch
    static constexpr uint64_t kBatchPoints = 65536;         // of a longer one

    /// Whether a file that had to be decoded to open it stays so, until its last batch was read: not when many are opened.
    enum class Keep { decoded, nothing };

    /// throws  Error{malformed, unsupported, limit, io}: file, place, expectation
    explicit DracoSource(std::unique_ptr<ByteSource> bytes, Keep keep = Keep::decoded);
    ~DracoSource() override;

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override;
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override;

private:
    std::shared_ptr<const drc::Points> decode() const;

    std::unique_ptr<ByteSource> bytes_;
    drc::Header header_;
    CloudInfo info_;
    std::unique_ptr<drc::Plan> plan_;  // where positions and attributes come from

    mutable std::mutex decoding_;
    mutable std::shared_ptr<const drc::Points> kept_;  // guarded by decoding_
};

}  // namespace strata
