#include "tests/support/scan_files.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/support/las_file.h"

namespace strata::test {

namespace fs = std::filesystem;

bool full_run() {
    const char* const full = std::getenv("STRATA_ROBUST_FULL");
    return full && *full == '1';
}

std::string file_contents(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void write_sheet(const std::string& path, int points) {
    LasFile file{.minor_version = 2, .point_format = 3, .max = {7.0 * 99 / 100, 11.0 * (points / 100) / 100, 0.96}};
    for (int i = 0; i < points; ++i) {
        const int x = i % 100, y = i / 100;
        file.records.push_back(las_record(3, {.x = 7 * x, .y = 11 * y, .z = (x * y) % 97, .intensity = uint16_t(i)}));
    }
    const std::vector<std::byte> bytes = file.bytes();
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

const std::vector<ConvertedOutput>& converted_outputs() {
    static const std::vector<ConvertedOutput> all = {{"potree", "out"},   {"copc", "out.copc.laz"}, {"laz", "out.laz"},
                                                     {"las", "out.las"}, {"drc", "out.drc"},       {"drc_blocks", "out", {"--format", "drc"}},
                                                     {"svo", "out.svo", {"--resolution", "256", "--attributes", "color,count,opacity"}, "voxelize"},
                                                     {"ply", "out.ply", {"--method", "cubes", "--voxel-size", "0.25"}, "surface"},
                                                     {"obj", "out.obj", {"--method", "marching-cubes", "--voxel-size", "0.25"}, "surface"},
                                                     {"stl", "out.stl", {"--method", "cubes", "--voxel-size", "0.25"}, "surface"},
                                                     {"glb", "out.glb", {"--method", "marching-cubes", "--voxel-size", "0.25"}, "surface"}};
    return all;
}

bool same_output(const std::string& a, const std::string& b) {
    if (fs::is_directory(a) != fs::is_directory(b)) return false;
    if (!fs::is_directory(a)) {
        const std::string content = file_contents(a);
        return !content.empty() && content == file_contents(b);
    }
    const fs::directory_iterator files(a);
    return entries(a) > 0 && entries(a) == entries(b) &&
           std::all_of(begin(files), end(files), [&](const fs::directory_entry& file) { return same_output(file.path(), b + "/" + file.path().filename().string()); });
}

size_t entries(const std::string& folder) { return size_t(std::distance(fs::directory_iterator(folder), fs::directory_iterator())); }

std::string refusal_verdict(const ProgramResult& result) {
    if (result.timed_out) return "hang";
    if (result.signal != 0) return "crash: signal " + std::to_string(result.signal);
    if (result.exit_code != 1) return "exit code " + std::to_string(result.exit_code) + ": " + result.err;
    if (!result.err.starts_with("strata: ") || std::count(result.err.begin(), result.err.end(), '\n') != 1) return "not one line: " + result.err;
    return "";
}

}  // namespace strata::test
