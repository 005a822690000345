#include "io/las/laz_source.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "core/error.h"
#include "io/las/las_extra_bytes.h"
#include "io/las/las_info.h"
#include "io/las/las_source.h"
#include "io/las/laz_chunk_reader.h"

namespace strata {
namespace {

// Chunks are joined up to so many points, and decoded whole up to so many; larger ones in parts.
constexpr uint64_t kJoinedPoints = 65536, kMostPoints = 1 << 18, kPartPoints = 1 << 17;
constexpr uint64_t kMostBatchBytes = 16 << 20;  // of records; batches must stay small beside the caps on memory
constexpr size_t kTileBytes = 128 * 1024;       // of records, on their way from the decoder to the columns
// Threads take parts of a chunk nearly in order; a few places to go on from let none begin anew.
constexpr size_t kKeptLanes = 8;
constexpr size_t kKeptDecoders = 16;  // some hundred kB each

las::Header read_compressed_header(const ByteSource& bytes, las::Damage damage) {
    las::Header header = las::read_header(bytes, damage);
    if (!header.compressed) throw Error(ErrorKind::unsupported, bytes.name() + ": not compressed: LAZ is expected");
    return header;
}

// Puts records into the rows of a batch as they come.
auto rows_of(const las::Columns& columns, size_t record_size, std::span<const int> wanted, PointBatch& out) {
    return [&columns, record_size, wanted, &out, row = size_t{0}](const std::byte* records, size_t count) mutable {
        columns.decode({records, count * record_size}, wanted, row, out);
        row += count;
    };
}

bool is_copc(const las::Header& header) { return !header.records.empty() && header.records.front().user_id == "copc"; }

}  // namespace

// A decoder that was lent, and goes back.
class LazSource::Decoder {
public:
    Decoder(const LazSource& source, const las::LazSelection& selection) : source_(source), selection_(selection) {
        {
            const std::lock_guard lock(source.idle_mutex_);
            if (selection.bytes == source.idle_for_.bytes && !source.idle_.empty()) {
                decoder_ = std::move(source.idle_.back());
                source.idle_.pop_back();
            }
        }
        if (!decoder_) decoder_ = las::make_laz_decoder(source.header_, source.laz_, selection);
    }
    Decoder(const Decoder& other) : source_(other.source_), selection_(other.selection_), decoder_(other.decoder_->clone()) {}
    Decoder& operator=(const Decoder&) = delete;
    ~Decoder() {
        const std::lock_guard lock(source_.idle_mutex_);
        if (selection_.bytes != source_.idle_for_.bytes) {
            source_.idle_.clear();
            source_.idle_for_ = std::move(selection_);
        }
        if (source_.idle_.size() < kKeptDecoders) source_.idle_.push_back(std::move(decoder_));  // there is room: nothing can fail here
    }
    las::LazDecoder* operator->() const { return decoder_.get(); }

private:
    const LazSource& source_;
    las::LazSelection selection_;
    std::unique_ptr<las::LazDecoder> decoder_;
};

// Goes through the points from a chunk on, one behind the other. A copy goes on where the original was.
class LazSource::Walk {
public:
    /// wanted_points  of the first chunk, if no more are read; 0: all
    Walk(const LazSource& source, size_t chunk, const las::LazSelection& selection, uint64_t wanted_points = 0)
        : source_(source), chunk_(chunk), wanted_points_(wanted_points), offset_(source.chunks_.chunks[chunk].offset),
          decoder_(source, selection) {}
    Walk(const Walk& other)
        : source_(other.source_), chunk_(other.chunk_), wanted_points_(other.wanted_points_), done_(other.done_), offset_(other.offset_), decoder_(other.decoder_) {}
    Walk& operator=(const Walk&) = delete;

    /// Calls sink(records, count) for the next `points` points in pieces.
    template <typename Sink>
    void read(uint64_t points, Sink sink) {
        const size_t record_size = source_.header_.record_size;
        const uint64_t tile = std::max<uint64_t>(1, kTileBytes / record_size);
        thread_local std::vector<std::byte> records;
        records.resize(size_t(std::min(tile, points)) * record_size);
        while (points > 0) {
            const las::LazChunk& chunk = source_.chunks_.chunks[chunk_];
            const uint64_t count = std::min({tile, points, chunk.points - done_});
            try {
                if (done_ == 0) begin(chunk);
                decoder_->decode(size_t(count), records.data());
                done_ += count;
                if (done_ == chunk.points) offset_ = decoder_->finish();
            } catch (const Error& error) {
                // What the decoders find wrong they tell by the byte alone.
                if (error.kind == ErrorKind::malformed && std::string_view(error.what()).starts_with("byte ")) throw error.within(place());
                throw;
            }
            if (done_ == chunk.points) next_chunk();
            sink(records.data(), size_t(count));
            points -= count;
        }
    }

private:
    void begin(las::LazChunk chunk) {
        if (chunk.open_end) {
            const uint64_t end = source_.bytes_->size();
            chunk.offset = offset_;
            chunk.size = end - std::min(end, offset_);
        }
        chunk.wanted_points = wanted_points_;
        decoder_->begin(*source_.bytes_, chunk);
    }
    void next_chunk() {
        ++chunk_;
        wanted_points_ = 0;
        done_ = 0;
        if (!source_.chunks_.sequential && chunk_ < source_.chunks_.chunks.size()) offset_ = source_.chunks_.chunks[chunk_].offset;
    }
    std::string place() const {
        return source_.bytes_->name() + ": chunk " + std::to_string(chunk_ + 1) + " of " + std::to_string(source_.chunks_.chunks.size());
    }

    const LazSource& source_;
    size_t chunk_;
    uint64_t wanted_points_;
    uint64_t done_ = 0;  // points of the chunk
    uint64_t offset_;    // of the chunk; of the next one once it is done
    Decoder decoder_;
};

LazSource::LazSource(std::unique_ptr<ByteSource> bytes, las::Damage damage)
    : bytes_(std::move(bytes)),
      header_(read_compressed_header(*bytes_, damage)),
      notes_(header_.notes),
      laz_(las::read_laz_header(*bytes_, header_)),
      chunks_(damage == las::Damage::salvage ? las::salvage_laz_chunks(*bytes_, header_, laz_, notes_)
                                             : las::read_laz_chunks(*bytes_, header_, laz_)),
      columns_(header_.point_format, header_.record_size, las::read_extra_bytes(*bytes_, header_, notes_)) {
    info_ = las::cloud_info(*bytes_, header_, columns_, is_copc(header_) ? "copc 1.0, laz" : "laz", std::move(notes_));
    idle_.reserve(kKeptDecoders);
    plan_batches(damage == las::Damage::salvage ? 0 : kJoinedPoints);  // damage shall cost its chunk alone
}

LazSource::~LazSource() = default;

void LazSource::plan_batches(uint64_t most_joined) {
    const std::vector<las::LazChunk>& chunks = chunks_.chunks;
    const uint64_t most = std::clamp<uint64_t>(kMostBatchBytes / header_.record_size, 1, kMostPoints), part = std::min(most, kPartPoints);
    const uint64_t joined = std::min(most, most_joined);
    for (size_t c = 0; c < chunks.size(); ++c) {
        const uint64_t points = chunks[c].points;
        if (!plans_.empty() && points <= joined && plans_.back().points <= joined - points) {
            plans_.back().points += points;
            plans_.back().points_per_batch += points;
            continue;
        }
        const bool whole = points <= most;
        plans_.push_back({batch_count_, c, points, whole ? points : part, !whole || chunks_.sequential});
        batch_count_ += whole ? 1 : (points + part - 1) / part;
    }
}

const LazSource::Plan& LazSource::plan_of(uint64_t index) const {
    return *std::prev(std::upper_bound(plans_.begin(), plans_.end(), index, [](uint64_t i, const Plan& plan) { return i < plan.first_batch; }));
}

LazSource::Batch LazSource::batch(uint64_t index) const {
    const Plan& plan = plan_of(index);
    const uint64_t first = (index - plan.first_batch) * plan.points_per_batch;
    return {plan.chunk, first, std::min(plan.points_per_batch, plan.points - first)};
}

// The last batch up to `index` that begins where a chunk does whose offset is known.
uint64_t LazSource::first_reachable(uint64_t index) const { return chunks_.sequential ? 0 : plan_of(index).first_batch; }

template <typename Sink>
void LazSource::read_points(uint64_t index, const las::LazSelection& selection, Sink sink) const {
    const Plan& plan = plan_of(index);
    if (plan.in_order) return read_in_order(index, sink);
    Walk(*this, plan.chunk, selection).read(plan.points, sink);
}

template <typename Sink>
void LazSource::read_in_order(uint64_t index, Sink sink) const {
    const std::lock_guard lock(in_order_);
    // From the farthest place before the batch: one that was kept, or where a chunk begins.
    const uint64_t begin = first_reachable(index);
    const Lane* nearest = nullptr;
    for (const Lane& kept : lanes_)
        if (kept.batch <= index && kept.batch >= begin && (!nearest || kept.batch > nearest->batch)) nearest = &kept;
    Lane lane = nearest ? Lane{nearest->batch, std::make_unique<Walk>(*nearest->walk)}
                        : Lane{begin, std::make_unique<Walk>(*this, batch(begin).chunk, las::LazSelection{})};
    for (; lane.batch < index; ++lane.batch) lane.walk->read(batch(lane.batch).points, [](const std::byte*, size_t) {});
    lane.walk->read(batch(index).points, sink);
    ++lane.batch;
    if (lane.batch < batch_count_ && first_reachable(lane.batch) < lane.batch) lanes_.push_back(std::move(lane));
    if (lanes_.size() > kKeptLanes) lanes_.pop_front();
}

void LazSource::read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const {
    resize_batch(out, size_t(batch(index).points), info_.attributes, wanted);
    read_points(index, las::select_bytes(columns_, header_.record_size, wanted), rows_of(columns_, header_.record_size, wanted, out));
}

void LazSource::read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const {
    const Batch from = batch(index);
    const bool in_reach = from.first_point == 0 && (index == 0 || !chunks_.sequential);
    const uint64_t points = in_reach ? std::min(most, from.points) : 0;
    resize_batch(out, size_t(points), info_.attributes, wanted);
    if (points == 0) return;
    const las::LazSelection selection = las::select_bytes(columns_, header_.record_size, wanted);
    if (points < chunks_.chunks[from.chunk].points) {
        announce_first(index, points, selection);
        try {
            return Walk(*this, from.chunk, selection, points).read(points, rows_of(columns_, header_.record_size, wanted, out));
        } catch (const Error& error) {
            if (error.kind != ErrorKind::malformed) throw;  // they may lie behind what was read for them
        }
    }
    Walk(*this, from.chunk, selection).read(points, rows_of(columns_, header_.record_size, wanted, out));
}

// A first look goes through the whole file in small pieces: the disk is told of them well ahead, or each would be waited for.
void LazSource::announce_first(uint64_t index, uint64_t points, const las::LazSelection& selection) const {
    constexpr uint64_t kAhead = 256, kHeadBytes = 512;  // batches; record and layer sizes
    std::call_once(heads_announced_, [&] {
        for (const Plan& plan : plans_) bytes_->prefetch(chunks_.chunks[plan.chunk].offset, kHeadBytes);
    });
    const uint64_t end = std::min(index + kAhead, batch_count_);
    const Decoder decoder(*this, selection);
    for (uint64_t next = announced_.load(); next < end; next = announced_.load()) {
        if (!announced_.compare_exchange_weak(next, next + 1)) continue;
        const Batch ahead = batch(next);
        if (ahead.first_point > 0 || chunks_.sequential) continue;
        las::LazChunk chunk = chunks_.chunks[ahead.chunk];
        chunk.wanted_points = points;
        decoder->prefetch(*bytes_, chunk);
    }
}

std::vector<std::byte> LazSource::read_records(uint64_t index) const {
    std::vector<std::byte> all;
    all.reserve(size_t(batch(index).points) * header_.record_size);
    read_points(index, {}, [&](const std::byte* records, size_t count) { all.insert(all.end(), records, records + count * header_.record_size); });
    return all;
}

const las::Header* header_of(const PointSource& source) {
    if (const auto* const laz = dynamic_cast<const LazSource*>(&source)) return &laz->header();
    const auto* const las = dynamic_cast<const LasSource*>(&source);
    return las ? &las->header() : nullptr;
}

std::unique_ptr<PointSource> open_las(std::unique_ptr<ByteSource> bytes, las::Damage damage) {
    if (las::read_header(*bytes, damage).compressed) return std::make_unique<LazSource>(std::move(bytes), damage);
    return std::make_unique<LasSource>(std::move(bytes), damage);
}

}  // namespace strata
