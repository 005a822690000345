#include "render/voxel_colors.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/voxel/voxel_bounds.h"
#include "render/colormap.h"

namespace strata {
namespace {

constexpr Rgba8 kPlain = make_rgba(206, 200, 190);
constexpr Rgba8 kUnknown = make_rgba(128, 128, 128);  // as points without a value
constexpr size_t kSampleCells = 50'000;

constexpr std::pair<std::string_view, VoxelColors::Rule> kRules[] = {
    {"rgb", VoxelColors::Rule::rgb},     {"elevation", VoxelColors::Rule::elevation}, {"count", VoxelColors::Rule::count},
    {"density", VoxelColors::Rule::count}, {"normal", VoxelColors::Rule::normal},       {"lod", VoxelColors::Rule::level},
    {"plain", VoxelColors::Rule::plain}};

// The finest depth that has entries of a kind; 0: none has.
template <typename Kind>
size_t finest_with(const VoxelTree& tree, Kind CellAttributes::* kind) {
    for (size_t depth = tree.attributes.size(); depth-- > 1;)
        if (!(tree.attributes[depth].*kind).empty()) return depth;
    return 0;
}

// A surface has four times as many points in cells twice as large.
double count_of_voxel(const VoxelTree& tree, size_t depth, uint32_t count) {
    return std::ldexp(double(count), -2 * (tree.frame.depth() - int(depth)));
}

ColorRange range_of_counts(const VoxelTree& tree, size_t depth) {
    const std::vector<uint32_t>& counts = tree.attributes[depth].counts;
    const size_t step = counts.size() / kSampleCells + 1;
    std::vector<double> values;
    for (size_t i = 0; i < counts.size(); i += step)
        if (counts[i] > 0) values.push_back(count_of_voxel(tree, depth, counts[i]));
    if (values.empty()) return {1.0, 2.0};
    return percentile_range(values);
}

ColorRange range_of_elevations(const VoxelTree& tree) {
    const CellList sample = coarse_cells(tree, kSampleCells);
    std::vector<double> values;
    for (const auto& cell : sample.cells) values.push_back(cell_box(tree.frame, sample.depth, cell).center().z());
    if (values.empty()) return {};
    return percentile_range(values);
}

}  // namespace

std::optional<CellEntry> attribute_entry(const VoxelTree& tree, const VoxelHit& hit) {
    if (tree.cells_before_even.empty()) return std::nullopt;
    // Cells of a full cell have what that has.
    const bool odd = hit.depth == 2 * hit.level + 1;
    const size_t depth = size_t(2 * hit.level + (odd ? 1 : 2));
    if (depth >= tree.attributes.size()) return std::nullopt;
    return CellEntry{depth, cell_index(tree, hit.level, hit.node, hit.bit, odd)};
}

Vec3f stored_normal(const VoxelTree& tree, const VoxelHit& hit) {
    const std::optional<CellEntry> entry = attribute_entry(tree, hit);
    if (!entry || tree.attributes[entry->depth].normals.empty()) return Vec3f::Zero();
    const VoxelNormal& normal = tree.attributes[entry->depth].normals[entry->index];
    return Vec3f(normal[0], normal[1], normal[2]);
}

VoxelColors::VoxelColors(const VoxelTree& tree, std::string_view name, std::optional<ColorRange> range, std::string_view colormap) {
    const bool colors = finest_with(tree, &CellAttributes::colors) > 0;
    const size_t counts = finest_with(tree, &CellAttributes::counts);
    if (name.empty()) name = colors ? "rgb" : "plain";
    const auto* const found = std::find_if(std::begin(kRules), std::end(kRules), [&](const auto& rule) { return rule.first == name; });
    if (found == std::end(kRules))
        throw Error(ErrorKind::usage, "voxels have no '" + std::string(name) + "'; expected rgb, elevation, count, normal, lod or plain");
    name_ = name;
    rule_ = found->second;
    if (rule_ == Rule::rgb && !colors)
        throw Error(ErrorKind::usage, "these voxels have no color; 'strata voxelize --attributes' stores it where the input has it");
    if (rule_ == Rule::count && counts == 0)
        throw Error(ErrorKind::usage, "these voxels have no counts; 'strata voxelize --attributes' stores them of points");
    table_.fill(kPlain);
    if (rule_ == Rule::level)
        for (size_t depth = 0; depth < table_.size(); ++depth) table_[depth] = category_color(depth);
    if (rule_ != Rule::elevation && rule_ != Rule::count) return;
    table_ = Colormap(colormap.empty() ? "fjord" : colormap).colors();
    range_ = range ? *range : rule_ == Rule::count ? range_of_counts(tree, counts) : range_of_elevations(tree);
    if (rule_ != Rule::count) return;
    if (!(range_.low > 0.0 && range_.high > 0.0)) throw Error(ErrorKind::usage, "--range: counts are shown by their logarithm: positive numbers are expected");
    range_ = {std::log(range_.low), std::log(range_.high)};
}

Rgba8 VoxelColors::ramp(double value) const {
    const double extent = range_.high - range_.low, place = extent == 0.0 ? 0.5 : (value - range_.low) / extent;
    return table_[size_t(std::clamp(place, 0.0, 1.0) * double(table_.size() - 1) + 0.5)];
}

Rgba8 VoxelColors::color(const VoxelTree& tree, const VoxelHit& hit, const Vec3f& normal) const {
    switch (rule_) {
        case Rule::plain: break;
        case Rule::normal: return direction_color(normal);
        case Rule::level: return table_[size_t(hit.depth)];
        case Rule::elevation: {
            const double side = double(uint32_t{1} << (tree.frame.depth() - hit.depth));
            return ramp(tree.frame.origin.z() + tree.frame.voxel_size * side * (hit.cell[2] + 0.5));
        }
        case Rule::rgb: {
            const std::optional<CellEntry> entry = attribute_entry(tree, hit);
            if (!entry || tree.attributes[entry->depth].colors.empty()) return kUnknown;
            const VoxelColor& color = tree.attributes[entry->depth].colors[entry->index];
            return make_rgba(color[0], color[1], color[2]);
        }
        case Rule::count: {
            const std::optional<CellEntry> entry = attribute_entry(tree, hit);
            if (!entry || tree.attributes[entry->depth].counts.empty()) return kUnknown;
            const uint32_t count = tree.attributes[entry->depth].counts[entry->index];
            return count == 0 ? kUnknown : ramp(std::log(count_of_voxel(tree, entry->depth, count)));
        }
    }
    return kPlain;
}

}  // namespace strata
