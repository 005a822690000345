#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "core/cloud/point_source.h"
#include "io/byte_source.h"
#include "io/las/las_columns.h"
#include "io/las/las_header.h"
#include "io/las/laz_chunk_table.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_header.h"

namespace strata {

/// The points of a LAZ file, point formats 0 to 10; a COPC file is one too. A batch is a chunk, several small ones, or a part
/// of a very large one. Batches of chunks decode in parallel; parts of a chunk, and chunks of a file without chunk table, can
/// only be found one behind the other: they decode one at a time, fastest in their order.
class LazSource : public PointSource {
public:
    /// throws  Error{malformed, unsupported, io}: file, place, expectation
    explicit LazSource(std::unique_ptr<ByteSource> bytes, las::Damage damage = las::Damage::refuse);
    ~LazSource() override;

    const CloudInfo& info() const override { return info_; }
    const las::Header& header() const { return header_; }
    uint64_t batch_count() const override { return batch_count_; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override;
    void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const override;

    /// The records of a batch as an uncompressed file would have them, [points * record size] bytes.
    std::vector<std::byte> read_records(uint64_t index) const;

private:
    struct Batch {
        size_t chunk = 0;          // the first
        uint64_t first_point = 0;  // in it
        uint64_t points = 0;
    };
    /// Batches planned together: the parts of one chunk, or one of several chunks.
    struct Plan {
        uint64_t first_batch = 0;
        size_t chunk = 0;  // the first
        uint64_t points = 0, points_per_batch = 0;
        bool in_order = false;  // a batch cannot be reached but through the points before it
    };
    class Walk;
    class Decoder;
    /// Where the batches that are decoded one behind the other have come to.
    struct Lane {
        uint64_t batch = 0;  // that comes next
        std::unique_ptr<Walk> walk;
    };

    void plan_batches(uint64_t most_joined);
    const Plan& plan_of(uint64_t index) const;
    Batch batch(uint64_t index) const;
    uint64_t first_reachable(uint64_t index) const;
    void announce_first(uint64_t index, uint64_t points, const las::LazSelection& selection) const;
    template <typename Sink>
    void read_points(uint64_t index, const las::LazSelection& selection, Sink sink) const;
    template <typename Sink>
    void read_in_order(uint64_t index, Sink sink) const;

    std::unique_ptr<ByteSource> bytes_;
    las::Header header_;
    std::vector<std::string> notes_;
    las::LazHeader laz_;
    las::LazChunks chunks_;
    las::Columns columns_;
    CloudInfo info_;
    std::vector<Plan> plans_;
    uint64_t batch_count_ = 0;

    // Decoders that nobody uses now, all made for `idle_for_`: making one and its models anew takes as long as some thousand points.
    mutable std::mutex idle_mutex_;
    mutable las::LazSelection idle_for_;
    mutable std::vector<std::unique_ptr<las::LazDecoder>> idle_;

    mutable std::once_flag heads_announced_;
    mutable std::atomic<uint64_t> announced_ = 0;  // batches whose first points the disk was told of

    mutable std::mutex in_order_;
    mutable std::deque<Lane> lanes_;  // the latest, guarded by in_order_
};

/// The header of an opened LAS or LAZ file; null: the source is another.
const las::Header* header_of(const PointSource& source);

/// Opens LAS or LAZ, whichever it is.
std::unique_ptr<PointSource> open_las(std::unique_ptr<ByteSource> bytes, las::Damage damage = las::Damage::refuse);

}  // namespace strata
