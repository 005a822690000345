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
    };

    /// name      rgb, elevation, normal or plain; empty: rgb where vertices have colors, else plain
    /// range     of elevation; none: from the mesh
    /// colormap  empty: the channel's own
    /// throws    Error{usage}: there is no such channel, or the mesh does not have what it shows
    MeshColors(const TriangleMesh& mesh, std::string_view name, std::optional<ColorRange> range, std::string_view colormap);

    Rule rule() const { return rule_; }
    const std::string& name() const { return name_; }

    /// weights  of the triangle's corners, at the place that is seen
    /// z        of that place, world
    /// normal   of the surface there
    /// returns  linear light, red, green, blue
    Vec3f light(const TriangleMesh& mesh, uint32_t triangle, const Vec3f& weights, double z, const Vec3f& normal) const;

private:
    std::string name_;
    Rule rule_ = Rule::plain;
    ColorRange range_;
    std::array<Rgba8, 1024> table_;
};

/// Of a color, linear light.
Vec3f linear_light(Rgba8 color);

}  // namespace strata
