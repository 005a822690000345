#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/math/camera.h"
#include "core/simulate/scene.h"

namespace strata {

/// How far the depths of a picture are from the surface that was scanned. Of the pixels that count: see SurfaceTruth.
struct SurfaceError {
    uint64_t pixels = 0;       // that count and show a surface in truth
    double hole_share = 0.0;   // of those: the picture shows nothing, or something farther by more than the tolerance
    double bleed_share = 0.0;  // of all that count: it shows something nearer by more than the tolerance, or over the sky
    double depth_median = 0.0, depth_p99 = 0.0;  // metres from what is shown to the nearest surface; NaN: nothing is shown
};

/// What every pixel of a picture shows in truth: the surface of the village along the ray through its center.
/// Pixels that see leaves or pass a wire within two metres do not count, since leaves are no surface and a wire is none
/// that closes; nor do those whose surface was not scanned (in the shadow of a wall, beyond the survey's border).
class SurfaceTruth {
public:
    /// scanned  whether the cloud has points at a world position; called from several threads
    SurfaceTruth(const VillageScene& village, const Camera& camera, uint32_t width, uint32_t height,
                 const std::function<bool(const Vec3d&)>& scanned, int threads);

    /// depths     [pixels] eye depth, kNoDepth where nothing is shown
    /// tolerance  metres, measured across the true surface, so that steep views do not make errors of grazing ones
    SurfaceError measure(std::span<const float> depths, double tolerance, int threads) const;

private:
    struct Pixel {
        enum class Kind : uint8_t { skipped, sky, surface };
        Kind kind = Kind::skipped;
        double depth = 0.0;   // eye depth
        double facing = 0.0;  // cosine between ray and surface, over the depth that a metre of the ray takes
    };
    Ray ray_of(size_t pixel) const;  // in the village's coordinates

    const VillageScene* village_;
    Camera camera_;
    uint32_t width_, height_;
    std::vector<Pixel> pixels_;
};

}  // namespace strata
