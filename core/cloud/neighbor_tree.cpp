#include "core/cloud/neighbor_tree.h"

#include <algorithm>

namespace strata {

NeighborTree::NeighborTree(std::vector<TreePoint> points, const Vec3d& scale) : scale_(scale), points_(std::move(points)) {
    if (points_.empty()) return;
    nodes_.reserve(points_.size() / (kLeafPoints / 4) + 1);
    add_node(0, uint32_t(points_.size()));
    split(0);
}

uint32_t NeighborTree::add_node(uint32_t begin, uint32_t end) {
    Node node{.min = points_[begin].position, .max = points_[begin].position, .begin = begin, .end = end};
    for (const TreePoint& point : points_of(node)) {
        node.min = node.min.cwiseMin(point.position);
        node.max = node.max.cwiseMax(point.position);
    }
    nodes_.push_back(node);
    return uint32_t(nodes_.size()) - 1;
}

// By the middle point along the longest side: the depth is log2(n), however the points lie.
void NeighborTree::split(uint32_t index) {
    const Node node = nodes_[index];
    if (node.end - node.begin <= kLeafPoints || node.is_single_position()) return leaves_.push_back(index);
    int axis = 0;
    (node.max.cast<double>() - node.min.cast<double>()).cwiseProduct(scale_).maxCoeff(&axis);
    const uint32_t middle = node.begin + (node.end - node.begin) / 2;
    std::nth_element(points_.begin() + node.begin, points_.begin() + middle, points_.begin() + node.end,
                     [axis](const TreePoint& a, const TreePoint& b) { return a.position[axis] < b.position[axis]; });
    const uint32_t children = nodes_[index].children = add_node(node.begin, middle);
    add_node(middle, node.end);
    split(children);
    split(children + 1);
}

}  // namespace strata
