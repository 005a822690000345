#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/surface/triangle_mesh.h"

namespace strata {

/// Takes vertices without a finite position out of a mesh, and the triangles that use them; a line of `notes` counts both.
/// nowhere  their indices, ascending
void remove_nowhere(TriangleMesh& mesh, std::span<const uint32_t> nowhere, std::vector<std::string>& notes);

}  // namespace strata
