#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "core/surface/triangle_mesh.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"
#include "io/output_file.h"
#include "io/vdb/vdb_voxels.h"

namespace strata {

/// Whether this build can write `.vdb` files. Where not, what is below throws Error{unsupported}, and says so.
bool has_openvdb();

enum class VdbCompression { none, zip, blosc };

struct VdbWriteSettings {
    bool as_mask = false;  // a mask grid, of 1 bit a voxel, in place of a fog volume of value 1
    bool half = false;     // 16 bits a value of fog volumes and level sets
    VdbCompression compression = VdbCompression::blosc;
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();  // of VdbWriter's grids
};

/// Writes voxels as a `.vdb` file: a grid "occupancy", and where batches have them "count" (int32) and "color" (vec3s, 0 to 1).
/// Index (x, y, z) is voxel (x, y, z) of the frame, and its center. Whole cubes become tiles. OpenVDB writes whole trees, so all is kept in memory
/// until commit: 2 KiB a leaf of 8^3 voxels that is not full, or as a mask 128 bytes.
class VdbWriter {
public:
    /// throws  as OutputFile; Error{unsupported}: what OpenVDB refuses, such as voxels of less than some 1e-5 units
    VdbWriter(const std::string& path, bool overwrite, const VoxelFrame& frame, const VdbWriteSettings& settings = {});
    ~VdbWriter();

    /// Takes batches, in any order. throws Error{limit}: the grids need more memory than allowed
    void add(const VoxelBatch& batch);
    /// Writes the file and gives it its name. Once. The same voxels give the same bytes.
    /// returns  bytes of the file
    uint64_t commit(Durability durability = Durability::synced);

private:
    struct Grids;
    std::unique_ptr<Grids> grids_;
};

struct LevelSetSettings {
    double voxel_size = 1.0;                                              // world units
    double half_width = 3.0;                                              // of the narrow band, voxels
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();  // estimated, not held
    int threads = 1;
};

/// The signed distance to a closed mesh, world units, within a narrow band; by OpenVDB. Its index (0, 0, 0) lies at a multiple of the voxel
/// size. Of a mesh with holes the sign is what OpenVDB finds.
class MeshLevelSet {
public:
    /// throws  Error{usage}: no triangles, or a size or half width that is none; Error{limit};
    ///         Error{unsupported}: what OpenVDB refuses, as above
    MeshLevelSet(const TriangleMesh& mesh, const LevelSetSettings& settings);
    ~MeshLevelSet();

    uint64_t active_voxels() const;
    /// Its voxels whose value is at most the isovalue.
    VdbVoxels voxels(double isovalue = 0.0) const;
    /// Writes it as a `.vdb` file with one grid, "surface".
    /// returns  bytes of the file
    uint64_t write(const std::string& path, bool overwrite, const VdbWriteSettings& settings = {}, Durability durability = Durability::synced) const;

private:
    struct Grid;
    std::unique_ptr<Grid> grid_;
};

}  // namespace strata
