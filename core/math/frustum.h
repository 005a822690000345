#pragma once

#include <array>

#include "core/math/box.h"
#include "core/math/camera.h"

namespace strata {

/// The part of the world that a camera shows: half spaces through or around the eye. Perspective has no far side.
class Frustum {
public:
    Frustum(const Camera& camera, double aspect);

    /// False only when no point of the box is in sight. May be true for boxes that lie just outside.
    bool intersects(const Box3d& box) const;

private:
    struct Plane {
        Vec3d normal;  // inwards
        double offset;
    };
    Vec3d eye_;
    std::array<Plane, 5> planes_;  // relative to the eye: left, right, bottom, top, near
};

}  // namespace strata
