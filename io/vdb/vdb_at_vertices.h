#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>

#include "core/surface/grid_at_vertices.h"
#include "io/vdb/vdb_field.h"

namespace strata {

/// Values of a grid at vertices, trilinear between points; away from its leaves they are those of its tiles or its background.
class VdbAtVertices : public ValuesAtVertices {
public:
    explicit VdbAtVertices(std::unique_ptr<VdbField> field) : field_(std::move(field)), places_(field_->placement()) {}
    void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) override;

private:
    std::unique_ptr<VdbField> field_;
    PlacesInGrid places_;
};

/// A grid of vectors as colors of vertices, trilinear between active points alone: what is not active is no color. Gray and opaque where
/// no active point is near.
class VdbColorsAtVertices : public ColorsAtVertices {
public:
    /// components  red, green and blue, of fields made with only_active
    /// encode      a part of a color as it is stored to sRGB
    VdbColorsAtVertices(std::array<std::unique_ptr<VdbField>, 3> components, std::function<uint8_t(float)> encode);
    void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<std::array<uint8_t, 4>> out) override;

private:
    std::array<std::unique_ptr<VdbField>, 3> components_;
    std::function<uint8_t(float)> encode_;
    PlacesInGrid places_;
};

}  // namespace strata
