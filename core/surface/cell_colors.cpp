#include "core/surface/cell_colors.h"

#include <cmath>

#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 4096;  // vertices a thread takes at a time

GridPlacement centers(const VoxelTree& tree, int depth) {
    const double cell = tree.frame.voxel_size * std::ldexp(1.0, tree.frame.depth() - depth);
    return {.origin = tree.frame.origin + Vec3d::Constant(0.5 * cell), .axes = cell * Mat3d::Identity()};
}

}  // namespace

CellColorsAtVertices::CellColorsAtVertices(const VoxelTree& tree, int depth, int threads) : tree_(tree), depth_(depth), threads_(threads), places_(centers(tree, depth)) {}

bool CellColorsAtVertices::has_colors(const VoxelTree& tree, int depth) {
    return !tree.empty() && size_t(depth) < tree.attributes.size() && !tree.attributes[size_t(depth)].colors.empty();
}

const VoxelColor* CellColorsAtVertices::color_of(int64_t x, int64_t y, int64_t z) const {
    const int64_t side = int64_t{1} << depth_;
    for (const int64_t c : {x, y, z})
        if (c < 0 || c >= side) return nullptr;
    const uint64_t code = octant_code(uint32_t(x), uint32_t(y), uint32_t(z));
    uint32_t node = 0;
    for (int level = 0;; ++level) {
        const VoxelLevel& nodes = tree_.levels[size_t(level)];
        const int below = depth_ - 2 * (level + 1);  // depths between this level's finer cells and those asked for
        if (below < 0) {  // the node's eight coarser cells
            const int byte = int(code & 7);
            if ((nodes.masks[node] >> 8 * byte & 0xFF) == 0) return nullptr;
            return &tree_.attributes[size_t(depth_)].colors[cell_index(tree_, level, node, 8 * byte, true)];
        }
        const int bit = int(code >> 3 * below & 63);
        if ((nodes.masks[node] >> bit & 1) == 0) return nullptr;
        const bool full = (nodes.full_mask(node) >> bit & 1) != 0;
        if (below == 0 || full) {  // cells in a full one are what it is
            const auto& colors = tree_.attributes[size_t(2 * level + 2)].colors;
            return colors.empty() ? nullptr : &colors[cell_index(tree_, level, node, bit, false)];
        }
        node = nodes.child(node, bit);
    }
}

void CellColorsAtVertices::look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<std::array<uint8_t, 4>> out) {
    parallel_blocks(threads_, positions.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t v = begin; v < end; ++v) {
            Vec3d sum = Vec3d::Zero();
            double known = 0.0;
            visit_corners(places_.index_of(origin, positions[v]), [&](int64_t x, int64_t y, int64_t z, double weight) {
                const VoxelColor* const color = color_of(x, y, z);
                if (!color) return;
                sum += weight * Vec3d((*color)[0], (*color)[1], (*color)[2]);
                known += weight;
            });
            out[v] = kNoColor;
            if (known > 0.0)
                for (size_t part = 0; part < 3; ++part) out[v][part] = uint8_t(sum[int(part)] / known + 0.5);
        }
    });
}

}  // namespace strata
