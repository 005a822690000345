#include "core/cloud/neighbor_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/parallel.h"

namespace strata {
namespace {

bool before(const Vec3i& a, const Vec3i& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

// How far the neighbors of a leaf's points lie, in most cases: k points of a surface as dense as the leaf's, or of a
// line, and half as much again. Where it is not enough, the search costs more, and that is all.
double expected_reach_squared(const NeighborTree::Node& leaf, const Vec3d& scale, uint32_t k) {
    Vec3d size = (leaf.max.cast<double>() - leaf.min.cast<double>()).cwiseProduct(scale);
    std::sort(size.data(), size.data() + 3);
    const double share = double(k) / double(leaf.end - leaf.begin);
    const double surface = size[2] * size[1] * share / std::numbers::pi;
    const double line = 0.5 * size[2] * share;
    return 2.0 * std::max(surface, line * line);
}

constexpr double kReachFactor = 2.2;  // to the mean square of the last leaf's radii
constexpr uint32_t kMostMisses = 4;
constexpr double kExactInFloat = 0x1p23;  // quanta: differences of two of these are exact too
// A square in float is at most 7 * 2^-24 off: of the scale and its product, each twice, the square, two sums.
constexpr double kFloatMargin = 1.0 + 0x1p-20;

}  // namespace

bool NeighborSearch::Neighbor::operator<(const Neighbor& other) const {
    if (distance_squared != other.distance_squared) return distance_squared < other.distance_squared;
    return before(position, other.position);
}

NeighborSearch::NeighborSearch(const NeighborTree& tree, uint32_t k) : tree_(tree), k_(k) {
    assert(k >= 1);
    nearest_.reserve(k + 1);
    positions_.reserve(k);
    candidates_.reserve(kMostCandidates);
    for (std::vector<float>& axis : local_) axis.resize(kMostCandidates);
    distances_.resize(kMostCandidates);
    chosen_.resize(kMostCandidates + 1);
    squares_.resize(kMostCandidates);
}

void NeighborSearch::offer(const Vec3i& center, const Vec3i& position) {
    const Neighbor neighbor{squared_distance(center, position, tree_.scale()), position};
    if (neighbor.distance_squared > bound_squared_) return;
    if (nearest_.size() == k_) {
        if (!(neighbor < nearest_.front())) return;
        std::pop_heap(nearest_.begin(), nearest_.end());
        nearest_.back() = neighbor;
    } else {
        nearest_.push_back(neighbor);
    }
    std::push_heap(nearest_.begin(), nearest_.end());
}

// The nearer child first; a box as far as the farthest neighbor may hold one that wins by its position.
void NeighborSearch::search(const Vec3i& center, uint32_t index) {
    const NeighborTree::Node& node = tree_.nodes()[index];
    if (node.is_leaf()) {
        const auto points = tree_.points_of(node);
        const size_t n = node.is_single_position() ? std::min<size_t>(points.size(), k_) : points.size();
        for (size_t i = 0; i < n; ++i) offer(center, points[i].position);
        return;
    }
    uint32_t children[2] = {node.children, node.children + 1};
    double distance[2];
    for (int i = 0; i < 2; ++i) {
        const NeighborTree::Node& child = tree_.nodes()[children[i]];
        distance[i] = squared_distance(center, center, child.min, child.max, tree_.scale());
    }
    if (distance[1] < distance[0]) {
        std::swap(children[0], children[1]);
        std::swap(distance[0], distance[1]);
    }
    for (int i = 0; i < 2; ++i)
        if (distance[i] <= farthest()) search(center, children[i]);
}

Neighborhood NeighborSearch::found(const Vec3i& center) {
    positions_.clear();
    for (const Neighbor& neighbor : nearest_) positions_.push_back(neighbor.position);
    answer_ = {center, positions_, nearest_.empty() ? 0.0 : nearest_.front().distance_squared};
    return answer_;
}

Neighborhood NeighborSearch::nearest(const Vec3i& center, std::span<const Vec3i> known, double bound_squared) {
    nearest_.clear();
    bound_squared_ = bound_squared;
    for (const Vec3i& position : known) offer(center, position);
    if (!tree_.nodes().empty()) search(center, 0);
    return found(center);
}

// All points within reach of the leaf's box, unless they are too many to be worth it.
void NeighborSearch::gather(double reach_squared) {
    reach_squared_ = guess_squared_ = reach_squared;
    gathered_ = false;
    candidates_.clear();
    stack_.assign(1, 0);
    while (!stack_.empty()) {
        const NeighborTree::Node& node = tree_.nodes()[stack_.back()];
        stack_.pop_back();
        if (squared_distance(leaf_->min, leaf_->max, node.min, node.max, tree_.scale()) > reach_squared_) continue;
        if (!node.is_leaf()) {
            stack_.push_back(node.children);
            stack_.push_back(node.children + 1);
            continue;
        }
        const auto points = tree_.points_of(node);
        const size_t n = node.is_single_position() ? std::min<size_t>(points.size(), k_) : points.size();
        if (candidates_.size() + n > kMostCandidates) return;
        for (size_t i = 0; i < n; ++i) candidates_.push_back(points[i].position);
    }
    for (int axis = 0; axis < 3; ++axis) {
        float* local = local_[size_t(axis)].data();
        int64_t widest = 0;
        for (size_t i = 0; i < candidates_.size(); ++i) {
            const int64_t apart = int64_t{candidates_[i][axis]} - leaf_->min[axis];
            widest = std::max(widest, std::abs(apart));
            local[i] = float(apart);
        }
        if (widest > kExactInFloat) return;
    }
    drop_far_candidates();
    gathered_ = candidates_.size() >= k_;
}

// Leaves reach farther than their points that matter.
void NeighborSearch::drop_far_candidates() {
    const Vec3f scale = unit_scale(), size = (leaf_->max - leaf_->min).cast<float>();
    const size_t n = candidates_.size();
    std::fill_n(distances_.begin(), n, 0.0f);
    for (int axis = 0; axis < 3; ++axis) {
        const float* __restrict local = local_[size_t(axis)].data();
        float* __restrict out = distances_.data();
        const float high = size[axis], unit = scale[axis];
        for (size_t i = 0; i < n; ++i) {
            const float apart = std::max(std::max(-local[i], local[i] - high), 0.0f) * unit;
            out[i] += apart * apart;
        }
    }
    const float limit = float_limit(reach_squared_);
    size_t kept = 0;
    for (size_t i = 0; i < n; ++i) {
        candidates_[kept] = candidates_[i];
        for (std::vector<float>& local : local_) local[kept] = local[i];
        kept += distances_[i] <= limit;
    }
    candidates_.resize(kept);
}

void NeighborSearch::start_leaf(const NeighborTree::Node& leaf) {
    leaf_ = &leaf;
    answer_ = {};
    misses_ = 0;
    widest_squared_ = expected_reach_squared(leaf, tree_.scale(), k_);
    const double as_before = radius_count_ > 0 ? kReachFactor * radius_sum_ / radius_count_ : widest_squared_;
    radius_sum_ = 0.0;
    radius_count_ = 0;
    gather(std::min(as_before, widest_squared_));
}

// Floats count in the largest scale, so that neither large nor small scales leave their range.
Vec3f NeighborSearch::unit_scale() const { return (tree_.scale() / tree_.scale().maxCoeff()).cast<float>(); }

// What is within the bound is within this, as floats have it.
float NeighborSearch::float_limit(double bound_squared) const {
    const double unit = tree_.scale().maxCoeff();
    return float(bound_squared / (unit * unit) * kFloatMargin) + std::numeric_limits<float>::min();
}

void NeighborSearch::measure(const Vec3i& center) {
    const Vec3f p = (center - leaf_->min).cast<float>(), scale = unit_scale();
    const float px = p.x(), py = p.y(), pz = p.z(), scale_x = scale.x(), scale_y = scale.y(), scale_z = scale.z();
    const float* __restrict x = local_[0].data();
    const float* __restrict y = local_[1].data();
    const float* __restrict z = local_[2].data();
    float* __restrict out = distances_.data();
    const size_t n = candidates_.size();
    for (size_t i = 0; i < n; ++i) {
        const float dx = (x[i] - px) * scale_x, dy = (y[i] - py) * scale_y, dz = (z[i] - pz) * scale_z;
        out[i] = dx * dx + dy * dy + dz * dz;
    }
}

// The rare case that points equally far are on both sides of the border.
void NeighborSearch::break_ties() {
    std::vector<Neighbor> all(chosen_count_);
    for (size_t i = 0; i < chosen_count_; ++i) all[i] = {squares_[i], candidates_[chosen_[i]]};
    std::nth_element(all.begin(), all.begin() + (k_ - 1), all.end());
    for (uint32_t i = 0; i < k_; ++i) positions_.push_back(all[i].position);
    answer_.radius_squared = all[k_ - 1].distance_squared;
}

// The k nearest of the chosen, which are k or more. On a surface their squares are spread evenly, so that a few steps of
// interpolation find a square with just k below it.
void NeighborSearch::keep_nearest(double bound_squared) {
    double low = 0.0, high = bound_squared, at = high;
    size_t below_low = 0, below_high = chosen_count_, below = chosen_count_;
    const double* squares = squares_.data();
    constexpr int kMostSteps = 12;
    for (int step = 0; below != k_; ++step) {
        if (step == kMostSteps) return break_ties();
        at = low + (high - low) * (double(k_ - below_low) + 0.25) / (double(below_high - below_low) + 0.5);
        below = 0;
        for (size_t i = 0; i < chosen_count_; ++i) below += squares[i] <= at;
        (below < k_ ? low : high) = at;
        (below < k_ ? below_low : below_high) = below;
    }
    double farthest = 0.0;
    for (size_t i = 0; i < chosen_count_; ++i) {
        if (squares[i] > at) continue;
        farthest = std::max(farthest, squares[i]);
        positions_.push_back(candidates_[chosen_[i]]);
    }
    answer_.radius_squared = farthest;
}

// Whether the k nearest lie within the bound: then they are the answer.
bool NeighborSearch::select(const Vec3i& center, double bound_squared) {
    const float limit = float_limit(bound_squared);
    size_t count = 0;
    const float* distances = distances_.data();
    uint32_t* chosen = chosen_.data();
    for (size_t i = 0, n = candidates_.size(); i < n; ++i) {
        chosen[count] = uint32_t(i);
        count += distances[i] <= limit;
    }
    if (count < k_) return false;
    size_t within = 0;
    for (size_t i = 0; i < count; ++i) {
        const double square = squared_distance(center, candidates_[chosen[i]], tree_.scale());
        squares_[within] = square;
        chosen[within] = chosen[i];
        within += square <= bound_squared;
    }
    chosen_count_ = within;
    if (within < k_) return false;
    answer_.center = center;
    positions_.clear();
    keep_nearest(bound_squared);
    answer_.points = positions_;
    return true;
}

Neighborhood NeighborSearch::nearest_in_leaf(const Vec3i& center) {
    if (!answer_.points.empty() && answer_.center == center) return answer_;  // points that coincide lie together
    if (gathered_) {
        measure(center);
        if (select(center, guess_squared_) || select(center, reach_squared_)) {
            radius_sum_ += answer_.radius_squared;
            ++radius_count_;
            guess_squared_ = std::min(1.5 * answer_.radius_squared, reach_squared_);  // of the next, which is near
            return answer_;
        }
        if (++misses_ == kMostMisses && reach_squared_ < widest_squared_) gather(widest_squared_);
    }
    return nearest(center);
}

void for_each_neighborhood(const NeighborTree& tree, uint32_t k, int threads,
                           const std::function<void(const TreePoint&, const Neighborhood&)>& visit) {
    constexpr size_t kLeavesAtOnce = 256;
    parallel_blocks(threads, tree.leaves().size(), kLeavesAtOnce, [&](size_t begin, size_t end) {
        NeighborSearch search(tree, k);
        for (const uint32_t index : tree.leaves().subspan(begin, end - begin)) {
            const NeighborTree::Node& leaf = tree.nodes()[index];
            search.start_leaf(leaf);
            for (const TreePoint& point : tree.points_of(leaf)) visit(point, search.nearest_in_leaf(point.position));
        }
    });
}

}  // namespace strata
