#include "render/voxel_model.h"

namespace strata {
namespace {

template <typename T>
uint64_t bytes_of(const std::vector<T>& values) {
    return values.size() * sizeof(T);
}

}  // namespace

uint64_t size_bytes(const VoxelTree& tree) {
    uint64_t bytes = 0;
    for (const VoxelLevel& level : tree.levels) bytes += bytes_of(level.masks) + bytes_of(level.full) + bytes_of(level.first_child);
    for (const CellAttributes& cells : tree.attributes)
        bytes += bytes_of(cells.counts) + bytes_of(cells.colors) + bytes_of(cells.normals) + bytes_of(cells.opacities);
    for (const auto* before : {&tree.cells_before_odd, &tree.cells_before_even})
        for (const std::vector<uint32_t>& level : *before) bytes += bytes_of(level);
    return bytes;
}

}  // namespace strata
