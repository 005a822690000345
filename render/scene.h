#pragma once

#include <cstdint>

#include "core/math/box.h"
#include "core/octree/layered_cloud.h"

namespace strata {

/// The opaque things that a picture shows, by their numbers in pixel ids: the cloud is 0. They fill one G-buffer; what is
/// nearer wins, and of what is equally near the lower number. A scene owns nothing: what it names must outlive the frame.
struct Scene {
    LayeredCloud* cloud = nullptr;  // none: no points

    Scene() = default;
    Scene(LayeredCloud& only) : cloud(&only) {}  // a cloud is a scene

    /// World; as the headers state it, so it may be too large. Empty for an empty scene.
    Box3d bounds() const { return cloud != nullptr ? cloud->info().bounds : Box3d(); }
};

}  // namespace strata
