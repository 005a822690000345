#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/math/box.h"
#include "core/math/vec.h"
#include "io/byte_stream.h"

namespace strata {

/// What a grid of a `.vdb` file says of itself.
struct VdbGrid {
    std::string name;        // several grids may have the same
    std::string type;        // "float", "double", "bool", "mask", or what it is that is not read
    std::string grid_class;  // "level set", "fog volume", or empty
    bool is_half = false;    // its values are stored in 16 bits
    bool is_common = false;  // a tree of branches 5, 4, 3, as all have that are read here

    std::string map;                                    // the kind of its transform
    std::optional<Vec3d> voxel_size;                    // world units; none: the transform is not a scale and a shift
    Vec3d place_of_0 = Vec3d::Zero();                   // world: of the index (0, 0, 0)
    bool is_uniform() const { return voxel_size && voxel_size->minCoeff() == voxel_size->maxCoeff() && voxel_size->minCoeff() > 0.0; }

    std::optional<double> background;  // of a type that is read

    // As its writer counted; often missing.
    std::optional<uint64_t> active_voxels;
    std::optional<Vec3i> least_index, greatest_index;   // of active voxels
    std::optional<Box3d> bounds() const;                // world: of the centers of those

    int strata_levels = 0;  // of the frame that its voxels came from; 0: it is not ours

    uint32_t compression = 0;   // bits of OpenVDB: 1 zip, 2 active values only, 4 Blosc
    uint64_t tree_offset = 0;   // where its tree begins, or that of the grid whose tree it shares; 0: not known, behind a map that is not,
    uint64_t tree_end = 0;      // and where that ends
};

/// The header of a `.vdb` file: OpenVDB's archive of grids, file versions 222 to 224. Facts from OpenVDB 10.0.
struct VdbFile {
    uint32_t version = 0;      // of the format
    std::string library;       // "10.0", which wrote it
    std::vector<VdbGrid> grids;
};

/// Whether a file begins like that.
bool is_vdb(std::string_view head);

/// Reads the header, and of each grid what stands before its tree. All offsets lie within the file.
/// throws  Error{malformed, unsupported}, naming the place
VdbFile read_vdb_header(ByteStream& stream);

}  // namespace strata
