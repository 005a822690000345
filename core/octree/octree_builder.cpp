#include "core/octree/octree_builder.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>

#include "core/error.h"
#include "core/octree/chunk_schedule.h"
#include "core/octree/chunk_store.h"
#include "core/octree/point_distribution.h"
#include "core/octree/subtree_builder.h"
#include "core/octree/top_merge.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr uint64_t kDistributionBytes = 128'000'000;  // records that wait for others of their chunk
constexpr uint64_t kBaseBytes = 96'000'000;           // program, count grid of a surface, batches, borders

// Sums up points from many threads and passes them on, one call at a time and not too often.
class Progress {
public:
    Progress(const BuildSettings& settings, uint64_t total) : settings_(settings), total_(total) {}

    void start(const char* stage) {
        stage_ = stage;
        done_ = 0;
        report();
    }
    void add(uint64_t points) {
        const uint64_t before = done_.fetch_add(points);
        const uint64_t step = std::max<uint64_t>(total_ / 200, 1);
        if (before / step != (before + points) / step) report();
    }

private:
    void report() {
        if (!settings_.on_progress) return;
        const std::lock_guard lock(mutex_);
        settings_.on_progress({stage_, std::min(done_.load(), total_), total_});
    }

    const BuildSettings& settings_;
    uint64_t total_;
    const char* stage_ = "";
    std::atomic<uint64_t> done_ = 0;
    std::mutex mutex_;
};

// Counts what reaches the sink: the sum of node points is checked at the end.
class CheckedSink {
public:
    CheckedSink(NodeSink& sink, BuildReport& report) : sink_(sink), report_(report) {}

    void append(std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) {
        sink_.append(nodes, bytes);
        for (const BuiltNode& node : nodes) {
            if (report_.points_per_level.size() <= node.key.level) report_.points_per_level.resize(node.key.level + 1, 0);
            report_.points_per_level[node.key.level] += node.points;
            report_.points_written += node.points;
            ++report_.nodes;
        }
    }

private:
    NodeSink& sink_;
    BuildReport& report_;
};

// Builds every chunk, in rank order as far as neighbours depend on each other and as the output shows.
class ChunkBuild {
public:
    ChunkBuild(const Partition& partition, const OctreeFrame& frame, const RecordLayout& layout, ChunkStore& store, NodeSink& sink,
               CheckedSink& output, Promoted& promoted, Progress& progress)
        : partition_(partition), frame_(frame), layout_(layout), store_(store), sink_(sink), output_(output),
          promoted_(promoted), progress_(progress), schedule_(partition), borders_(partition.chunks().size()),
          finished_(partition.chunks().size()), done_(partition.chunks().size(), false) {}

    void run(int threads, const std::vector<bool>& attribute_kept) {
        const RecordLayout out_layout = without(layout_, attribute_kept);
        parallel_workers(threads, [&](int) {
            try {
                SubtreeBuilder builder(frame_, out_layout.size, sink_);
                std::vector<std::byte> buffer;
                for (;;) {
                    const uint32_t rank = take_rank(threads);
                    if (rank >= schedule_.order.size()) return;
                    const uint32_t chunk = schedule_.order[rank];
                    const std::span<const std::byte> records = drop_attributes(layout_, attribute_kept, store_.load(chunk, buffer));
                    if (!wait_for_neighbours(chunk)) return;
                    Subtree subtree = builder.build(partition_.chunks()[chunk].key, records, seeds_for(chunk), take_buffer());
                    store_.discard(chunk);
                    finish(chunk, std::move(subtree));
                    progress_.add(partition_.chunks()[chunk].points);
                }
            } catch (...) {
                const std::lock_guard lock(mutex_);
                failed_ = true;
                changed_.notify_all();
                throw;
            }
        });
    }

    /// What a chunk keeps near its faces, for the nodes above the chunks.
    std::span<const BorderPoint> border(uint32_t chunk) const { return borders_[chunk]; }

private:
    // A finished chunk waits for those of lower rank before it is stored; no worker runs far ahead of that.
    uint32_t take_rank(int threads) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return failed_ || next_rank_ < next_stored_ + 2 * uint32_t(threads); });
        return failed_ ? uint32_t(schedule_.order.size()) : next_rank_++;
    }

    bool wait_for_neighbours(uint32_t chunk) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] {
            return failed_ || std::all_of(schedule_.waits_for[chunk].begin(), schedule_.waits_for[chunk].end(),
                                          [&](uint32_t other) { return bool(done_[other]); });
        });
        return !failed_;
    }

    // Of the adjacent chunks of lower rank, the border points that are near this chunk.
    std::vector<BorderPoint> seeds_for(uint32_t chunk) const {
        const NodeKey& key = partition_.chunks()[chunk].key;
        const double side = frame_.node_side(key.level), reach = frame_.spacing(key.level);
        const Vec3d low = Vec3d(key.x, key.y, key.z) * side;
        std::vector<BorderPoint> seeds;
        for (const uint32_t other : schedule_.waits_for[chunk])
            for (const BorderPoint& point : borders_[other]) {
                const Vec3d p = point.p_quanta.cast<double>().cwiseProduct(frame_.scale) - low;
                if ((p.array() > -reach).all() && (p.array() < side + reach).all()) seeds.push_back(point);
            }
        return seeds;
    }

    // Fresh memory costs a page fault every 4 KiB: buffers go round.
    std::vector<std::byte> take_buffer() {
        const std::lock_guard lock(mutex_);
        if (spare_buffers_.empty()) return {};
        std::vector<std::byte> buffer = std::move(spare_buffers_.back());
        spare_buffers_.pop_back();
        return buffer;
    }

    void finish(uint32_t chunk, Subtree subtree) {
        std::unique_lock lock(mutex_);
        borders_[chunk] = std::move(subtree.border);
        done_[chunk] = true;
        finished_[chunk] = std::move(subtree);
        changed_.notify_all();
        while (!failed_ && !storing_ && next_stored_ < schedule_.order.size() && done_[schedule_.order[next_stored_]]) {
            storing_ = true;
            Subtree next = std::move(finished_[schedule_.order[next_stored_]]);
            lock.unlock();
            output_.append(next.nodes, next.bytes);
            promoted_.add(next.root, next.root_records);
            next.bytes.clear();
            lock.lock();
            spare_buffers_.push_back(std::move(next.bytes));
            storing_ = false;
            ++next_stored_;
            changed_.notify_all();
        }
    }

    const Partition& partition_;
    const OctreeFrame& frame_;
    const RecordLayout& layout_;
    ChunkStore& store_;
    NodeSink& sink_;
    CheckedSink& output_;
    Promoted& promoted_;
    Progress& progress_;
    ChunkSchedule schedule_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<std::vector<BorderPoint>> borders_;  // [chunk]; written before done_, read after
    std::vector<Subtree> finished_;     // [chunk]
    std::vector<bool> done_;            // [chunk]
    std::vector<std::vector<std::byte>> spare_buffers_;
    uint32_t next_rank_ = 0, next_stored_ = 0;
    bool storing_ = false, failed_ = false;
};

uint64_t most_chunk_points(const Partition& partition) {
    uint64_t most = 0;
    for (const Partition::Chunk& chunk : partition.chunks()) most = std::max(most, chunk.points);
    return most;
}

Error cap_too_low(uint64_t cap, uint64_t needed) {
    return {ErrorKind::limit, "a memory cap of at least " + std::to_string((needed >> 20) + 1) + " MiB is needed, " +
                                  std::to_string(cap >> 20) + " MiB are allowed"};
}

// The source's attributes, then those that the build adds.
RecordLayout layout_of(const CloudInfo& info, const BuildSettings& settings) {
    std::vector<Attribute> attributes = info.attributes;
    if (settings.surface)
        for (const Attribute& attribute : surface_attributes(*settings.surface)) {
            if (find_attribute(info.attributes, attribute.name) >= 0)
                throw Error(ErrorKind::usage, "the points have an attribute " + attribute.name + " already");
            attributes.push_back(attribute);
        }
    return RecordLayout(std::move(attributes));
}

// Of a thread, in the stage that takes most.
uint64_t memory_of_thread(uint64_t chunk_points, size_t record_size, const BuildSettings& settings) {
    const uint64_t building = SubtreeBuilder::memory_needed(chunk_points, record_size);
    return settings.surface ? std::max(building, surface_memory_needed(chunk_points)) : building;
}

int threads_within(uint64_t cap, uint64_t fixed_bytes, uint64_t each, int threads) {
    if (fixed_bytes + each > cap) throw cap_too_low(cap, fixed_bytes + each);
    return int(std::min<uint64_t>(uint64_t(threads), (cap - fixed_bytes) / each));
}

BuiltCloud describe(const CloudInfo& info, const std::vector<Attribute>& attributes, const OctreeFrame& frame, uint64_t points,
                    const AttributeRanges& ranges, const std::vector<bool>& kept) {
    BuiltCloud cloud;
    cloud.points = points;
    cloud.quantization = {frame.scale, info.quantization.offset};
    cloud.min_quanta = frame.min_quanta;
    cloud.max_quanta = frame.max_quanta;
    cloud.coarsening_bits = frame.coarsening_bits;
    cloud.source_quantization = info.quantization;
    cloud.cube_side = frame.side;
    cloud.spacing = frame.spacing(0);
    cloud.crs = info.crs;
    cloud.crs_records = info.crs_records;
    cloud.adjusted_gps_time = info.adjusted_gps_time;
    for (size_t a = 0; a < attributes.size(); ++a) {
        if (!kept[a]) continue;
        cloud.attributes.push_back(attributes[a]);
        cloud.attribute_min.push_back(ranges.min[a]);
        cloud.attribute_max.push_back(ranges.max[a]);
    }
    return cloud;
}

std::vector<bool> attributes_to_keep(const std::vector<Attribute>& attributes, const std::vector<std::string>& optional,
                                     const AttributeRanges& ranges) {
    std::vector<bool> kept(attributes.size(), true);
    for (size_t a = 0; a < attributes.size(); ++a)
        if (std::find(optional.begin(), optional.end(), attributes[a].name) != optional.end())
            kept[a] = std::any_of(ranges.min[a].begin(), ranges.min[a].end(), [](double v) { return v < 0.0; }) ||
                      std::any_of(ranges.max[a].begin(), ranges.max[a].end(), [](double v) { return v > 0.0; });
    return kept;
}

Vec3i quanta_of(const Quantization& quantization, const Vec3d& p) {
    const Vec3d quanta = (p - quantization.offset).cwiseQuotient(quantization.scale);
    Vec3i rounded;
    for (int axis = 0; axis < 3; ++axis)
        rounded[axis] = int32_t(std::nearbyint(std::clamp(quanta[axis], double(INT32_MIN), double(INT32_MAX))));
    return rounded;
}

}  // namespace

BuildEstimate estimate_build(const CloudInfo& info, const BuildSettings& settings) {
    const size_t record_size = layout_of(info, settings).size;
    const uint64_t each = memory_of_thread(std::min(info.points, kMaxChunkPoints), record_size, settings);
    BuildEstimate estimate;
    estimate.record_bytes = info.points * record_size;
    estimate.least_memory_bytes = kBaseBytes + kDistributionBytes / 4 + each;
    const uint64_t in_memory = kBaseBytes + kDistributionBytes / 4 + estimate.record_bytes;
    estimate.in_memory = in_memory + each * uint64_t(std::min(settings.threads, 4)) <= settings.memory_bytes;
    estimate.temporary_bytes = estimate.in_memory ? 0 : estimate.record_bytes;
    const uint64_t fixed = estimate.in_memory ? in_memory : kBaseBytes + kDistributionBytes / 4;
    const uint64_t left = settings.memory_bytes > fixed ? settings.memory_bytes - fixed : 0;
    estimate.threads = int(std::clamp<uint64_t>(left / each, 1, uint64_t(settings.threads)));
    estimate.memory_bytes = fixed + each * uint64_t(estimate.threads);
    return estimate;
}

BuildReport build_octree(const PointSource& source, const BuildSettings& settings, ScratchStore* scratch, NodeSink& sink) {
    const CloudInfo& info = source.info();
    const RecordLayout layout = layout_of(info, settings);
    const BuildEstimate estimate = estimate_build(info, settings);
    if (estimate.least_memory_bytes > settings.memory_bytes) throw cap_too_low(settings.memory_bytes, estimate.least_memory_bytes);
    if (!estimate.in_memory && !scratch) throw cap_too_low(settings.memory_bytes, kBaseBytes + kDistributionBytes / 4 + estimate.record_bytes);

    BuildReport report;
    CheckedSink output(sink, report);
    Progress progress(settings, info.points);
    const OnPoints on_points = [&](uint64_t points) { progress.add(points); };

    // The header's bounds are tried first; where they were wrong, the points are read once more with the true ones.
    progress.start("counting");
    OctreeFrame frame = make_octree_frame(info.quantization, Vec3i::Zero(), Vec3i::Zero());
    if (!info.bounds.empty())
        frame = make_octree_frame(info.quantization, quanta_of(info.quantization, info.bounds.min),
                                  quanta_of(info.quantization, info.bounds.max));
    auto partition = std::make_unique<Partition>(info.points);
    QuantaBounds bounds = count_points(source, settings.threads, frame, partition.get(), on_points);
    report.points_read = bounds.points;
    if (bounds.points > 0 && (bounds.min != frame.min_quanta || bounds.max != frame.max_quanta)) {
        frame = make_octree_frame(info.quantization, bounds.min, bounds.max);
        partition = std::make_unique<Partition>(bounds.points);
        progress.start("counting");
        count_points(source, settings.threads, frame, partition.get(), on_points);
    }
    while (!partition->refine()) {
        progress.start("counting");
        count_points(source, settings.threads, frame, partition.get(), on_points);
    }

    progress.start("sorting");
    ChunkStore store(*partition, layout.size, estimate.in_memory ? nullptr : scratch);
    report.temporary_bytes = estimate.in_memory ? 0 : store.size_bytes();
    const uint64_t buffer_bytes = std::min(kDistributionBytes, settings.memory_bytes / 8);
    AttributeRanges ranges =
        distribute_points(source, settings.threads, buffer_bytes, frame, *partition, layout, store, on_points);
    const uint64_t fixed = kBaseBytes + (estimate.in_memory ? estimate.record_bytes : 0);
    const int threads = threads_within(settings.memory_bytes, fixed,
                                       memory_of_thread(most_chunk_points(*partition), layout.size, settings), settings.threads);
    if (settings.surface) {
        progress.start("neighbors");
        const Quantization stored{frame.scale, info.quantization.world_from_quanta(frame.min_quanta)};
        ranges.append(estimate_surfaces(*partition, frame, stored, layout, *settings.surface, threads, store, on_points));
    }
    const std::vector<bool> kept = attributes_to_keep(layout.attributes, settings.optional_attributes, ranges);

    sink.begin(describe(info, layout.attributes, frame, report.points_read, ranges, kept));
    progress.start("building");
    Promoted promoted(estimate.in_memory ? nullptr : scratch, store.size_bytes());
    ChunkBuild chunks(*partition, frame, layout, store, sink, output, promoted, progress);
    chunks.run(threads, kept);
    merge_top(*partition, frame, without(layout, kept).size, threads, promoted,
              [&](uint32_t chunk) { return chunks.border(chunk); }, sink,
              [&](std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) { output.append(nodes, bytes); });
    if (report.points_written != report.points_read)
        throw Error(ErrorKind::malformed, "the nodes hold " + std::to_string(report.points_written) + " points, " +
                                              std::to_string(report.points_read) + " were read");
    report.worst_rounding = info.worst_rounding + (frame.coarsening_bits > 0 ? 0.5 * frame.scale.maxCoeff() : 0.0);
    report.levels = int(report.points_per_level.size());
    sink.finish();
    return report;
}

}  // namespace strata
