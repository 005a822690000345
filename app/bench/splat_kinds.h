#pragma once

#include <array>
#include <string_view>

#include "render/renderer.h"

namespace strata {

/// A way to draw points: what it changes of the settings. A new one is a row here; every report shows it then.
struct SplatKind {
    std::string_view name;
    void (*apply)(RenderSettings&);
};
inline constexpr std::array<SplatKind, 5> kSplatKinds = {{
    {"square", [](RenderSettings& settings) { settings.splat.shape = SplatShape::square; }},
    {"disc", [](RenderSettings& settings) { settings.splat.shape = SplatShape::disc; }},
    {"paraboloid", [](RenderSettings& settings) { settings.splat.shape = SplatShape::paraboloid; }},
    {"gaussian", [](RenderSettings& settings) { settings.splat.shape = SplatShape::gaussian; }},
    {"surfel", [](RenderSettings& settings) { settings.splat.shape = SplatShape::surfel; }},
}};

}  // namespace strata
