#include "render/reference/neighbor_tree.h"

#include <algorithm>
#include <numeric>

#include "core/math/box.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kLeafPoints = 12;  // looked at one by one

}  // namespace

NeighborTree::NeighborTree(std::span<const Vec3d> points, int threads)
    : points_(points.begin(), points.end()), order_(points.size()), axes_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    // The upper splits one after another, then what is below them side by side.
    std::vector<std::pair<size_t, size_t>> ranges = {{0, points.size()}};
    for (int level = 0; level < 5; ++level) {
        std::vector<std::pair<size_t, size_t>> halves;
        for (const auto& [begin, end] : ranges) {
            if (end - begin <= kLeafPoints) continue;
            const size_t middle = split(begin, end);
            halves.insert(halves.end(), {{begin, middle}, {middle + 1, end}});
        }
        ranges = std::move(halves);
    }
    parallel_blocks(threads, ranges.size(), 1, [&](size_t first, size_t last) {
        for (size_t i = first; i < last; ++i) build(ranges[i].first, ranges[i].second);
    });
    for (size_t i = 0; i < points.size(); ++i) points_[i] = points[order_[i]];
}

// Puts the median along the longest side of the range's box in its middle. Works on order_; points_ is not sorted yet.
size_t NeighborTree::split(size_t begin, size_t end) {
    Box3d box;
    for (size_t i = begin; i < end; ++i) box.extend(points_[order_[i]]);
    int axis = 0;
    box.size().maxCoeff(&axis);
    const size_t middle = begin + (end - begin) / 2;
    const auto at = [&](size_t i) { return order_.begin() + std::ptrdiff_t(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](uint32_t a, uint32_t b) {
        return points_[a][axis] < points_[b][axis] || (points_[a][axis] == points_[b][axis] && a < b);
    });
    axes_[middle] = uint8_t(axis);
    return middle;
}

void NeighborTree::build(size_t begin, size_t end) {
    if (end - begin <= kLeafPoints) return;
    const size_t middle = split(begin, end);
    build(begin, middle);
    build(middle + 1, end);
}

void NeighborTree::nearest(const Vec3d& p, size_t count, std::vector<Neighbor>& out) const {
    out.clear();
    if (count > 0) visit(0, points_.size(), p, count, out);
    std::sort_heap(out.begin(), out.end());
}

void NeighborTree::visit(size_t begin, size_t end, const Vec3d& p, size_t count, std::vector<Neighbor>& heap) const {
    const auto offer = [&](size_t i) {
        const Neighbor neighbor{(points_[i] - p).squaredNorm(), order_[i]};
        if (heap.size() == count) {
            if (!(neighbor < heap.front())) return;
            std::pop_heap(heap.begin(), heap.end());
            heap.pop_back();
        }
        heap.push_back(neighbor);
        std::push_heap(heap.begin(), heap.end());
    };
    if (end - begin <= kLeafPoints) {
        for (size_t i = begin; i < end; ++i) offer(i);
        return;
    }
    const size_t middle = begin + (end - begin) / 2;
    const double beyond = p[axes_[middle]] - points_[middle][axes_[middle]];
    const bool below = beyond < 0.0;
    visit(below ? begin : middle + 1, below ? middle : end, p, count, heap);
    offer(middle);
    if (heap.size() < count || beyond * beyond <= heap.front().square)
        visit(below ? middle + 1 : begin, below ? end : middle, p, count, heap);
}

}  // namespace strata
