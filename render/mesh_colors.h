#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "core/surface/triangle_mesh.h"
#include "render/image.h"
#include "render/point_color.h"

namespace strata {

/// Colors of a mesh's surface, before light. Safe from several threads.
class MeshColors {
public:
    enum class Rule {
        plain,      // one color for all, that of voxels
        rgb,        // of the vertices, between them in linear light
        elevation,  // z, through a color map
        normal,     // a direction, as points have it
        ramp,       // an attribute of vertices, between them evenly, through a color map; gray where a corner's is unknown
        category,   // an attribute without an order, such as classes: that of the nearest corner
    };

    /// name      rgb, elevation, normal, plain or an attribute; empty: rgb where vertices have colors, else plain
    /// range     of elevation or the attribute; none: from the mesh, the 2nd to the 98th percentile
    /// colormap  empty: the channel's own
    /// throws    Error{usage}: there is no such channel, or the mesh does not have what it shows
    MeshColors(const TriangleMesh& mesh, std::string_view name, std::optional<ColorRange> range, std::string_view colormap);

    Rule rule() const { return rule_; }
    const std::string& name() const { return name_; }
    /// Whether `name` is a rule of its own, and so none of an attribute.
    static bool is_rule(std::string_view name);

    /// weights  of the triangle's corners, at the place that is seen
    /// z        of that place, world
    /// normal   of the surface there
    /// returns  linear light, red, green, blue
    Vec3f light(const TriangleMesh& mesh, uint32_t triangle, const Vec3f& weights, double z, const Vec3f& normal) const;

private:
    Rgba8 ramp(double value) const;

    std::string name_;
    Rule rule_ = Rule::plain;
    size_t scalars_ = 0;  // of the mesh: the attribute
    ColorRange range_;
    std::array<Rgba8, 1024> table_;
};

/// The attribute that a name means: its own, or that with _ for what names in files cannot have; the size of mesh.scalars: none.
size_t find_mesh_scalars(const TriangleMesh& mesh, std::string_view name);

/// Of a color, linear light.
Vec3f linear_light(Rgba8 color);

}  // namespace strata
