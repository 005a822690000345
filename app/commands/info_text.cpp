#include "app/commands/info_text.h"

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/printable_text.h"
#include "app/quantity_text.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

constexpr size_t kLabelWidth = 14;

// ASPRS classes, LAS 1.4 R15, table 17.
constexpr std::array<std::string_view, 19> kClassNames = {
    "never classified", "unassigned", "ground", "low vegetation", "medium vegetation", "high vegetation", "building", "low noise",
    "model key point", "water", "rail", "road", "overlap", "wire guard", "wire", "tower", "connector", "bridge", "high noise"};

std::string number_text(const ordered_json& value, int decimals = -1) {
    if (!value.is_number()) return "-";
    if (value.is_number_integer()) return std::to_string(value.get<int64_t>());
    char text[64];
    if (decimals >= 0 && std::abs(value.get<double>()) < 1e15)
        std::snprintf(text, sizeof text, "%.*f", decimals, value.get<double>() + 0.0);  // + 0: files hold -0 as well
    else
        std::snprintf(text, sizeof text, "%.10g", value.get<double>() + 0.0);
    return text;
}

std::string padded(const std::string& text, size_t width, bool right = false) {
    const std::string blanks(width > text.size() ? width - text.size() : 0, ' ');
    return right ? blanks + text : text + blanks;
}

class Block {
public:
    void row(const std::string& label, const std::string& line) {
        text_ += "  " + padded(label == last_ ? "" : label, kLabelWidth) + line + "\n";
        last_ = label;
    }
    std::string text_;

private:
    std::string last_;
};

// Decimals that show one step of the scale: 2 for 0.01.
int decimals_of(const ordered_json& report, size_t axis) {
    if (!report.contains("scale")) return -1;
    const ordered_json& scale = report["scale"];
    if (!scale.is_array() || scale.size() != 3 || !scale[axis].is_number()) return -1;
    return std::clamp(int(std::ceil(-std::log10(scale[axis].get<double>()) - 1e-9)), 0, 12);
}

// The text under a key; empty: it is not there, or null.
std::string text_of(const ordered_json& report, const char* key) {
    return report.contains(key) && report[key].is_string() ? report[key].get<std::string>() : std::string();
}

// " m": a unit behind a number; empty where the system says none.
std::string unit_behind(const std::string& unit) {
    if (unit == "metre") return " m";
    if (unit == "foot") return " ft";
    if (unit == "degree") return "\u00b0";
    return unit.empty() ? "" : " " + printable(unit);
}

void bounds_rows(const ordered_json& report, Block& block) {
    const ordered_json& bounds = report["bounds"];
    if (!bounds["min"].is_array()) return;
    for (size_t axis = 0; axis < 3; ++axis) {
        const int decimals = decimals_of(report, axis);
        const ordered_json &low = bounds["min"][axis], &high = bounds["max"][axis];
        std::string line = std::string(1, "xyz"[axis]) + " " + padded(number_text(low, decimals), 15, true) + " .. " +
                           padded(number_text(high, decimals), 15, true);
        if (low.is_number() && high.is_number())
            line += "   " + padded(number_text(high.get<double>() - low.get<double>(), decimals), 12, true) +
                    unit_behind(text_of(report, axis < 2 ? "unit" : "vertical_unit")) + " long";
        block.row("bounds", line);
    }
}

void vector_row(const ordered_json& report, const char* key, Block& block) {
    if (!report.contains(key)) return;
    std::string line;
    for (const ordered_json& value : report[key]) line.append(line.empty() ? "" : "  ").append(number_text(value));
    block.row(key, line);
}

// "EPSG:25832 ETRS89 / UTM zone 32N, unit metre"; of a text that means nothing to PROJ what names it, as WKT fills a screen.
std::string crs_text(const ordered_json& report) {
    const std::string crs = report["crs"];
    const size_t bracket = crs.find_first_of("[(");
    const bool is_wkt = crs.size() >= 80 && bracket != std::string::npos;
    const std::string size = is_wkt ? "  (WKT of " + std::to_string(crs.size()) + " bytes)" : "";
    if (report.contains("crs_name")) {
        const std::string id = report["crs_id"].is_string() ? report["crs_id"].get<std::string>() + " " : "", unit = text_of(report, "unit"),
                          vertical = text_of(report, "vertical_unit");
        std::string line = id + report["crs_name"].get<std::string>();
        if (!unit.empty()) line += ", unit " + unit;
        if (!vertical.empty() && vertical != unit) line += ", of heights " + vertical;
        return printable(line) + size;
    }
    const size_t begin = crs.find('"'), end = crs.find('"', begin == std::string::npos ? begin : begin + 1);
    if (!is_wkt || end == std::string::npos) return printable(crs);
    return printable(crs.substr(begin + 1, end - begin - 1)) + size;
}

std::string range_text(const ordered_json& values) {
    if (!values.is_array()) return number_text(values);
    std::string line;
    for (size_t i = 0; i < values.size() && i < 4; ++i) line.append(i ? " " : "").append(number_text(values[i]));
    return values.size() > 4 ? line + " ..." : line;
}

void attribute_rows(const ordered_json& attributes, Block& block) {
    size_t width = 4;
    for (const ordered_json& attribute : attributes) width = std::max(width, attribute["name"].get_ref<const std::string&>().size());
    for (const ordered_json& attribute : attributes) {
        const int64_t components = attribute.value("components", int64_t{1});
        std::string line = padded(printable(attribute["name"]), width + 2) +
                           padded(attribute["type"].get<std::string>() + (components > 1 ? " x " + std::to_string(components) : ""), 13);
        if (!attribute["min"].is_null()) line += range_text(attribute["min"]) + " .. " + range_text(attribute["max"]);
        block.row("attributes", line.substr(0, line.find_last_not_of(' ') + 1));
    }
}

void share_rows(const ordered_json& counts, const char* label, bool classes, Block& block) {
    uint64_t sum = 0;
    for (const ordered_json& count : counts) sum += count.get<uint64_t>();
    for (const auto& [key, count] : counts.items()) {
        char share[32];
        std::snprintf(share, sizeof share, "%6.2f %%", 100.0 * count.get<double>() / double(sum));
        const size_t number = size_t(std::stoul(key));
        std::string line = padded(key, 3, true) + padded(with_commas(count), 16, true) + "  " + share;
        if (classes && number < kClassNames.size()) line += "  " + std::string(kClassNames[number]);
        block.row(label, line);
    }
}

// Distances in spacings of the level, over the points of all levels down to it.
void sampling_rows(const ordered_json& levels, Block& block) {
    block.row("sampling", "       spacing       kept   nearest kept neighbor       left out   to a kept point");
    block.row("sampling", "                            min     5 %  median                     99 %     max");
    bool picked = false;
    for (const ordered_json& level : levels) {
        const auto cell = [&](const char* key, size_t width) { return padded(number_text(level[key], 3), width, true); };
        std::string line = padded(number_text(level["level"]), 3, true) + cell("spacing", 11) +
                           padded(with_commas(level["kept_points"]), 11, true) + cell("neighbor_min", 8) + cell("neighbor_p5", 8) +
                           cell("neighbor_median", 8) + padded(with_commas(level["removed_points"]), 15, true) +
                           cell("coverage_p99", 8) + cell("coverage_max", 8);
        picked |= level["removed_points"] != level["removed_total"] || level["measured_nodes"] != level["inner_nodes"];
        block.row("sampling", line);
    }
    block.row("sampling", "distances are in spacings of the level; those beyond 4 count as 4");
    if (picked) block.row("sampling", "large levels are measured on nodes picked by hash, exactly around those; --json counts them");
}

void layer_rows(const ordered_json& report, Block& block) {
    if (report.contains("nodes")) block.row("nodes", with_commas(report["nodes"]));
    if (report.contains("spacing") && report["spacing"].is_array()) vector_row(report, "spacing", block);
    if (report.contains("spacing") && report["spacing"].is_number()) block.row("spacing", number_text(report["spacing"]) + unit_behind(text_of(report, "unit")));
    if (report.contains("points_per_level")) {
        size_t level = 0;
        for (const ordered_json& count : report["points_per_level"])
            block.row("levels", padded(std::to_string(level++), 3, true) + padded(with_commas(count), 16, true));
    }
    if (report.contains("valid")) {
        const std::string checked = report.value("validated", "");
        block.row("valid", (report["valid"].get<bool>() ? "yes" : "no") + (checked.empty() ? checked : ", as far as checked: " + checked));
    }
    if (report.contains("sampling")) sampling_rows(report["sampling"], block);
}

void voxel_rows(const ordered_json& report, Block& block) {
    if (!report.contains("level_table")) return;
    block.row("voxel size", number_text(report["voxel_size"]));
    vector_row(report, "origin", block);
    std::string size = size_text(report["bytes"]);
    if (report["bytes_per_voxel"].is_number()) {
        char text[48];
        std::snprintf(text, sizeof text, ", %.3f a voxel", report["bytes_per_voxel"].get<double>());
        size += text;
    }
    block.row("bytes", size);
    for (const ordered_json& level : report["level_table"]) {
        char text[96];
        std::snprintf(text, sizeof text, "%s nodes of %-10.6g %.3g of the cube", padded(with_commas(level["nodes"]), 14, true).c_str(),
                      level["cell_size"].get<double>(), level["occupancy"].get<double>());
        block.row("level " + std::to_string(level["level"].get<int>()), text);
    }
}

// What the surface of a mesh is like.
void surface_rows(const ordered_json& report, Block& block) {
    if (!report.contains("euler_characteristic") || report["triangles"] == 0) return;
    const auto count = [&](const char* key) { return report[key].get<uint64_t>(); };
    block.row("surface", with_commas(count("components")) + (count("components") == 1 ? " component" : " components") + ", Euler characteristic " + number_text(report["euler_characteristic"]));
    std::string edges = count("boundary_edges") == 0 ? "closed" : with_commas(count("boundary_edges")) + " boundary edges";
    if (count("nonmanifold_edges") > 0) edges += ", " + with_commas(count("nonmanifold_edges")) + " edges of more than two faces";
    if (count("flipped_edges") > 0) edges += ", " + with_commas(count("flipped_edges")) + " edges whose faces turn opposite ways";
    block.row("surface", edges);
    if (count("degenerate_faces") > 0) block.row("surface", with_commas(count("degenerate_faces")) + " faces with a vertex twice");
    block.row("area", number_text(report["area"]));
    if (!report["volume"].is_null()) block.row("volume", number_text(report["volume"]));
}

// Samples on a dense grid, and how they lie.
void volume_rows(const ordered_json& report, Block& block) {
    if (!report.contains("dimensions")) return;
    std::string line;
    for (const ordered_json& size : report["dimensions"]) line.append(line.empty() ? "" : " x ").append(with_commas(size));
    block.row("dimensions", line + " samples");
    vector_row(report, "origin", block);
    for (const ordered_json& direction : report["directions"]) block.row("directions", range_text(direction));
    block.row("stored", report["encoding"].get<std::string>() + (text_of(report, "data_file").empty() ? "" : ", in " + printable(report["data_file"])));
    if (report["nan_samples"] != 0) block.row("no value", with_commas(report["nan_samples"]) + " samples that are not a number");
}

// A grid a line, and one for how its voxels lie.
void grid_rows(const ordered_json& grids, Block& block) {
    for (const ordered_json& grid : grids) {
        const std::string name = printable(grid["name"]);
        std::string line = (name.empty() ? "(no name)" : name) + ": " + printable(grid["type"]) + (grid["half"].get<bool>() ? " (16 bits)" : "");
        if (grid["class"].is_string()) line += ", " + printable(grid["class"]);
        line += ", " + (grid["active_voxels"].is_null() ? "?" : with_commas(grid["active_voxels"])) + " active voxels";
        if (!grid["background"].is_null()) line += ", background " + number_text(grid["background"]);
        block.row("grids", line);
        block.row("grids", "    voxels of " + (grid["voxel_size"].is_null() ? "no one size" : range_text(grid["voxel_size"])) + ", " + printable(grid["transform"]));
    }
}

}  // namespace

std::string info_text(const std::string& report_json) {
    const ordered_json report = ordered_json::parse(report_json);
    Block block;
    block.text_ = printable(report["path"]) + "\n";
    block.row("format", printable(report["detail"]));
    for (const char* const key : {"points", "vertices", "triangles", "voxels"})
        if (report.contains(key)) block.row(key, with_commas(report[key]));
    if (report.contains("faces") && report["faces"] != report["triangles"]) block.row("faces", with_commas(report["faces"]) + " polygons");
    bounds_rows(report, block);
    vector_row(report, "scale", block);
    vector_row(report, "offset", block);
    if (!text_of(report, "crs").empty()) block.row("crs", crs_text(report));
    if (report.contains("grids")) grid_rows(report["grids"], block);
    surface_rows(report, block);
    volume_rows(report, block);
    layer_rows(report, block);
    voxel_rows(report, block);
    if (report.contains("rgb_bits") && report["rgb_bits"] != 0) block.row("rgb", std::to_string(report["rgb_bits"].get<int>()) + " of 16 bits used");
    attribute_rows(report["attributes"], block);
    if (report.contains("points_by_return")) share_rows(report["points_by_return"], "returns", false, block);
    if (report.contains("points_by_class")) share_rows(report["points_by_class"], "classes", true, block);
    for (const char* const key : {"notes", "warnings"})
        if (report.contains(key))
            for (const ordered_json& line : report[key]) block.row(key, printable(line));
    return block.text_;
}

}  // namespace strata
