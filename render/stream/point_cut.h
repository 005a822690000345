#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cloud/clip_box.h"
#include "render/stream/resident_node.h"

namespace strata {

/// What filter and clip boxes leave of a node: a copy of its points, so that whoever draws need not know of cuts. Its
/// points keep the shapes that they have in the whole node.
struct CutNode {
    ResidentNode points;
    std::vector<uint32_t> indices;  // of the points in the whole node, ascending
};
inline constexpr uint64_t kCutPointBytes = kResidentPointBytes + sizeof(uint32_t);  // of a copy, a point; normals are more

/// How much of a node is left: by its points, not by its box.
Coverage coverage(const ResidentNode& node, const ClipRegion& clip);

/// cost  1 ns a point and 5 ns for each that is left
CutNode cut_node(const ResidentNode& node, const ClipRegion& clip);

}  // namespace strata
