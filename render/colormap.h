#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/math/vec.h"
#include "render/image.h"

namespace strata {

/// What a color map is good for.
enum class ColormapKind { sequential, diverging, rainbow };

/// A row of the list of color maps.
struct ColormapName {
    std::string_view name;         // as in --colormap
    std::string_view description;  // for help
    ColormapKind kind;
};

std::span<const ColormapName> all_colormaps();

/// Colors for values in [0, 1], at equal perceived steps: the map is a curve in OKLab walked at constant speed, so equal
/// differences of the value look equally large. Lightness rises all along a sequential map, so that it survives a gray
/// print and color-blind eyes.
class Colormap {
public:
    static constexpr size_t kColors = 1024;

    /// throws  Error{usage}, naming the maps there are
    explicit Colormap(std::string_view name);

    /// The color at `t`, clamped to [0, 1]; sRGB, opaque.
    Rgba8 color(double t) const { return colors_[size_t((t < 1.0 ? (t > 0.0 ? t : 0.0) : 1.0) * double(kColors - 1) + 0.5)]; }
    const std::array<Rgba8, kColors>& colors() const { return colors_; }

private:
    std::array<Rgba8, kColors> colors_;
};

/// Colors of ASPRS classes (LAS 1.4 R15, table 17) as maps have them: ground brown, vegetation green, buildings red, water
/// blue, noise magenta. Classes without a meaning of their own get distinct colors too.
const std::array<Rgba8, 256>& classification_colors();
/// "ground", "high vegetation"; empty for reserved and user-defined classes.
std::string_view classification_name(uint8_t code);

/// Colors for numbers without an order (source ids, return numbers, levels): consecutive ones look different.
Rgba8 category_color(uint64_t number);

/// A direction of length 1: red, green and blue are 0.5 + 0.5 n.
Rgba8 direction_color(const Vec3f& direction);

}  // namespace strata
