#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/math/box.h"
#include "core/math/vec.h"

namespace strata {

/// A half-line; the direction has length 1.
struct Ray {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitZ();

    Vec3d at(double distance) const { return origin + distance * direction; }
};

/// What a surface is made of, as far as color, reflectance and class depend on it.
/// hidden: between two solids of one building, or below ground; never seen
enum class Part : uint8_t { ground, water, wall, pane, roof, roof_edge, chimney, spire, stone, pole, trunk, wire, leaf, hidden };

struct Face;

/// Where a ray meets a surface first.
struct RayHit {
    double distance = std::numeric_limits<double>::infinity();
    Vec3d normal = Vec3d::UnitZ();  // outward
    Part part = Part::ground;
    uint32_t owner = 0;           // index of the building or tree in its tile
    Vec2d along = Vec2d::Zero();  // on walls and roofs: metres along the face and up it, from its low corner
    const Face* face = nullptr;   // of solids; lives as long as the tile

    bool found() const { return distance < std::numeric_limits<double>::infinity(); }
};

/// The point of a surface that is nearest to a query.
struct NearestPoint {
    double distance = std::numeric_limits<double>::infinity();
    Vec3d point = Vec3d::Zero();
    Vec3d normal = Vec3d::UnitZ();  // outward, length 1
    Part part = Part::ground;

    void offer(const Vec3d& query, const Vec3d& candidate, const Vec3d& candidate_normal, Part candidate_part);
};

/// A window or door: a rectangle of a wall, set back by kRecess.
struct Opening {
    double left = 0.0, right = 0.0, low = 0.0, high = 0.0;  // metres along and up the wall
};
inline constexpr double kRecess = 0.14;  // metres

/// A polygon of a convex solid.
struct Face {
    Vec3d normal = Vec3d::UnitZ();  // outward
    double offset = 0.0;            // normal . p = offset on the plane, less inside
    Part part = Part::wall;
    Vec3d corner = Vec3d::Zero();   // where `along` is (0, 0)
    Vec3d right = Vec3d::UnitX();   // first axis of `along`
    Vec3d up = Vec3d::UnitZ();      // second axis
    std::vector<Vec3d> outline;     // the polygon, in order
    std::vector<Opening> openings;  // vertical faces only
};

/// An intersection of half-spaces, with recessed openings.
class ConvexSolid {
public:
    /// Adds the half-space normal . (p - point) <= 0. `right`: horizontal axis of the face; its corner is `corner`.
    void add_plane(const Vec3d& normal, const Vec3d& point, Part part);
    /// Finds the faces' outlines, corners and the bounds. Once, after the last plane. The solid must be bounded.
    void close();

    /// May the ray meet the solid before `farthest`? Cheap; `pace`: 1 / direction, of each axis.
    bool may_meet(const Ray& ray, const Vec3d& pace, double farthest) const;
    bool meet(const Ray& ray, RayHit& nearest) const;  // true: `nearest` was replaced by something nearer
    bool contains(const Vec3d& p, double margin) const;  // deeper than margin
    /// Calls offer(candidate, normal, part, face) with the nearest point of each piece of the surface.
    template <typename Offer>
    void nearest_points(const Vec3d& query, Offer&& offer) const;

    std::vector<Face> faces;
    Box3d bounds;
};

/// A vertical cylinder with a flat top; its foot is in the ground.
struct Pillar {
    Vec2d center = Vec2d::Zero();
    double low = 0.0, high = 0.0, radius = 0.1;
    Part part = Part::pole;
    uint32_t owner = 0;

    bool meet(const Ray& ray, RayHit& nearest) const;
    bool contains(const Vec3d& p, double margin) const;
};

/// A thin tube along a parabola between two points.
struct Wire {
    Vec3d begin = Vec3d::Zero(), end = Vec3d::Zero();
    double sag = 0.0, radius = 0.01;

    Vec3d at(double s) const { return begin + s * (end - begin) - Vec3d(0.0, 0.0, 4.0 * sag * s * (1.0 - s)); }
    Vec3d tangent(double s) const { return end - begin - Vec3d(0.0, 0.0, 4.0 * sag * (1.0 - 2.0 * s)); }
    /// Meets the wire when the beam, `beam_radius` wide, touches it; the point lies on the side of the tube that faces the
    /// beam's origin.
    bool meet(const Ray& ray, double beam_radius, RayHit& nearest, Vec3d& point) const;
    double nearest_parameter(const Vec3d& query) const;
};

/// Leaves: a cloud inside an ellipsoid of revolution, not a surface.
struct Crown {
    enum class Kind : uint8_t { broadleaf, conifer, bush };

    Vec3d center = Vec3d::Zero();
    double radius = 1.0, half_height = 1.0;
    Kind kind = Kind::broadleaf;
    uint32_t seed = 0;

    /// The part of the ray inside the ellipsoid. returns false when it misses
    bool span(const Ray& ray, double& enter, double& leave) const;
    /// Do leaves hang at p where `share` of the densest is asked for? For a share drawn evenly from [0, 1), the chance is the leaf area
    /// per volume that a beam meets, over kDensest.
    bool leaves_at(const Vec3d& p, double share) const;
    static constexpr double kDensest = 2.4;  // 1/m
};

/// The point of a convex polygon nearest to p, both in one plane or not.
Vec3d nearest_on_polygon(const std::vector<Vec3d>& outline, const Vec3d& normal, const Vec3d& p);

// The four corners of a rectangle of a face, set back by `depth`.
std::vector<Vec3d> face_rectangle(const Face& face, const Opening& opening, double depth);

template <typename Offer>
void ConvexSolid::nearest_points(const Vec3d& query, Offer&& offer) const {
    for (const Face& face : faces) {
        if (face.part == Part::hidden) continue;
        const Vec3d candidate = nearest_on_polygon(face.outline, face.normal, query);
        const double s = face.right.dot(candidate - face.corner), z = face.up.dot(candidate - face.corner);
        bool in_hole = false;
        for (const Opening& o : face.openings) {
            in_hole |= s > o.left && s < o.right && z > o.low && z < o.high;
            // Around the opening: the pane, then the four sides that lead to it.
            const auto outer = face_rectangle(face, o, 0.0), inner = face_rectangle(face, o, kRecess);
            offer(nearest_on_polygon(inner, face.normal, query), face.normal, Part::pane, face);
            for (size_t i = 0; i < 4; ++i) {
                const size_t j = (i + 1) % 4;
                const Vec3d normal = face.normal.cross(outer[j] - outer[i]).normalized();  // into the opening
                offer(nearest_on_polygon({outer[i], outer[j], inner[j], inner[i]}, normal, query), normal, Part::wall, face);
            }
        }
        if (!in_hole) offer(candidate, face.normal, face.part, face);
    }
}

}  // namespace strata
