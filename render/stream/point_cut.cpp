#include "render/stream/point_cut.h"

namespace strata {

Coverage coverage(const ResidentNode& node, const ClipRegion& clip) {
    if (node.size() == 0) return Coverage::whole;
    const Coverage clipped = clip.coverage(node.min_quanta, node.max_quanta);
    return clipped == Coverage::whole && !node.passes.empty() ? Coverage::part : clipped;
}

CutNode cut_node(const ResidentNode& node, const ClipRegion& clip) {
    std::vector<uint8_t> left(node.size());
    clip.test(node.x, node.y, node.z, left);
    for (size_t i = 0; i < node.passes.size(); ++i) left[i] &= node.passes[i];

    CutNode cut;
    for (size_t i = 0; i < left.size(); ++i)
        if (left[i] != 0) cut.indices.push_back(uint32_t(i));
    const auto gather = [&](const auto& from, auto& to) {
        to.resize(cut.indices.size());
        for (size_t i = 0; i < to.size(); ++i) to[i] = from[cut.indices[i]];
    };
    gather(node.x, cut.points.x);
    gather(node.y, cut.points.y);
    gather(node.z, cut.points.z);
    gather(node.colors, cut.points.colors);
    if (!node.normals.empty()) gather(node.normals, cut.points.normals);
    if (!node.shapes.empty()) gather(node.shapes, cut.points.shapes);
    cut.points.min_quanta = node.min_quanta;
    cut.points.max_quanta = node.max_quanta;
    return cut;
}

}  // namespace strata
