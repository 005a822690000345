#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "core/math/vec.h"
#include "core/voxel/ray_cast.h"
#include "render/image.h"
#include "render/point_color.h"

namespace strata {

/// Colors of a tree's cells, before light. Safe from several threads.
class VoxelColors {
public:
    enum class Rule {
        plain,      // one color for all
        rgb,        // the mean color of what is in the cell
        elevation,  // z of the cell's middle, through a color map
        count,      // points in the cell, by their logarithm, through a color map; of a coarser cell as many as for a voxel of the same surface
        normal,     // a direction, as points have it
        level,      // depth in the octree, as a category
    };

    /// name      rgb, elevation, count (or density), normal, lod or plain; empty: rgb where the tree has colors, else plain
    /// range     of elevation and count; none: from the tree
    /// colormap  empty: the channel's own
    /// throws    Error{usage}: there is no such channel, or the tree does not have what it shows
    VoxelColors(const VoxelTree& tree, std::string_view name, std::optional<ColorRange> range, std::string_view colormap);

    Rule rule() const { return rule_; }
    const std::string& name() const { return name_; }
    /// Of elevation, or of the logarithm of counts.
    const ColorRange& range() const { return range_; }
    /// What values from the range's low end to its high end look like; of levels by depth; of plain voxels all the same.
    const std::array<Rgba8, 1024>& table() const { return table_; }

    /// normal  of the surface where the ray hits it; only the rule `normal` looks at it
    Rgba8 color(const VoxelTree& tree, const VoxelHit& hit, const Vec3f& normal) const;

private:
    Rgba8 ramp(double value) const;

    std::string name_;
    Rule rule_ = Rule::plain;
    ColorRange range_;
    std::array<Rgba8, 1024> table_;
};

/// Where a hit's attributes are: the depth they belong to and the entry there; none where the tree has none.
struct CellEntry {
    size_t depth, index;
};
std::optional<CellEntry> attribute_entry(const VoxelTree& tree, const VoxelHit& hit);

/// The mean normal that is stored for a hit's cell, of any length; zero: there is none.
Vec3f stored_normal(const VoxelTree& tree, const VoxelHit& hit);

}  // namespace strata
