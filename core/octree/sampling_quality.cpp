#include "core/octree/sampling_quality.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>
#include <set>

#include "core/math/random.h"
#include "core/octree/neighbor_grid.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 4096;  // points a task

uint64_t key_hash(const NodeKey& key) {
    return mix_bits(mix_bits(mix_bits(mix_bits(key.level) ^ key.x) ^ key.y) ^ key.z);
}

/// Value at a fraction of the way through the sorted values; NaN of nothing. Reorders them.
double quantile(std::vector<float>& values, double fraction) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto at = values.begin() + std::ptrdiff_t(fraction * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// Measures one level after another of a cloud whose hierarchy is loaded.
class SamplingMeter {
public:
    SamplingMeter(const LayeredCloud& cloud, const SamplingSettings& settings)
        : cloud_(cloud), settings_(settings), root_box_(cloud.node(cloud.root()).bounds) {
        for (NodeId id = 0; id < cloud.node_count(); ++id) {
            const LayeredNode& node = cloud.node(id);
            if (node.child_count == 0) continue;
            if (inner_.size() <= node.key.level) inner_.resize(node.key.level + 1);
            inner_[node.key.level].emplace(node.key, id);
        }
        below_.resize(cloud.node_count());
        for (size_t id = cloud.node_count(); id-- > 1;)  // children come after their parents
            if (const NodeId parent = cloud.node(NodeId(id)).parent; parent != kNoNode)
                below_[parent] += below_[id] + cloud.node(NodeId(id)).points;
    }

    uint32_t level_count() const { return uint32_t(inner_.size()); }

    LevelSampling measure(uint32_t level) {
        LevelSampling result;
        result.level = level;
        const LayeredNode& any = cloud_.node(inner_[level].begin()->second);
        result.spacing = any.spacing;
        result.inner_nodes = inner_[level].size();
        for (const auto& [key, id] : inner_[level]) result.removed_total += below_[id];
        const double reach = std::min(kSamplingReach * any.spacing, any.bounds.size().maxCoeff());
        result.reach = reach / any.spacing;

        const auto [picked, kept_nodes] = pick(level, reach);
        result.measured_nodes = picked.size();
        std::vector<uint32_t> subjects;
        const std::vector<Vec3i> kept = load_kept(level, picked, kept_nodes, subjects);
        const NeighborGrid grid(kept, cloud_.info().quantization.scale, reach);

        std::vector<float> apart(subjects.size());
        parallel_blocks(settings_.threads, subjects.size(), kBlock, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i)
                apart[i] = float(grid.distance(kept[subjects[i]], subjects[i]) / result.spacing);
        });
        result.kept_points = apart.size();
        result.neighbor_min = quantile(apart, 0.0);
        result.neighbor_p5 = quantile(apart, 0.05);
        result.neighbor_median = quantile(apart, 0.5);

        std::vector<float> coverage = removed_distances(picked, grid, result.spacing);
        result.removed_points = coverage.size();
        result.coverage_p99 = quantile(coverage, 0.99);
        result.coverage_max = quantile(coverage, 1.0);
        return result;
    }

private:
    struct Pick {
        std::set<NodeKey> picked;       // inner nodes of the level whose points are measured
        std::vector<NodeId> kept_nodes;  // inner nodes of this level and above: all that lie within reach of those
    };

    /// The whole level where it fits into the budget, else nodes in the order of their hashes until it is spent.
    Pick pick(uint32_t level, double reach) const {
        Pick result;
        uint64_t kept = 0;
        for (uint32_t above = 0; above <= level; ++above)
            for (const auto& [key, id] : inner_[above]) {
                kept += cloud_.node(id).points;
                result.kept_nodes.push_back(id);
            }
        if (kept <= settings_.point_budget) {
            for (const auto& [key, id] : inner_[level]) result.picked.insert(key);
            return result;
        }
        std::vector<NodeKey> order;
        for (const auto& [key, id] : inner_[level]) order.push_back(key);
        std::sort(order.begin(), order.end(), [](const NodeKey& a, const NodeKey& b) {
            return std::pair(key_hash(a), a) < std::pair(key_hash(b), b);
        });
        std::set<NodeId> chosen;
        kept = 0;
        for (const NodeKey& key : order) {
            if (!result.picked.empty() && kept >= settings_.point_budget) break;
            for (const NodeId id : within_reach(key, reach))
                if (chosen.insert(id).second) kept += cloud_.node(id).points;
            result.picked.insert(key);
        }
        result.kept_nodes.assign(chosen.begin(), chosen.end());
        return result;
    }

    /// Inner nodes of the key's level and above whose cubes lie within `reach` of the key's cube. The reach is at most
    /// a node's side, so that there are at most 27 a level.
    std::vector<NodeId> within_reach(const NodeKey& key, double reach) const {
        std::vector<NodeId> found;
        const Box3d& bounds = cloud_.node(inner_[key.level].at(key)).bounds;
        for (uint32_t level = 0; level <= key.level; ++level) {
            const Vec3d side = root_box_.size() * std::ldexp(1.0, -int(level));
            int64_t low[3], high[3];
            for (int axis = 0; axis < 3; ++axis) {
                const double last = std::ldexp(1.0, int(level)) - 1.0;
                const double from = bounds.min[axis] - reach - root_box_.min[axis];
                const double to = bounds.max[axis] + reach - root_box_.min[axis];
                low[axis] = side[axis] > 0.0 ? int64_t(std::clamp(std::floor(from / side[axis]), 0.0, last)) : 0;
                high[axis] = side[axis] > 0.0 ? int64_t(std::clamp(std::floor(to / side[axis]), 0.0, last)) : 0;
            }
            for (int64_t x = low[0]; x <= high[0]; ++x)
                for (int64_t y = low[1]; y <= high[1]; ++y)
                    for (int64_t z = low[2]; z <= high[2]; ++z)
                        if (const auto node = inner_[level].find({level, uint32_t(x), uint32_t(y), uint32_t(z)});
                            node != inner_[level].end())
                            found.push_back(node->second);
        }
        return found;
    }

    /// The cell of a level that a point lies in; points on a border belong to the upper cell.
    NodeKey key_at(uint32_t level, const Vec3i& p_quanta) const {
        const Vec3d p = cloud_.info().quantization.world_from_quanta(p_quanta) - root_box_.min;
        uint32_t index[3];
        for (int axis = 0; axis < 3; ++axis) {
            const double cells = std::ldexp(1.0, int(level));
            const double side = root_box_.size()[axis];
            index[axis] = side > 0.0 ? uint32_t(std::clamp(std::floor(p[axis] / side * cells), 0.0, cells - 1.0)) : 0;
        }
        return {level, index[0], index[1], index[2]};
    }

    /// subjects  receives the indices of the points that count for the level
    std::vector<Vec3i> load_kept(uint32_t level, const std::set<NodeKey>& picked, std::span<const NodeId> nodes,
                                 std::vector<uint32_t>& subjects) const {
        std::vector<size_t> first(nodes.size() + 1);
        for (size_t i = 0; i < nodes.size(); ++i) first[i + 1] = first[i] + size_t(cloud_.node(nodes[i]).points);
        std::vector<Vec3i> kept(first.back());
        std::vector<uint8_t> counts(first.back());
        parallel_blocks(settings_.threads, nodes.size(), 4, [&](size_t begin, size_t end) {
            PointBatch batch;
            for (size_t i = begin; i < end; ++i) {
                cloud_.read_node(nodes[i], {}, batch);
                const LayeredNode& node = cloud_.node(nodes[i]);
                for (size_t p = 0; p < batch.size; ++p) {
                    const Vec3i at(batch.x[p], batch.y[p], batch.z[p]);
                    kept[first[i] + p] = at;
                    counts[first[i] + p] = picked.contains(node.key.level == level ? node.key : key_at(level, at));
                }
            }
        });
        for (size_t i = 0; i < counts.size(); ++i)
            if (counts[i]) subjects.push_back(uint32_t(i));
        return kept;
    }

    /// Distances, in spacings, of the points below the picked nodes; of nodes by hash where they exceed the budget.
    std::vector<float> removed_distances(const std::set<NodeKey>& picked, const NeighborGrid& grid, double spacing) const {
        std::vector<NodeId> below;
        uint64_t total = 0;
        for (const NodeKey& key : picked) {
            const size_t first = below.size();
            const auto add_children = [&](const LayeredNode& node) {
                for (uint32_t child = 0; child < node.child_count; ++child) below.push_back(node.first_child + child);
            };
            add_children(cloud_.node(inner_[key.level].at(key)));
            for (size_t i = first; i < below.size(); ++i) add_children(cloud_.node(below[i]));
            total += below_[inner_[key.level].at(key)];
        }
        if (total > settings_.point_budget) {
            const double share = double(settings_.point_budget) / double(total);
            std::erase_if(below, [&](NodeId id) { return double(key_hash(cloud_.node(id).key)) * 0x1p-64 >= share; });
        }
        std::mutex mutex;
        std::vector<float> distances;
        parallel_blocks(settings_.threads, below.size(), 4, [&](size_t begin, size_t end) {
            PointBatch batch;
            std::vector<float> own;
            for (size_t i = begin; i < end; ++i) {
                cloud_.read_node(below[i], {}, batch);
                for (size_t p = 0; p < batch.size; ++p)
                    own.push_back(float(grid.distance({batch.x[p], batch.y[p], batch.z[p]}) / spacing));
            }
            const std::lock_guard lock(mutex);
            distances.insert(distances.end(), own.begin(), own.end());
        });
        return distances;
    }

    const LayeredCloud& cloud_;
    const SamplingSettings& settings_;
    Box3d root_box_;
    std::vector<std::map<NodeKey, NodeId>> inner_;  // a level each
    std::vector<uint64_t> below_;                   // points below a node
};

}  // namespace

std::vector<LevelSampling> measure_sampling(LayeredCloud& cloud, const SamplingSettings& settings) {
    for (size_t id = 0; id < cloud.node_count(); ++id)
        cloud.load_children(NodeId(id));
    std::vector<LevelSampling> levels;
    if (cloud.node_count() == 0) return levels;
    SamplingMeter meter(cloud, settings);
    for (uint32_t level = 0; level < meter.level_count(); ++level) levels.push_back(meter.measure(level));
    return levels;
}

}  // namespace strata
