#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/layered_cloud.h"
#include "core/octree/layered_points.h"

namespace strata {

/// What strata can do with a format.
enum class FormatKind {
    points,        // a plain list of points: opened with open_points
    layered,       // a level-of-detail data set: opened with open_layered
    mesh,          // triangles: read with read_mesh of io/mesh
    voxels,        // a sparse voxel octree: opened with open_svo of io/svo
    grids,         // sparse grids of values: read with read_vdb_voxels of io/vdb
    volume,        // values on a dense grid: opened with open_volume of io/volume
    not_readable,  // recognised, but not readable by this version; opening it says so
};

/// A row of the one list of formats: how it is recognised, what it is called.
struct Format {
    std::string_view name;         // "las", as in --format
    std::string_view description;  // "LAS 1.0 to 1.4, point formats 0 to 10"
    std::string_view endings;      // ".las"; several with blanks between
    FormatKind kind;
    bool writable;
};

/// Every format, for help texts and messages.
std::span<const Format> all_formats();

/// Recognises a file or folder by its first bytes. Its name counts only where they may be anything: .obj, .stl, .mha and .mhd.
/// throws  Error{not_found, unsupported, io}: the path and the formats that are known
const Format& identify_format(const std::string& path);

/// The name of the format that an output of that name would have by its ending: the longest that fits. "potree" for a name
/// that says nothing.
std::string_view format_of_name(const std::string& path);

/// The files that words of a command line stand for: a folder that is no data set means the files of points in it, by their
/// endings, in the order of their names; any other word means itself.
/// throws  Error{not_found}: a folder without such files
std::vector<std::string> point_files(std::span<const std::string> words);

/// Makes a source of another, such as a part of it.
using WrapSource = std::function<std::unique_ptr<PointSource>(std::unique_ptr<PointSource>)>;

/// How files of points are opened.
struct OpenSettings {
    WrapSource wrap;       // what to make of each file; none: all of it
    NodeChoice nodes;      // of level-of-detail sets; only their nodes have levels
    bool salvage = false;  // damaged files give what can be read of them: `wrap` gets a SalvagedSource of each
    int threads = 1;       // to salvage with
};

/// Opens one file or level-of-detail set, or several as one cloud: the finest scale, the union of attributes.
/// throws  Error, naming the file and the place; Error{usage}: a deepest level for a file without levels
std::unique_ptr<PointSource> open_points(std::span<const std::string> paths, const OpenSettings& settings = {});

/// Opens a level-of-detail data set.
std::unique_ptr<LayeredCloud> open_layered(const std::string& path);

}  // namespace strata
