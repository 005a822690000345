#pragma once

#include <span>

#include "core/math/box.h"
#include "core/math/vec.h"

namespace strata {

enum class Projection { perspective, orthographic };

/// Where a picture is taken from. View space has x to the right, y up and z towards the viewer; eye depth is -z, world
/// units. A picture's height fixes its scale: a wider picture shows more at its sides.
struct Camera {
    Projection projection = Projection::perspective;
    Vec3d eye = Vec3d::Zero();                   // world
    Mat3d view_from_world = Mat3d::Identity();   // a rotation: rows are right, up and backward
    double fov_rad = 0.8;                        // perspective: angle from the bottom to the top of the picture
    double height = 1.0;                         // orthographic: world units from the bottom to the top of the picture
    double near_depth = 1e-3;                    // what is nearer is not drawn
    double far_depth = 1e3;                      // orthographic: depths are told apart up to here; perspective has no end

    Vec3d right() const { return view_from_world.row(0).transpose(); }
    Vec3d up() const { return view_from_world.row(1).transpose(); }
    Vec3d forward() const { return -view_from_world.row(2).transpose(); }

    bool operator==(const Camera& other) const {
        return projection == other.projection && eye == other.eye && view_from_world == other.view_from_world &&
               fov_rad == other.fov_rad && height == other.height && near_depth == other.near_depth && far_depth == other.far_depth;
    }
};

/// The rotation that looks along `forward` with `up` upwards in the picture. Neither need have length 1.
/// throws  Error{usage}: not finite, no length, or parallel
Mat3d look_along(const Vec3d& forward, const Vec3d& up);

/// throws  Error{usage}, saying what is wrong: not finite, an angle that is not in (0, 179], a height that is not positive
void check_camera(const Camera& camera);

/// Pixels that a world unit covers at that eye depth.
double pixels_per_unit(const Camera& camera, double depth, uint32_t height_px);

/// Moves the eye (and sets `height` of an orthographic camera) so that the points fill the picture up to a margin,
/// keeping direction and angle: the nearest such place, exactly, for the points as given.
/// margin  fraction of the picture's width and height left free at each side
void frame_points(Camera& camera, std::span<const Vec3d> points, double aspect, double margin);

/// Sets near and far so that the whole box is told apart in depth, whatever lies in it.
void fit_depth_range(Camera& camera, const Box3d& bounds);

}  // namespace strata
