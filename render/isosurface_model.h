#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/surface/field_surface.h"
#include "render/image.h"
#include "render/point_color.h"

namespace strata {

/// The plain color of an isosurface, opaque: the first as voxels and meshes have it, the next five others, and so on over and over.
/// number  of the surface in a scene, or of the isovalue in a mesh
Rgba8 isosurface_color(size_t number);

/// Colors of isosurfaces, before light. Safe from several threads.
class IsosurfaceColors {
public:
    enum class Rule {
        plain,      // one color for all
        elevation,  // z, through a color map
        normal,     // a direction, as points have it
    };

    /// name      elevation, normal or plain; empty: plain
    /// number    of the surface in a scene, for isosurface_color()
    /// range     of elevation; none: from the field's bounds
    /// colormap  empty: the channel's own
    /// throws    Error{usage}: there is no such channel
    IsosurfaceColors(const FieldBricks& field, std::string_view name, size_t number, std::optional<ColorRange> range,
                     std::string_view colormap);

    Rule rule() const { return rule_; }
    const std::string& name() const { return name_; }
    /// z  of the place, world
    Rgba8 color(double z, const Vec3f& normal) const;

private:
    std::string name_;
    Rule rule_ = Rule::plain;
    ColorRange range_;
    std::array<Rgba8, 1024> table_;
};

/// An isosurface as a scene has it, drawn from the field itself. The field must outlive it.
struct IsosurfaceModel {
    /// opaque_part  in (0, 1]: how much of what is behind it hides
    IsosurfaceModel(FieldSurface shown, IsosurfaceColors painted, float opaque_part = 1.0f)
        : surface(std::move(shown)), bounds(surface_bounds(surface)), colors(std::move(painted)), opacity(opaque_part) {}

    FieldSurface surface;
    Box3d bounds;  // of the cells that it passes through; world
    IsosurfaceColors colors;
    float opacity;
};

}  // namespace strata
