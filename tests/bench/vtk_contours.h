#pragma once

#include <cstdint>

namespace strata {

/// The zero of a cube of samples by VTK, without normals; returns its triangles. The headers of VTK are not C++20.
uint64_t flying_edges(const float* values, int samples, int threads);
uint64_t vtk_marching_cubes(const float* values, int samples);

}  // namespace strata
