#pragma once

#include <cstdint>
#include <vector>

#include "core/math/box.h"
#include "core/octree/layered_cloud.h"
#include "render/isosurface_model.h"
#include "render/mesh_model.h"
#include "render/voxel_model.h"

namespace strata {

/// The things that a picture shows, opaque but for isosurfaces that are not, by their numbers in pixel ids: the cloud is 0, voxels are 1 and on, in their order, then come meshes and then isosurfaces.
/// They fill one G-buffer; what is nearer wins, and of what is equally near the lower number. A scene owns neither cloud nor trees nor the triangles
/// of meshes nor fields: see Renderer for how long they must live.
struct Scene {
    LayeredCloud* cloud = nullptr;  // none: no points
    std::vector<VoxelModel> voxels;
    std::vector<MeshModel> meshes;
    std::vector<IsosurfaceModel> isosurfaces;

    Scene() = default;
    Scene(LayeredCloud& only) : cloud(&only) {}  // a cloud is a scene

    Box3d bounds_but_isosurfaces() const {
        Box3d box = cloud != nullptr ? cloud->info().bounds : Box3d();
        for (const VoxelModel& model : voxels) box.extend(model.bounds);
        for (const MeshModel& model : meshes) box.extend(model.bounds);
        return box;
    }
    /// World; the cloud's as its header states it, so it may be too large. Empty for an empty scene.
    Box3d bounds() const {
        Box3d box = bounds_but_isosurfaces();
        for (const IsosurfaceModel& model : isosurfaces) box.extend(model.bounds);
        return box;
    }
};

}  // namespace strata
