#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/options.h"
#include "core/octree/layered_cloud.h"
#include "core/surface/field_surface.h"
#include "core/surface/triangle_mesh.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// A voxel file, or the first grid of an OpenVDB file, in memory.
struct OpenedVoxels {
    std::string path, crs;
    std::unique_ptr<VoxelTree> tree;
};

/// A mesh file in memory.
struct OpenedMesh {
    std::string path;
    std::unique_ptr<TriangleMesh> mesh;
};

/// A volume or a grid of values in memory, and the isosurfaces of it to draw.
struct OpenedField {
    std::string path;
    std::unique_ptr<FieldBricks> field;
    std::vector<FieldSurface> surfaces;
};

/// What the words of `strata render` hold: files of points or a level-of-detail set make one cloud, each voxel file and each mesh is a model; volumes, and
/// with --iso grids of OpenVDB, are fields of which isosurfaces are drawn.
struct SceneFiles {
    std::unique_ptr<LayeredCloud> cloud;  // none: no word is one of points
    std::vector<OpenedVoxels> voxels;
    std::vector<OpenedMesh> meshes;
    std::vector<OpenedField> fields;

    /// As the files say, the cloud first; empty: unknown.
    std::string crs() const;
};

/// Opens files and folders by what they are. Of voxel files (.svo) that do not fit in half of --memory the finest levels stay
/// out; grids, volumes and meshes must fit.
/// throws  Error, naming the file
SceneFiles open_scene_files(const Options& options);

}  // namespace strata
