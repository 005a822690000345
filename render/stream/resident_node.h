#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "render/image.h"

namespace strata {

/// The points of one node, ready to draw or to be cut. 16 bytes a point, one more with a filter.
struct ResidentNode {
    std::vector<int32_t> x, y, z;  // quanta of the cloud
    std::vector<Rgba8> colors;
    Vec3i min_quanta = Vec3i::Zero(), max_quanta = Vec3i::Zero();  // of the points
    std::vector<uint8_t> passes;   // the filter; empty: all pass
    float spacing = 0.0f;  // world units: how far its points lie apart, with those of its ancestors

    size_t size() const { return x.size(); }
};

/// Point spacing within a node where drawn descendants make it finer, in 8 x 8 x 8 cells of the node's box.
struct SpacingGrid {
    static constexpr int kSide = 8;

    float at(int32_t x, int32_t y, int32_t z) const {
        return cells[size_t((cell(x, 0) * kSide + cell(y, 1)) * kSide + cell(z, 2))];
    }
    int cell(int32_t quanta, int axis) const {
        const float c = (float(quanta) - origin[size_t(axis)]) * cells_per_quantum[size_t(axis)];
        return int(std::min(std::max(c, 0.0f), float(kSide - 1)));
    }

    std::array<float, 3> origin, cells_per_quantum;
    std::array<float, size_t(kSide) * kSide * kSide> cells;
};

}  // namespace strata
