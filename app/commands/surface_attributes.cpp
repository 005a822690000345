// Attributes of surfaces of values on a grid, from other volumes and grids.
#include "app/commands/surface_attributes.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "app/quantity_text.h"
#include "core/error.h"
#include "core/surface/grid_at_vertices.h"
#include "io/format.h"
#include "io/scratch_file.h"
#include "io/vdb/vdb_at_vertices.h"
#include "io/vdb/vdb_tree.h"
#include "io/vdb/vdb_voxels.h"
#include "render/srgb.h"

namespace strata {
namespace {

std::unique_ptr<VolumeSource> open_beside(const std::string& path, const SurfaceRequest& request) {
    if (std::filesystem::is_directory(path)) throw Error(ErrorKind::usage, "--attributes: " + path + ": a volume file is expected, it is a folder");
    if (request.raw) {  // samples alone, as those of the input, unless it says itself what it is
        bool says_itself = false;
        try {
            says_itself = identify_format(path).kind == FormatKind::volume;
        } catch (const Error& error) {
            if (error.kind != ErrorKind::unsupported) throw error.within("--attributes");
        }
        return says_itself ? open_volume(path) : open_raw_volume(open_file(path), *request.raw);
    }
    const Format& format = identify_format(path);
    if (format.kind != FormatKind::volume) throw Error(ErrorKind::usage, "--attributes: " + path + ": a volume file is expected, it is " + std::string(format.description));
    return open_volume(path);
}

bool is_color_name(std::string name) {
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    constexpr std::array<std::string_view, 4> kNames = {"cd", "color", "colour", "rgb"};
    return std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

}  // namespace

void SurfaceAttributes::add(const std::string& name, std::unique_ptr<ValuesAtVertices> values) {
    if (std::find(names_.begin(), names_.end(), name) != names_.end()) throw Error(ErrorKind::usage, "--attributes: two of them would be called '" + name + "'");
    names_.push_back(name);
    values_.push_back(std::move(values));
}

SurfaceAttributes SurfaceAttributes::of_volumes(const VolumeSource& main, const SurfaceRequest& request, uint64_t memory_bytes) {
    SurfaceAttributes attributes;
    if (request.attributes.empty()) return attributes;
    const auto refuse = [&](const std::string& path, uint64_t bytes) {
        throw Error(ErrorKind::limit, "--attributes: " + path + ": its values need " + size_text(bytes) + " of memory, " + size_text(memory_bytes - attributes.memory_bytes_) +
                                          " are left; --memory gives more");
    };
    for (const std::string& path : request.attributes) {
        std::unique_ptr<VolumeSource> volume = open_beside(path, request);
        for (const std::string& note : volume->header().notes) attributes.notes_.push_back(path + ": " + note);
        const bool same = is_same_grid(main, *volume);
        const uint64_t bytes = same ? SlicesAtVertices::memory_bytes(volume->size()) : volume->header().samples() * sizeof(float);
        if (bytes > memory_bytes - attributes.memory_bytes_) refuse(path, bytes);
        attributes.memory_bytes_ += bytes;
        std::unique_ptr<ValuesAtVertices> values;
        if (same) values = std::make_unique<SlicesAtVertices>(*volume, request.threads);
        else values = std::make_unique<GridAtVertices>(*volume, bytes, request.threads);
        attributes.add(std::filesystem::path(path).stem().string(), std::move(values));
        if (same) attributes.volumes_.push_back(std::move(volume));
    }
    return attributes;
}

SurfaceAttributes SurfaceAttributes::of_grids(const std::string& path, const SurfaceRequest& request, uint64_t memory_bytes) {
    SurfaceAttributes attributes;
    if (request.attributes.empty()) return attributes;
    const std::unique_ptr<ByteSource> source = open_file(path);
    ByteStream stream(*source);
    const VdbFile file = read_vdb_header(stream);
    // A field for each number that a point has.
    size_t fields = 0;
    std::vector<VdbGrid> grids;
    for (const std::string& name : request.attributes) {
        grids.push_back(choose_vdb_grid(file, name, "--attributes: " + path));
        fields += is_vector(grids.back()) ? 3 : 1;
    }
    const auto open = [&](const VdbGrid& grid, std::optional<int> component, bool only_active) {
        attributes.scratches_.push_back(make_scratch_file(request.scratch_folder));
        return std::make_unique<VdbField>(*source, VdbFieldSettings{.grid = grid.name, .component = component, .only_active = only_active,
                                                                    .memory_bytes = memory_bytes / fields, .scratch = attributes.scratches_.back().get()});
    };
    for (const VdbGrid& grid : grids) {
        if (!is_vector(grid)) {
            attributes.add(grid.name, std::make_unique<VdbAtVertices>(open(grid, std::nullopt, false)));
            continue;
        }
        if (!is_color_name(grid.name)) {
            for (int part = 0; part < 3; ++part) attributes.add(grid.name + '_' + "xyz"[part], std::make_unique<VdbAtVertices>(open(grid, part, false)));
            continue;
        }
        if (attributes.colors_) throw Error(ErrorKind::usage, "--attributes: one grid of colors is expected, '" + grid.name + "' is another");
        std::array<std::unique_ptr<VdbField>, 3> parts;
        for (int part = 0; part < 3; ++part) parts[size_t(part)] = open(grid, part, true);
        // Of grids that voxels were written to, values are those of pictures; others hold light.
        std::function<uint8_t(float)> encode = srgb8_from_linear;
        if (grid.strata_levels > 0) encode = [](float value) { return uint8_t(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f))); };
        attributes.colors_ = std::make_unique<VdbColorsAtVertices>(std::move(parts), std::move(encode));
    }
    attributes.memory_bytes_ = memory_bytes;
    return attributes;
}

}  // namespace strata
