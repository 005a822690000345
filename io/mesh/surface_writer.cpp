#include "io/mesh/surface_writer.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <utility>

#include "core/error.h"

namespace strata {
namespace {

using Make = std::unique_ptr<SurfaceWriter> (*)(const std::string&, const SurfaceWriteSettings&);

// Null: no such ending.
Make writer_of(const std::string& path) {
    constexpr std::array<std::pair<std::string_view, Make>, 4> kWriters = {{{".ply", make_ply_writer}, {".obj", make_obj_writer}, {".stl", make_stl_writer}, {".glb", make_glb_writer}}};
    std::string ending = std::filesystem::path(path).extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    const auto* const found = std::find_if(kWriters.begin(), kWriters.end(), [&](const auto& writer) { return writer.first == ending; });
    return found == kWriters.end() ? nullptr : found->second;
}

}  // namespace

std::vector<std::string> plain_names(const std::vector<std::string>& names, std::span<const std::string_view> taken) {
    constexpr size_t kLongest = 72;  // and a number behind
    std::vector<std::string> plain;
    for (const std::string& name : names) {
        std::string word = name.substr(0, kLongest);
        for (char& c : word)
            if (const bool keeps = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.' || c == ':'; !keeps) c = '_';
        if (word.empty()) word = "_";
        const auto is_taken = [&](const std::string& w) { return std::find(taken.begin(), taken.end(), w) != taken.end() || std::find(plain.begin(), plain.end(), w) != plain.end(); };
        std::string free = word;
        for (int number = 2; is_taken(free); ++number) free = word + '_' + std::to_string(number);
        plain.push_back(free);
    }
    return plain;
}

bool is_surface_name(const std::string& path) { return writer_of(path) != nullptr; }

std::unique_ptr<SurfaceWriter> make_surface_writer(const std::string& path, const SurfaceWriteSettings& settings) {
    const Make make = writer_of(path);
    if (!make) throw Error(ErrorKind::usage, path + ": a name that ends in .ply, .obj, .stl or .glb is expected");
    return make(path, settings);
}

double float_error(const Box3d& bounds) {
    return bounds.empty() ? 0.0 : std::max(bounds.min.cwiseAbs().maxCoeff(), bounds.max.cwiseAbs().maxCoeff()) * 0x1p-24;  // half a step of 24 bits
}

}  // namespace strata
