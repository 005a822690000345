#pragma once

#include <cstdint>
#include <utility>

#include "core/voxel/voxel_bounds.h"
#include "render/model_serial.h"
#include "render/voxel_colors.h"

namespace strata {

/// flat: cubes. smooth: cubes lit as the surface that they stand for.
enum class VoxelShading { flat, smooth };

/// Voxels as a scene has them. The tree must outlive it, and stay as it is.
struct VoxelModel {
    VoxelModel(const VoxelTree& drawn, VoxelColors painted, VoxelShading lit = VoxelShading::flat)
        : tree(&drawn), bounds(occupied_bounds(drawn)), colors(std::move(painted)), shading(lit), serial(next_model_serial()) {}

    const VoxelTree* tree;
    Box3d bounds;  // of what is occupied; world
    VoxelColors colors;
    VoxelShading shading;
    uint64_t serial;  // no other model has it but copies of this one
};

/// Bytes of memory that a tree takes.
uint64_t size_bytes(const VoxelTree& tree);

}  // namespace strata
