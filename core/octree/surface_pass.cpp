#include "core/octree/surface_pass.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>

#include "core/octree/reach_grid.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr uint64_t kBlockBytes = 24'000'000;  // of points that wait for other chunks, with their neighbors so far

// The least stored quantum of a cell of level 31, or of those above it.
int32_t first_quantum(const OctreeFrame& frame, int axis, uint32_t cell) {
    if (cell == 0) return 0;
    const double guess = std::min(double(cell) / frame.cells_per_quantum[axis], double(INT32_MAX));
    int64_t quantum = std::max<int64_t>(int64_t(guess) - 2, 0);  // the quotient is rounded
    while (quantum < INT32_MAX && frame.cell(axis, int32_t(quantum)) < cell) ++quantum;
    return int32_t(quantum);
}

struct QuantaBox {
    Vec3i min, max;
};

// Of the points that a node can hold.
QuantaBox box_of(const NodeKey& key, const OctreeFrame& frame) {
    const uint32_t cells[3] = {key.x, key.y, key.z}, shift = kMaxLevel - key.level;
    QuantaBox box;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t end = (uint64_t{cells[axis]} + 1) << shift;
        box.min[axis] = first_quantum(frame, axis, cells[axis] << shift);
        box.max[axis] = end >= uint64_t{1} << kMaxLevel ? INT32_MAX : first_quantum(frame, axis, uint32_t(end)) - 1;
        box.max[axis] = std::max(box.max[axis], box.min[axis]);
    }
    return box;
}

// A point some of whose neighbors may lie in other chunks.
struct OpenPoint {
    uint32_t record;
    Vec3i center;
    double bound_squared;  // no neighbor is farther
};

class SurfacePass {
public:
    SurfacePass(const Partition& partition, const OctreeFrame& frame, const Quantization& quantization, const RecordLayout& layout,
                const SurfaceSettings& settings, ChunkStore& store)
        : partition_(partition), quantization_(quantization), record_size_(layout.size), settings_(settings), store_(store),
          attributes_(surface_attributes(settings)), offset_(layout.offsets[layout.offsets.size() - attributes_.size()]),
          ranges_(attributes_) {
        for (const Partition::Node& node : partition.nodes()) boxes_.push_back(box_of(node.key, frame));
    }

    AttributeRanges run(int threads, const OnPoints& on_points) {
        const int workers = int(std::clamp<size_t>(partition_.chunks().size(), 1, size_t(threads)));
        std::atomic<uint32_t> next = 0;
        std::atomic<bool> failed = false;
        parallel_workers(workers, [&](int) {
            try {
                for (uint32_t chunk; !failed && (chunk = next++) < partition_.chunks().size();) {
                    process(chunk, threads / workers);
                    if (on_points) on_points(partition_.chunks()[chunk].points);
                }
            } catch (...) {
                failed = true;
                throw;
            }
        });
        return ranges_;
    }

private:
    void process(uint32_t chunk, int threads) {
        const NeighborTree tree(points_of(chunk, [](const Vec3i&) { return true; }), quantization_.scale);
        std::vector<float> values(tree.points().size() * attributes_.size());
        std::vector<OpenPoint> open;
        std::mutex open_mutex;
        for_each_neighborhood(tree, settings_.neighbors, threads, [&](const TreePoint& point, const Neighborhood& neighbors) {
            const bool enough = neighbors.points.size() == settings_.neighbors;
            const double bound_squared = enough ? neighbors.radius_squared : bound_by_counts(point.position);
            if (is_closed(chunk, point.position, bound_squared)) return put(neighbors, values, point.index);
            const std::lock_guard lock(open_mutex);
            open.push_back({point.index, point.position, bound_squared});
        });
        const size_t at_once = kBlockBytes / (sizeof(OpenBlock::Entry) + 12 * settings_.neighbors);
        for (size_t begin = 0; begin < open.size(); begin += at_once)
            close(chunk, tree, std::span(open).subspan(begin, std::min(at_once, open.size() - begin)), values);
        store(chunk, values);
    }

    // Those that `wanted` says.
    template <typename Wanted>
    std::vector<TreePoint> points_of(uint32_t chunk, const Wanted& wanted) const {
        std::vector<TreePoint> points;  // grows by doubling
        uint32_t index = 0;
        store_.visit(chunk, [&](std::span<const std::byte> records) {
            for (size_t at = 0; at < records.size(); at += record_size_, ++index)
                if (const Vec3i p = record_position(records.data() + at); wanted(p)) points.push_back({p, index});
        });
        return points;
    }

    // Whether all points within the bound are in the chunk itself.
    bool is_closed(uint32_t chunk, const Vec3i& center, double bound_squared) const {
        const QuantaBox& box = boxes_[size_t(partition_.chunks()[chunk].node)];
        double gap = std::numeric_limits<double>::infinity();  // to the nearest quantum of another cube
        for (int axis = 0; axis < 3; ++axis) {
            const double scale = quantization_.scale[axis];
            if (box.min[axis] > 0) gap = std::min(gap, (double(center[axis]) - double(box.min[axis]) + 1.0) * scale);
            if (box.max[axis] < INT32_MAX) gap = std::min(gap, (double(box.max[axis]) - double(center[axis]) + 1.0) * scale);
        }
        if (gap * gap > bound_squared) return true;
        bool closed = true;
        for_each_chunk_within(partition_.root(), center, bound_squared, [&](uint32_t other) { closed &= other == chunk; });
        return closed;
    }

    template <typename Visit>
    void for_each_chunk_within(int32_t index, const Vec3i& center, double bound_squared, const Visit& visit) const {
        if (distance_squared(index, center) > bound_squared) return;
        const Partition::Node& node = partition_.nodes()[size_t(index)];
        if (node.chunk >= 0) return visit(uint32_t(node.chunk));
        for (const int32_t child : node.children)
            if (child >= 0) for_each_chunk_within(child, center, bound_squared, visit);
    }

    double distance_squared(int32_t node, const Vec3i& center) const {
        const QuantaBox& box = boxes_[size_t(node)];
        return squared_distance(center, center, box.min, box.max, quantization_.scale);
    }

    // A chunk with few points learns from the counts how far enough points are at most.
    double bound_by_counts(const Vec3i& center) const {
        double bound_squared = std::numeric_limits<double>::infinity();
        for (const Partition::Chunk& chunk : partition_.chunks()) {
            if (chunk.points < settings_.neighbors) continue;
            const QuantaBox& box = boxes_[size_t(chunk.node)];
            const Vec3d p = center.cast<double>(), low = p - box.min.cast<double>(), high = box.max.cast<double>() - p;
            bound_squared = std::min(bound_squared, squared_distance(low.cwiseAbs().cwiseMax(high.cwiseAbs()), quantization_.scale));
        }
        return bound_squared;
    }

    // Open points that are closed together, with the best neighbors that are known so far.
    struct OpenBlock {
        struct Entry {
            Vec3i center;
            uint32_t count = 0;  // neighbors known
            double bound_squared = 0.0, radius_squared = 0.0;
        };
        std::vector<Entry> entries;
        std::vector<Vec3i> known;  // [entries * neighbors]
        uint32_t most;

        std::span<const Vec3i> known_of(size_t i) const { return std::span(known).subspan(i * most, entries[i].count); }
        void take(size_t i, const Neighborhood& neighbors) {
            std::copy(neighbors.points.begin(), neighbors.points.end(), known.begin() + ptrdiff_t(i * most));
            entries[i].count = uint32_t(neighbors.points.size());
            entries[i].radius_squared = neighbors.radius_squared;
            if (entries[i].count == most) entries[i].bound_squared = neighbors.radius_squared;
        }
    };

    void close(uint32_t chunk, const NeighborTree& tree, std::span<const OpenPoint> open, std::vector<float>& values) const {
        OpenBlock block{.entries = {}, .known = std::vector<Vec3i>(open.size() * settings_.neighbors), .most = settings_.neighbors};
        block.entries.reserve(open.size());
        std::map<uint32_t, std::vector<uint32_t>> asking;  // by chunk
        NeighborSearch search(tree, settings_.neighbors);
        for (uint32_t i = 0; i < open.size(); ++i) {
            block.entries.push_back({.center = open[i].center, .bound_squared = open[i].bound_squared});
            block.take(i, search.nearest(open[i].center, {}, open[i].bound_squared));
            for_each_chunk_within(partition_.root(), open[i].center, open[i].bound_squared, [&](uint32_t other) {
                if (other != chunk) asking[other].push_back(i);
            });
        }
        // Those that can answer most come first: what they answer spares others the question.
        std::vector<uint32_t> others;
        for (const auto& [other, list] : asking) others.push_back(other);
        std::stable_sort(others.begin(), others.end(), [&](uint32_t a, uint32_t b) { return asking[a].size() > asking[b].size(); });
        for (const uint32_t other : others) ask(other, asking[other], block);
        for (size_t i = 0; i < open.size(); ++i)
            put({open[i].center, block.known_of(i), block.entries[i].radius_squared}, values, open[i].record);
    }

    void ask(uint32_t chunk, std::vector<uint32_t>& asking, OpenBlock& block) const {
        const int32_t node = partition_.chunks()[chunk].node;
        std::erase_if(asking, [&](uint32_t i) { return distance_squared(node, block.entries[i].center) > block.entries[i].bound_squared; });
        if (asking.empty()) return;
        std::vector<ReachGrid::Place> places;
        for (const uint32_t i : asking) {
            const double reach = std::sqrt(block.entries[i].bound_squared);
            places.push_back({block.entries[i].center, (reach * quantization_.scale.cwiseInverse()).array() + 1.0});  // and rounding
        }
        const QuantaBox& box = boxes_[size_t(node)];
        const ReachGrid grid(places, box.min, box.max);
        const NeighborTree tree(points_of(chunk, [&](const Vec3i& p) { return grid.contains(p); }), quantization_.scale);
        NeighborSearch search(tree, settings_.neighbors);
        for (const uint32_t i : asking)
            block.take(i, search.nearest(block.entries[i].center, block.known_of(i), block.entries[i].bound_squared));
    }

    void put(const Neighborhood& neighbors, std::vector<float>& values, uint32_t record) const {
        const SurfaceEstimate estimate = estimate_surface(neighbors, quantization_, settings_.viewpoint);
        float* to = values.data() + record * attributes_.size();
        if (settings_.normals) to = std::copy_n(estimate.normal.data(), 3, to);
        if (settings_.density) *to = estimate.density;
    }

    void store(uint32_t chunk, const std::vector<float>& values) {
        const size_t size = 4 * attributes_.size();
        const float* from = values.data();
        store_.change(chunk, [&](std::span<std::byte> records) {
            for (size_t at = offset_; at < records.size(); at += record_size_, from += attributes_.size())
                std::memcpy(records.data() + at, from, size);
        });
        AttributeRanges ranges(attributes_);
        for (size_t i = 0; i < values.size(); ++i) {
            const size_t a = i % attributes_.size();
            ranges.min[a][0] = std::min(ranges.min[a][0], double(values[i]));
            ranges.max[a][0] = std::max(ranges.max[a][0], double(values[i]));
        }
        const std::lock_guard lock(ranges_mutex_);
        ranges_.extend(ranges);
    }

    const Partition& partition_;
    Quantization quantization_;
    size_t record_size_;
    const SurfaceSettings& settings_;
    ChunkStore& store_;
    std::vector<Attribute> attributes_;
    size_t offset_;  // of the first surface attribute in a record
    std::vector<QuantaBox> boxes_;  // [partition nodes]
    AttributeRanges ranges_;
    std::mutex ranges_mutex_;
};

}  // namespace

std::vector<Attribute> surface_attributes(const SurfaceSettings& settings) {
    std::vector<Attribute> attributes;
    const auto add = [&](std::string_view name, const char* description) {
        attributes.push_back({.name = std::string(name), .description = description, .type = ScalarType::float32});
    };
    if (settings.normals)
        for (const std::string_view name : attribute_name::kNormal) add(name, "of the plane through the nearest points; 0 0 0: none");
    if (settings.density) add(attribute_name::kDensity, "points per square unit of surface");
    return attributes;
}

AttributeRanges estimate_surfaces(const Partition& partition, const OctreeFrame& frame, const Quantization& quantization,
                                  const RecordLayout& layout, const SurfaceSettings& settings, int threads, ChunkStore& store,
                                  const OnPoints& on_points) {
    return SurfacePass(partition, frame, quantization, layout, settings, store).run(threads, on_points);
}

uint64_t surface_memory_needed(uint64_t points) {
    // Two trees, one of them while its points are still gathered; values, and what is open.
    return kBlockBytes + points * (4 * sizeof(TreePoint) + 2 * 4 + 4 * 4 + sizeof(OpenPoint));
}

}  // namespace strata
