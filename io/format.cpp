#include "io/format.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <filesystem>

#include "core/cloud/salvaged_source.h"
#include "core/error.h"
#include "core/octree/layered_points.h"
#include "io/byte_source.h"
#include "io/copc/copc_cloud.h"
#include "io/draco/draco_source.h"
#include "io/las/laz_source.h"
#include "io/merged_source.h"
#include "io/mesh/mesh_reader.h"
#include "io/potree/potree_cloud.h"
#include "io/text_words.h"
#include "io/vdb/vdb_file.h"
#include "io/volume/volume_header.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr std::array kFormats = {
    Format{"las", "LAS 1.0 to 1.4, point formats 0 to 10", ".las", FormatKind::points, true},
    Format{"laz", "LAZ, compressed LAS, point formats 0 to 10", ".laz", FormatKind::points, true},
    Format{"copc", "COPC 1.0, a LAZ file with an octree", ".copc.laz", FormatKind::layered, true},
    Format{"potree", "Potree 2.0, a folder with metadata.json", "", FormatKind::layered, true},
    Format{"3dtiles", "3D Tiles, tileset.json or .pnts", ".json .pnts", FormatKind::not_readable, false},
    Format{"ept", "Entwine Point Tiles, a folder with ept.json", "", FormatKind::not_readable, false},
    Format{"e57", "ASTM E57", ".e57", FormatKind::not_readable, false},
    Format{"ply", "Stanford polygon file, a mesh", ".ply", FormatKind::mesh, false},
    Format{"obj", "Wavefront OBJ, a mesh", ".obj", FormatKind::mesh, false},
    Format{"stl", "STL, a mesh", ".stl", FormatKind::mesh, false},
    Format{"glb", "glTF 2.0 in one file, a mesh", ".glb", FormatKind::not_readable, false},
    Format{"svo", "voxels, a sparse octree of strata", ".svo", FormatKind::voxels, true},
    Format{"vdb", "OpenVDB, sparse grids: level sets, fog volumes, masks", ".vdb", FormatKind::grids, true},
    Format{"metaimage", "MetaImage, values on a grid", ".mha .mhd", FormatKind::volume, false},
    Format{"nrrd", "NRRD, values on a grid", ".nrrd .nhdr", FormatKind::volume, false},
    Format{"vtk", "legacy VTK file of structured points, values on a grid", ".vtk", FormatKind::volume, false},
    Format{"pcd", "Point Cloud Library file", ".pcd", FormatKind::not_readable, false},
    Format{"drc", "Draco, points and the vertices of meshes", ".drc", FormatKind::points, true},
};

const Format& format_named(std::string_view name) {
    return *std::find_if(kFormats.begin(), kFormats.end(), [&](const Format& format) { return format.name == name; });
}

std::string readable_names() {
    std::string names;
    for (const Format& format : kFormats) {
        if (format.kind == FormatKind::not_readable) continue;
        if (!names.empty()) names += ", ";
        names += format.name;
    }
    return names;
}

// Null: a folder, but of nothing that strata knows.
const Format* format_of_folder(const std::string& path) {
    std::error_code ignored;
    const auto holds = [&](const char* name) { return fs::is_regular_file(fs::path(path) / name, ignored); };
    if (holds("metadata.json")) return &format_named("potree");
    if (holds("tileset.json")) return &format_named("3dtiles");
    if (holds("ept.json")) return &format_named("ept");
    return nullptr;
}

const Format& identify_folder(const std::string& path) {
    if (const Format* format = format_of_folder(path)) return *format;
    throw Error(ErrorKind::unsupported, path + ": a folder without data: metadata.json of Potree 2.0 is expected");
}

bool is_points_name(const fs::path& path) {
    const std::string ending = lower_case(path.extension().string());
    return !ending.empty() && std::any_of(kFormats.begin(), kFormats.end(), [&](const Format& format) {
        return format.kind == FormatKind::points && format.endings == ending;
    });
}

// ".las, .laz, .drc"
std::string points_endings() {
    std::string endings;
    for (const Format& format : kFormats)
        if (format.kind == FormatKind::points) endings += (endings.empty() ? "" : ", ") + std::string(format.endings);
    return endings;
}

const Format& identify_las(std::string_view head) {
    // COPC 1.0 asks that its own record comes first, right behind the header of LAS 1.4.
    if (head.size() >= 381 && head.substr(377, 4) == "copc") return format_named("copc");
    return format_named(head.size() > 104 && (head[104] & 0xC0) != 0 ? "laz" : "las");  // bits that LASzip sets
}

// A line of OBJ that other texts do not have comes first, behind comments: no more can be seen, the format has no signature.
bool looks_like_obj(std::string_view head) {
    while (!head.empty()) {
        const size_t end = std::min(head.find_first_of("\r\n"), head.size());
        TextWords words(head.substr(0, end));
        const std::string_view keyword = words.word();
        head.remove_prefix(std::min(end + 1, head.size()));
        if (keyword.empty() || keyword.front() == '#') continue;
        double number = 0.0;
        return keyword == "mtllib" || (keyword == "v" && words.number(number) && words.number(number) && words.number(number));
    }
    return false;
}

bool looks_like_text_stl(std::string_view head) {
    const std::string text = lower_case(std::string(head));
    return TextWords(text).word() == "solid" && text.find('\0') == std::string::npos &&
           (text.find("facet") != std::string::npos || text.find("endsolid") != std::string::npos);
}

// ending  with its dot; empty: none has it
bool has_ending(const Format& format, std::string_view ending) {
    TextWords endings(format.endings);
    for (std::string_view word = endings.word(); !word.empty(); word = endings.word())
        if (word == ending) return true;
    return false;
}

const Format& identify_bytes(const ByteSource& source) {
    std::array<char, 589> bytes;
    const size_t size = size_t(std::min<uint64_t>(bytes.size(), source.size()));
    source.read(0, std::as_writable_bytes(std::span(bytes).first(size)));
    const std::string_view head(bytes.data(), size);
    if (head.starts_with("LASF")) return identify_las(head);
    if (head.starts_with("ASTM-E57")) return format_named("e57");
    if (head.starts_with("ply\n") || head.starts_with("ply\r")) return format_named("ply");
    if (head.starts_with("# .PCD") || head.starts_with("VERSION .7") || head.starts_with("VERSION 0.7")) return format_named("pcd");
    if (head.starts_with("DRACO")) return format_named("drc");
    if (head.starts_with("\x89SVO")) return format_named("svo");
    if (is_vdb(head)) return format_named("vdb");
    if (head.starts_with("glTF")) return format_named("glb");
    if (head.starts_with("pnts")) return format_named("3dtiles");
    if (looks_like_nrrd(head)) return format_named("nrrd");
    if (looks_like_vtk(head)) return format_named("vtk");
    if (looks_like_metaimage(head)) return format_named("metaimage");
    if (is_binary_stl(head, source.size()) || looks_like_text_stl(head)) return format_named("stl");
    if (looks_like_obj(head)) return format_named("obj");
    if (size > 0)
        for (const std::string_view name : {"obj", "stl", "metaimage"})
            if (has_ending(format_named(name), lower_case(fs::path(source.name()).extension().string()))) return format_named(name);
    throw Error(ErrorKind::unsupported, source.name() + ": " + (size == 0 ? "an empty file" : "not a format that strata knows") +
                                            "; this version reads " + readable_names());
}

[[noreturn]] void refuse(const std::string& path, const Format& format, std::string_view wish) {
    const std::string what = path + ": " + std::string(format.name) + " (" + std::string(format.description) + ")";
    if (format.kind == FormatKind::not_readable)
        throw Error(ErrorKind::unsupported, what + ": its codec is not in this version, which reads " + readable_names());
    throw Error(ErrorKind::unsupported, what + ": " + std::string(wish) + " is expected here");
}

// A level-of-detail data set with its points as a plain list, node after node.
class PointsOfLayered : public PointSource {
public:
    PointsOfLayered(std::unique_ptr<LayeredCloud> cloud, const NodeChoice& nodes) : cloud_(std::move(cloud)), points_(*cloud_, nodes) {}

    const CloudInfo& info() const override { return points_.info(); }
    uint64_t batch_count() const override { return points_.batch_count(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override { points_.read_batch(index, wanted, out); }

private:
    std::unique_ptr<LayeredCloud> cloud_;
    LayeredPoints points_;
};

std::unique_ptr<PointSource> open_points_file(const std::string& path, bool alone, const OpenSettings& settings) {
    const Format& format = identify_format(path);
    if (format.name == "ply") refuse(path, format, "this version reads it as a mesh only; a file of points");
    if (format.kind != FormatKind::points && format.kind != FormatKind::layered) refuse(path, format, "a file of points");
    // A COPC file is a LAZ file, too: whole, it is read as that.
    if (format.name == "potree" || (format.name == "copc" && !settings.nodes.everything()))
        return std::make_unique<PointsOfLayered>(open_layered(path), settings.nodes);
    if (settings.nodes.deepest_level != NodeChoice().deepest_level && format.name != "copc")
        throw Error(ErrorKind::usage, path + ": " + std::string(format.name) + " has no levels to choose from");
    if (format.name == "drc")
        return std::make_unique<DracoSource>(open_file(path), alone ? DracoSource::Keep::decoded : DracoSource::Keep::nothing);
    return open_las(open_file(path), settings.salvage ? las::Damage::salvage : las::Damage::refuse);
}

std::unique_ptr<PointSource> salvaged(std::unique_ptr<PointSource> source, int threads) {
    const las::Header* const header = header_of(*source);
    const uint64_t stated = header ? header->stated_points : source->info().points;
    return std::make_unique<SalvagedSource>(std::move(source), stated, threads);
}

}  // namespace

std::span<const Format> all_formats() { return kFormats; }

const Format& identify_format(const std::string& path) {
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) return identify_folder(path);
    if (fs::path(path).filename() == "metadata.json") return identify_folder(fs::path(path).parent_path().string());
    return identify_bytes(*open_file(path));
}

std::string_view format_of_name(const std::string& path) {
    const std::string name = lower_case(fs::path(path).filename().string());
    std::string_view longest, format = "potree";
    for (const Format& candidate : kFormats)
        for (size_t begin = 0; begin < candidate.endings.size();) {
            const size_t end = std::min(candidate.endings.find(' ', begin), candidate.endings.size());
            const std::string_view ending = candidate.endings.substr(begin, end - begin);
            if (name.ends_with(ending) && ending.size() > longest.size()) {
                longest = ending;
                format = candidate.name;
            }
            begin = end + 1;
        }
    return format;
}

std::vector<std::string> point_files(std::span<const std::string> words) {
    std::vector<std::string> files;
    for (const std::string& word : words) {
        std::error_code problem;
        if (!fs::is_directory(word, problem) || format_of_folder(word) != nullptr) {
            files.push_back(word);
            continue;
        }
        const ptrdiff_t before = ptrdiff_t(files.size());
        for (fs::directory_iterator entry(word, problem), end; !problem && entry != end; entry.increment(problem))
            if (is_points_name(entry->path())) files.push_back(entry->path().string());
        if (problem) throw Error(ErrorKind::io, word + ": " + problem.message());
        if (files.size() == size_t(before))
            throw Error(ErrorKind::not_found, word + ": no files of points (" + points_endings() + ") in this folder, and no metadata.json of Potree 2.0");
        std::sort(files.begin() + before, files.end());
    }
    return files;
}

std::unique_ptr<PointSource> open_points(std::span<const std::string> paths, const OpenSettings& settings) {
    if (paths.empty()) throw Error(ErrorKind::usage, "no file of points was named");
    std::vector<std::unique_ptr<PointSource>> sources;
    for (const std::string& path : paths) {
        sources.push_back(open_points_file(path, paths.size() == 1, settings));
        if (settings.salvage) sources.back() = salvaged(std::move(sources.back()), settings.threads);
        if (settings.wrap) sources.back() = settings.wrap(std::move(sources.back()));
    }
    if (sources.size() == 1) return std::move(sources.front());
    return merge_sources(std::move(sources), std::vector<std::string>(paths.begin(), paths.end()));
}

std::unique_ptr<LayeredCloud> open_layered(const std::string& path) {
    const Format& format = identify_format(path);
    if (format.kind != FormatKind::layered) refuse(path, format, "a level-of-detail data set");
    if (format.name == "copc") return open_copc(open_file(path));
    return open_potree(path);
}

}  // namespace strata
