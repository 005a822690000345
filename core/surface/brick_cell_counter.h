#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/brick_cells.h"

namespace strata {

/// Finds cells, and counts what the surfaces in them will have.
class BrickCellCounter {
public:
    /// make_room  as BrickLayerWindow's
    BrickCellCounter(const FieldBrickSource& source, const ContourSettings& settings, const BrickLevels& levels,
                     std::function<void(uint64_t bytes, bool must)> make_room)
        : source_(source), settings_(settings), levels_(levels), make_room_(std::move(make_room)) {}

    /// below  the cells of the layer below, if it has any
    std::optional<BrickCells> count(int32_t k, const MaskedLayers& layers, const BrickCells* below);
    /// Takes cells for their memory.
    void give_back(BrickCells cells) { spare_ = std::move(cells); }

    /// Bytes that it keeps for each brick of the last layer.
    uint64_t bytes() const { return before_.size() * sizeof before_[0]; }
    uint64_t ambiguous_cells() const { return ambiguous_; }
    uint64_t tunnel_cells() const { return tunnels_; }
    bool is_open() const { return is_open_; }  // somewhere, at NaN

private:
    void find_whole(BrickCells& cells, const MaskedLayers& layers, const BrickCells* below);
    bool leave_out_unused(BrickCells& cells, const BrickCells* below, size_t isovalue, size_t brick) const;

    const FieldBrickSource& source_;
    const ContourSettings& settings_;
    const BrickLevels& levels_;
    std::function<void(uint64_t, bool)> make_room_;
    const SimdLevel simd_level_ = best_simd_level();
    BrickCells spare_;
    std::vector<AroundBrick> before_;  // of cells with NaN: the bricks below along any axes
    uint64_t ambiguous_ = 0, tunnels_ = 0;
    bool is_open_ = false;
};

}  // namespace strata
