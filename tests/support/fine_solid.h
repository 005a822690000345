#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace strata {

/// Topology of where the trilinear interpolant of samples is positive or 0, told by nothing but its values at many places.
struct SolidTopology {
    int64_t euler = 0;
    uint64_t parts = 0, parts_outside = 0;  // outside counts what is around the grid
    bool operator==(const SolidTopology&) const = default;
};

/// size        samples an axis, at least 2
/// refinement  places along a cell's side
/// returns     nothing where that many places do not tell: where it matters whether places that meet at an edge or corner are together
std::optional<SolidTopology> solid_topology(const std::array<uint32_t, 3>& size, std::span<const float> values, int refinement);

}  // namespace strata
