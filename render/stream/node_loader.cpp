#include "render/stream/node_loader.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <memory>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

void find_extent(ResidentNode& node) {
    const auto extent = [&](const std::vector<int32_t>& values, int axis) {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        node.min_quanta[axis] = *low;
        node.max_quanta[axis] = *high;
    };
    if (node.size() == 0) return;
    extent(node.x, 0);
    extent(node.y, 1);
    extent(node.z, 2);
}

// Within inner nodes the sampling rule gives the spacing. Leaves hold what is left, at any density: there it is measured,
// but never above the parent's, since the parent's points already lie that near to all points of the leaf.
double spacing_of(const LayeredCloud& cloud, NodeId id, const ResidentNode& points) {
    const LayeredNode& node = cloud.node(id);
    if (node.child_count > 0 || node.children_pending) return node.spacing;
    const double most = node.parent != kNoNode ? cloud.node(node.parent).spacing : 4.0 * node.spacing;
    const double measured = measure_spacing(points.x, points.y, points.z, cloud.info().quantization.scale);
    // They lie at random there: a quarter more brings the gaps between splats from 4 % to 1 %, e^(-1.25^2 pi).
    return measured > 0.0 ? std::min(1.25 * measured, most) : most;
}

}  // namespace

double measure_spacing(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z,
                       const Vec3d& scale) {
    constexpr int kFinest = 64;        // cells an axis
    constexpr double kPointsCell = 6;  // enough that an occupied cell is seldom missed: e^-6
    if (x.size() < 2) return 0.0;
    const auto extent = [](std::span<const int32_t> values) {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        return std::pair(*low, double(int64_t{*high} - *low));
    };
    const auto [x_low, x_size] = extent(x);
    const auto [y_low, y_size] = extent(y);
    const auto [z_low, z_size] = extent(z);
    const double side = std::max({x_size * scale.x(), y_size * scale.y(), z_size * scale.z()});
    if (!(side > 0.0)) return 0.0;

    const double to_cells = kFinest / (side * (1.0 + 1e-9));
    auto occupied = std::make_unique<std::bitset<size_t{kFinest} * kFinest * kFinest>>();
    const auto cell = [&](int32_t value, int32_t low, double quantum) {
        return std::min<size_t>(size_t(double(int64_t{value} - low) * quantum * to_cells), kFinest - 1);
    };
    for (size_t i = 0; i < x.size(); ++i)
        occupied->set((cell(x[i], x_low, scale.x()) * kFinest + cell(y[i], y_low, scale.y())) * kFinest +
                      cell(z[i], z_low, scale.z()));
    double spacing = 0.0;
    for (int cells = kFinest; cells >= 1; cells /= 2) {
        const double points_cell = double(x.size()) / double(occupied->count());
        spacing = side / cells / std::sqrt(points_cell);
        if (points_cell >= kPointsCell || cells == 1) break;
        // Two by two by two cells into one; the lower index is read before it is overwritten.
        auto coarser = std::make_unique<std::bitset<size_t{kFinest} * kFinest * kFinest>>();
        for (size_t i = occupied->_Find_first(); i < occupied->size(); i = occupied->_Find_next(i)) {
            const size_t cx = i / (kFinest * kFinest), cy = i / kFinest % kFinest, cz = i % kFinest;
            coarser->set((cx / 2 * kFinest + cy / 2) * kFinest + cz / 2);
        }
        occupied = std::move(coarser);
    }
    return spacing;
}

std::vector<ResidentNode> load_nodes(const LayeredCloud& cloud, std::span<const NodeId> nodes, const PointColorizer& colors,
                                     const PointFilter& filter, int threads, LoadFailures& failures) {
    std::vector<int> wanted(colors.wanted().begin(), colors.wanted().end());
    for (const int attribute : filter.wanted())
        if (std::find(wanted.begin(), wanted.end(), attribute) == wanted.end()) wanted.push_back(attribute);
    std::vector<ResidentNode> loaded(nodes.size());
    size_t first_failed = nodes.size();
    std::mutex failures_mutex;
    parallel_blocks(threads, nodes.size(), 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t i = begin; i < end; ++i) {
            ResidentNode& node = loaded[i];
            try {
                cloud.read_node(nodes[i], wanted, batch);
            } catch (const Error& error) {
                const std::lock_guard lock(failures_mutex);
                ++failures.count;
                if (i < first_failed) {
                    first_failed = i;
                    failures.first = error.what();
                }
                continue;
            }
            node.colors.resize(batch.size);
            colors.color(batch, cloud.node(nodes[i]).key.level, node.colors);
            if (!filter.everything()) {
                node.passes.assign(batch.size, 1);
                filter.test(batch, cloud.node(nodes[i]).key.level, node.passes);
            }
            node.x = std::move(batch.x);
            node.y = std::move(batch.y);
            node.z = std::move(batch.z);
            find_extent(node);
            node.spacing = float(spacing_of(cloud, nodes[i], node));
        }
    });
    return loaded;
}

std::vector<std::unique_ptr<SpacingGrid>> build_spacing_grids(const LayeredCloud& cloud, std::span<const NodeId> nodes,
                                                              std::span<const ResidentNode> points) {
    constexpr int kSide = SpacingGrid::kSide;
    constexpr size_t kNoSlot = ~size_t{0};
    constexpr int kGenerations = 3;  // 2^3 cells an axis
    std::vector<size_t> slot_of(cloud.node_count(), kNoSlot);
    for (size_t slot = 0; slot < nodes.size(); ++slot) slot_of[nodes[slot]] = slot;

    std::vector<std::unique_ptr<SpacingGrid>> grids(nodes.size());
    const Quantization& quantization = cloud.info().quantization;
    for (size_t slot = 0; slot < nodes.size(); ++slot) {
        if (points[slot].size() == 0) continue;  // shows nothing, so it makes nothing finer
        const Box3d& box = cloud.node(nodes[slot]).bounds;
        NodeId ancestor = cloud.node(nodes[slot]).parent;
        // Coarser levels come first in key order, so that the finest has the last word.
        for (int generation = 0; generation < kGenerations && ancestor != kNoNode; ++generation) {
            const size_t ancestor_slot = slot_of[ancestor];
            const Box3d& outer = cloud.node(ancestor).bounds;
            std::unique_ptr<SpacingGrid>& grid = grids[ancestor_slot];
            if (!grid) {
                grid = std::make_unique<SpacingGrid>();
                grid->cells.fill(points[ancestor_slot].spacing);
                for (int axis = 0; axis < 3; ++axis) {
                    const size_t a = size_t(axis);
                    const double scale = quantization.scale[axis], size = outer.size()[axis];
                    grid->origin[a] = float((outer.min[axis] - quantization.offset[axis]) / scale);
                    grid->cells_per_quantum[a] = size > 0.0 ? float(kSide * scale / size) : 0.0f;
                }
            }
            // Cells whose centers lie in the box.
            int low[3], high[3];
            for (int axis = 0; axis < 3; ++axis) {
                const double size = outer.size()[axis];
                const double to_cells = size > 0.0 ? kSide / size : 0.0;
                low[axis] = std::clamp(int(std::ceil((box.min[axis] - outer.min[axis]) * to_cells - 0.5)), 0, kSide);
                high[axis] = size > 0.0
                                 ? std::clamp(int(std::ceil((box.max[axis] - outer.min[axis]) * to_cells - 0.5)), 0, kSide)
                                 : kSide;
            }
            for (int x = low[0]; x < high[0]; ++x)
                for (int y = low[1]; y < high[1]; ++y)
                    for (int z = low[2]; z < high[2]; ++z) {
                        float& cell = grid->cells[size_t((x * kSide + y) * kSide + z)];
                        cell = std::min(cell, points[slot].spacing);
                    }
            ancestor = cloud.node(ancestor).parent;
        }
    }
    return grids;
}

}  // namespace strata
