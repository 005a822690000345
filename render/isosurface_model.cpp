#include "render/isosurface_model.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "render/colormap.h"

namespace strata {
namespace {

// The first as voxels and meshes.
constexpr std::array<Rgba8, 6> kPlain = {make_rgba(206, 200, 190), make_rgba(196, 122, 96),  make_rgba(118, 156, 178),
                                         make_rgba(150, 170, 110), make_rgba(178, 140, 180), make_rgba(214, 182, 104)};

constexpr std::pair<std::string_view, IsosurfaceColors::Rule> kRules[] = {
    {"plain", IsosurfaceColors::Rule::plain}, {"elevation", IsosurfaceColors::Rule::elevation}, {"normal", IsosurfaceColors::Rule::normal}};

}  // namespace

Rgba8 isosurface_color(size_t number) { return kPlain[number % kPlain.size()]; }

IsosurfaceColors::IsosurfaceColors(const FieldBricks& field, std::string_view name, size_t number, std::optional<ColorRange> range,
                                   std::string_view colormap) {
    if (name.empty()) name = "plain";
    const auto* const found = std::find_if(std::begin(kRules), std::end(kRules), [&](const auto& rule) { return rule.first == name; });
    if (found == std::end(kRules))
        throw Error(ErrorKind::usage, "isosurfaces have no '" + std::string(name) + "'; expected elevation, normal or plain");
    name_ = name;
    rule_ = found->second;
    table_.fill(isosurface_color(number));
    if (rule_ != Rule::elevation) return;
    table_ = Colormap(colormap.empty() ? "fjord" : colormap).colors();
    range_ = range ? *range : ColorRange{field.bounds().min.z(), field.bounds().max.z()};
}

Rgba8 IsosurfaceColors::color(double z, const Vec3f& normal) const {
    if (rule_ == Rule::normal) return direction_color(normal);
    if (rule_ == Rule::plain) return table_[0];
    const double extent = range_.high - range_.low, place = extent == 0.0 ? 0.5 : (z - range_.low) / extent;
    return table_[size_t(std::clamp(place, 0.0, 1.0) * double(table_.size() - 1) + 0.5)];
}

}  // namespace strata
