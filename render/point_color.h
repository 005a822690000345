#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/layered_cloud.h"
#include "render/image.h"

namespace strata {

/// Values from which to which a color map reaches, in the attribute's own units; the first may be the greater one.
struct ColorRange {
    double low = 0.0, high = 1.0;

    bool operator==(const ColorRange&) const = default;
};

/// How a cloud's points get their color: what of a point is shown, and by which rule.
struct ColorChannel {
    enum class Rule {
        rgb,             // the attribute is a color
        ramp,            // a quantity, through a color map
        log_ramp,        // a positive quantity, through a color map over its logarithm
        elevation,       // the z coordinate, through a color map
        category,        // a number without an order
        classification,  // an ASPRS class
        normal,          // a direction: red, green and blue are 0.5 + 0.5 n of NormalX, NormalY, NormalZ
        level,           // the level of the point's node, as a category
    };

    std::string name;  // as the user gave it
    Rule rule = Rule::level;
    int attribute = -1;  // index into CloudInfo::attributes, -1 for elevation, normal and level
    int component = 0;   // of the attribute; rgb uses all three
    std::string_view default_colormap = "fjord";

    /// Whether colors depend on a range of values: the user's, or derive_range's.
    bool needs_range() const { return rule == Rule::rgb || rule == Rule::ramp || rule == Rule::log_ramp || rule == Rule::elevation; }
    bool operator==(const ColorChannel&) const = default;
};

/// Finds the channel that `--color` names: rgb, intensity, elevation, classification, return, gps-time, source, lod,
/// normal, density, or an attribute by its name; ATTRIBUTE[1] is a component of one that has several.
/// throws  Error{usage}: the cloud has no such attribute; the message lists those it has
ColorChannel find_color_channel(const CloudInfo& info, std::string_view name);

/// How an attribute of that name looks, as find_color_channel has it; with _ in place of spaces, too.
struct AttributeLook {
    ColorChannel::Rule rule = ColorChannel::Rule::ramp;  // or classification, or category
    std::string_view colormap = "fjord";                 // of a ramp
};
AttributeLook look_of_attribute(std::string_view name);

/// What to show when the user did not say: rgb, else intensity where it varies in type, else elevation.
std::string_view default_color(const CloudInfo& info);

/// The range of a channel from a sample of the cloud: the nodes nearest to the root, which are evenly spread over it.
/// Quantities reach from the 2nd to the 98th percentile, so that a stray echo or bird does not take all the contrast.
/// Colors reach to 255 where no channel of any sampled point is larger, though stored in 16 bits, else to the type's
/// maximum: one answer for the cloud, never one a channel. NaN, infinities and "no data" do not count.
ColorRange derive_range(const LayeredCloud& cloud, const ColorChannel& channel);
/// The same from values at hand.
ColorRange percentile_range(std::vector<double>& values, double low_share = 0.02, double high_share = 0.98);

/// Colors points. Made once a frame or once a cloud; safe from several threads.
class PointColorizer {
public:
    /// range     wanted where channel.needs_range(); ignored otherwise
    /// colormap  empty: the channel's own
    /// throws    Error{usage}: the color map is unknown; a logarithm's range is not positive
    PointColorizer(const CloudInfo& info, const ColorChannel& channel, ColorRange range, std::string_view colormap = {});

    /// Attributes that `color` reads: pass to read_node.
    std::span<const int> wanted() const { return wanted_; }

    /// Colors all points of a batch; out has batch.size entries. NaN and "no data" become gray.
    /// level  of the points' node
    void color(const PointBatch& batch, uint32_t level, std::span<Rgba8> out) const;

private:
    void color_normals(const PointBatch& batch, std::span<Rgba8> out) const;

    ColorChannel channel_;
    ScalarType type_ = ScalarType::uint8;
    int components_ = 1;
    double no_data_ = 0.0;            // stored value; NaN: there is none
    double gain_ = 0.0, bias_ = 0.0;  // table index = stored * gain + bias
    std::vector<Rgba8> table_;        // ramp: a color map; category and classification: by number
    std::vector<double> steps_;       // log_ramp: stored values at which the next entry of the table begins
    std::vector<Attribute> normal_;   // its three components
    std::vector<int> wanted_;
};

}  // namespace strata
