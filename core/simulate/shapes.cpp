#include "core/simulate/shapes.h"

#include <algorithm>
#include <cmath>

#include "core/simulate/waves.h"

namespace strata {
namespace {

Vec3d nearest_on_segment(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
    const Vec3d ab = b - a;
    const double length2 = ab.squaredNorm();
    return length2 > 0.0 ? Vec3d(a + std::clamp(ab.dot(p - a) / length2, 0.0, 1.0) * ab) : a;
}

// Keeps the side normal . p <= offset of a polygon.
std::vector<Vec3d> cut_polygon(const std::vector<Vec3d>& outline, const Vec3d& normal, double offset) {
    std::vector<Vec3d> kept;
    for (size_t i = 0; i < outline.size(); ++i) {
        const Vec3d &a = outline[i], &b = outline[(i + 1) % outline.size()];
        const double height_a = normal.dot(a) - offset, height_b = normal.dot(b) - offset;
        if (height_a <= 0.0) kept.push_back(a);
        if ((height_a < 0.0 && height_b > 0.0) || (height_a > 0.0 && height_b < 0.0))
            kept.push_back(a + height_a / (height_a - height_b) * (b - a));
    }
    return kept;
}

// Enters a recess at (s, z) of the face and finds the pane or the side that the ray meets in it.
void enter_opening(const Ray& ray, const Face& face, const Opening& o, RayHit& hit) {
    const double ds = ray.direction.dot(face.right), dz = ray.direction.dot(face.up), inward = -ray.direction.dot(face.normal);
    const double to_pane = kRecess / inward;
    const double to_side = ds > 0.0 ? (o.right - hit.along.x()) / ds : ds < 0.0 ? (o.left - hit.along.x()) / ds : INFINITY;
    const double to_lid = dz > 0.0 ? (o.high - hit.along.y()) / dz : dz < 0.0 ? (o.low - hit.along.y()) / dz : INFINITY;
    double step = to_pane;
    if (to_pane <= to_side && to_pane <= to_lid) {
        hit.part = Part::pane;
    } else if (to_side <= to_lid) {
        step = to_side;
        hit.normal = ds > 0.0 ? Vec3d(-face.right) : face.right;
    } else {
        step = to_lid;
        hit.normal = dz > 0.0 ? Vec3d(-face.up) : face.up;
    }
    hit.distance += step;
    hit.along += step * Vec2d(ds, dz);
}

}  // namespace

void NearestPoint::offer(const Vec3d& query, const Vec3d& candidate, const Vec3d& candidate_normal, Part candidate_part) {
    const double candidate_distance = (query - candidate).norm();
    if (candidate_distance >= distance) return;
    *this = {candidate_distance, candidate, candidate_normal, candidate_part};
}

Vec3d nearest_on_polygon(const std::vector<Vec3d>& outline, const Vec3d& normal, const Vec3d& p) {
    const Vec3d foot = p - normal.dot(p - outline[0]) * normal;
    bool inside_left = true, inside_right = true;
    for (size_t i = 0; i < outline.size(); ++i) {
        const Vec3d &a = outline[i], &b = outline[(i + 1) % outline.size()];
        const double side = normal.dot((b - a).cross(foot - a));
        inside_left &= side >= 0.0;
        inside_right &= side <= 0.0;
    }
    if (inside_left || inside_right) return foot;
    Vec3d nearest = outline[0];
    for (size_t i = 0; i < outline.size(); ++i) {
        const Vec3d candidate = nearest_on_segment(outline[i], outline[(i + 1) % outline.size()], p);
        if ((candidate - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = candidate;
    }
    return nearest;
}

std::vector<Vec3d> face_rectangle(const Face& face, const Opening& o, double depth) {
    const Vec3d back = face.corner - depth * face.normal;
    return {back + o.left * face.right + o.low * face.up, back + o.right * face.right + o.low * face.up,
            back + o.right * face.right + o.high * face.up, back + o.left * face.right + o.high * face.up};
}

void ConvexSolid::add_plane(const Vec3d& normal, const Vec3d& point, Part part) {
    Face face;
    face.normal = normal.normalized();
    face.offset = face.normal.dot(point);
    face.part = part;
    const Vec3d level = Vec3d::UnitZ().cross(face.normal);
    face.right = level.squaredNorm() > 1e-12 ? Vec3d(level.normalized()) : Vec3d::UnitX();
    face.up = face.normal.cross(face.right);
    face.corner = point;
    faces.push_back(face);
}

void ConvexSolid::close() {
    constexpr double kFar = 1000.0;  // metres; larger than any solid here
    for (Face& face : faces) {
        face.outline = face_rectangle(face, {-kFar, kFar, -kFar, kFar}, 0.0);
        for (const Face& other : faces)
            if (&other != &face) face.outline = cut_polygon(face.outline, other.normal, other.offset);
    }
    std::erase_if(faces, [](const Face& face) { return face.outline.size() < 3; });
    for (Face& face : faces) {
        double left = INFINITY, low = INFINITY;
        for (const Vec3d& p : face.outline) {
            left = std::min(left, face.right.dot(p - face.corner));
            low = std::min(low, face.up.dot(p - face.corner));
            bounds.extend(p);
        }
        face.corner += left * face.right + low * face.up;
    }
}

bool ConvexSolid::may_meet(const Ray& ray, const Vec3d& pace, double farthest) const {
    constexpr double kMargin = 1e-6;  // metres; rounding must not lose an edge
    double enter = 0.0, leave = farthest;
    for (const int axis : {0, 1, 2}) {
        const double low = (bounds.min[axis] - kMargin - ray.origin[axis]) * pace[axis];
        const double high = (bounds.max[axis] + kMargin - ray.origin[axis]) * pace[axis];
        enter = std::max(enter, std::min(low, high));
        leave = std::min(leave, std::max(low, high));
    }
    return enter <= leave;
}

bool ConvexSolid::meet(const Ray& ray, RayHit& nearest) const {
    double enter = 0.0, leave = nearest.distance;
    const Face* entered = nullptr;
    for (const Face& face : faces) {
        const double speed = face.normal.dot(ray.direction);
        const double left = face.offset - face.normal.dot(ray.origin);
        if (speed < 0.0) {
            const double t = left / speed;
            if (t > enter) {
                enter = t;
                entered = &face;
            }
        } else if (speed > 0.0) {
            leave = std::min(leave, left / speed);
        } else if (left < 0.0) {
            return false;
        }
        if (enter >= leave) return false;
    }
    if (!entered) return false;
    RayHit hit{.distance = enter, .normal = entered->normal, .part = entered->part, .face = entered};
    const Vec3d offset = ray.at(enter) - entered->corner;
    hit.along = Vec2d(entered->right.dot(offset), entered->up.dot(offset));
    for (const Opening& o : entered->openings) {
        if (hit.along.x() <= o.left || hit.along.x() >= o.right || hit.along.y() <= o.low || hit.along.y() >= o.high) continue;
        enter_opening(ray, *entered, o, hit);
        break;
    }
    if (hit.distance >= nearest.distance) return false;
    nearest = hit;
    return true;
}

bool ConvexSolid::contains(const Vec3d& p, double margin) const {
    for (const Face& face : faces) {
        const double depth = face.offset - face.normal.dot(p);
        if (depth <= margin) return false;
        if (depth >= kRecess + margin) continue;
        const double s = face.right.dot(p - face.corner), z = face.up.dot(p - face.corner);
        for (const Opening& o : face.openings)
            if (s > o.left - margin && s < o.right + margin && z > o.low - margin && z < o.high + margin && depth < kRecess + margin) return false;
    }
    return true;
}

bool Pillar::meet(const Ray& ray, RayHit& nearest) const {
    const double ox = ray.origin.x() - center.x(), oy = ray.origin.y() - center.y();
    const double dx = ray.direction.x(), dy = ray.direction.y();
    const double a = dx * dx + dy * dy, half_b = ox * dx + oy * dy, c = ox * ox + oy * oy - radius * radius;
    const double discriminant = half_b * half_b - a * c;
    if (discriminant < 0.0) return false;
    if (a > 0.0) {
        const double t = (-half_b - std::sqrt(discriminant)) / a;
        const double z = ray.origin.z() + t * ray.direction.z();
        if (t > 0.0 && t < nearest.distance && z >= low && z <= high) {
            nearest = {.distance = t, .normal = Vec3d(ox + t * dx, oy + t * dy, 0.0) / radius, .part = part, .owner = owner};
            nearest.along = Vec2d(0.0, z - low);
            return true;
        }
    }
    if (ray.direction.z() >= 0.0) return false;
    const double t = (high - ray.origin.z()) / ray.direction.z();
    const double px = ox + t * dx, py = oy + t * dy;
    if (t <= 0.0 || t >= nearest.distance || px * px + py * py > radius * radius) return false;
    nearest = {.distance = t, .normal = Vec3d::UnitZ(), .part = part, .owner = owner};
    nearest.along = Vec2d(0.0, high - low);
    return true;
}

bool Pillar::contains(const Vec3d& p, double margin) const {
    return p.z() > low && p.z() < high - margin && (p.head<2>() - center).norm() < radius - margin;
}

bool Wire::meet(const Ray& ray, double beam_radius, RayHit& nearest, Vec3d& point) const {
    // The parabola hangs at most `sag` straight below its chord, and the lines of beam and chord pass each other along their
    // common normal: most beams end here.
    const Vec3d normal = ray.direction.cross(end - begin);
    const double to_chord = normal.dot(begin - ray.origin), to_lowest = to_chord - sag * normal.z(), width = (radius + beam_radius) * normal.norm();
    if (std::min(to_chord, to_lowest) > width || std::max(to_chord, to_lowest) < -width) return false;
    // Least distance between the ray and the parabola: Newton on its derivative, from the nearest of a few places.
    const auto off_axis = [&](double s) {
        const Vec3d from = at(s) - ray.origin;
        return Vec3d(from - from.dot(ray.direction) * ray.direction);
    };
    double best = 0.0, best2 = INFINITY;
    constexpr int kStarts = 8;
    for (int i = 0; i <= kStarts; ++i) {
        const double s = double(i) / kStarts, d2 = off_axis(s).squaredNorm();
        if (d2 < best2) best2 = d2, best = s;
    }
    const Vec3d bend(0.0, 0.0, 8.0 * sag);
    for (int i = 0; i < 6; ++i) {
        const Vec3d gap = off_axis(best), along = tangent(best);
        const Vec3d across = along - along.dot(ray.direction) * ray.direction;
        const double rate = gap.dot(across), curve = across.squaredNorm() + gap.dot(bend);
        if (!(curve > 0.0)) break;
        best = std::clamp(best - rate / curve, 0.0, 1.0);
    }
    const double reach = radius + beam_radius;
    if (off_axis(best).squaredNorm() > reach * reach) return false;
    const Vec3d axis = tangent(best).normalized();
    Vec3d facing = -ray.direction + ray.direction.dot(axis) * axis;
    const double length = facing.norm();
    if (length < 1e-6) return false;  // along the wire
    facing /= length;
    const Vec3d candidate = at(best) + radius * facing;
    const double t = (candidate - ray.origin).norm();
    if (t >= nearest.distance) return false;
    nearest = {.distance = t, .normal = facing, .part = Part::wire};
    point = candidate;
    return true;
}

double Wire::nearest_parameter(const Vec3d& query) const {
    double best = 0.0, best2 = INFINITY;
    constexpr int kStarts = 16;
    for (int i = 0; i <= kStarts; ++i) {
        const double s = double(i) / kStarts, d2 = (at(s) - query).squaredNorm();
        if (d2 < best2) best2 = d2, best = s;
    }
    for (int i = 0; i < 12; ++i) {
        const Vec3d gap = at(best) - query, along = tangent(best);
        const double curve = along.squaredNorm() + gap.z() * 8.0 * sag;
        if (!(curve > 0.0)) break;
        best = std::clamp(best - gap.dot(along) / curve, 0.0, 1.0);
    }
    return best;
}

bool Crown::span(const Ray& ray, double& enter, double& leave) const {
    // Most beams pass beside the cylinder around it.
    const double dx = ray.direction.x(), dy = ray.direction.y();
    const double across = (center.x() - ray.origin.x()) * dy - (center.y() - ray.origin.y()) * dx;
    if (across * across > 1.0001 * radius * radius * (dx * dx + dy * dy)) return false;
    // In units of the ellipsoid it is a unit ball.
    const Vec3d scale(1.0 / radius, 1.0 / radius, 1.0 / half_height);
    const Vec3d o = (ray.origin - center).cwiseProduct(scale), d = ray.direction.cwiseProduct(scale);
    const double a = d.squaredNorm(), half_b = o.dot(d), c = o.squaredNorm() - 1.0;
    const double discriminant = half_b * half_b - a * c;
    if (discriminant <= 0.0) return false;
    const double root = std::sqrt(discriminant);
    enter = std::max(0.0, (-half_b - root) / a);
    leave = (-half_b + root) / a;
    return leave > enter;
}

bool Crown::leaves_at(const Vec3d& p, double share) const {
    const Vec3d q = p - center;
    const double level = q.z() / half_height;                          // -1 at the foot, 1 at the tip
    const double reach = std::sqrt(q.x() * q.x() + q.y() * q.y()) / radius;
    double outline = 1.0;  // radius of the crown here, of the ellipsoid's greatest
    if (kind == Crown::Kind::conifer) {
        const double whorl = (p.z() + double(seed % 7) * 0.1) / 0.9;  // branches stand in whorls 0.9 m apart
        outline = 0.56 * (1.0 - level) * (0.82 + 0.18 * std::abs(2.0 * (whorl - double(floor_to_int(whorl))) - 1.0));
        if (level < -0.92) outline = 0.0;
        if (reach > outline) return false;
    } else if (reach * reach + level * level > 1.0) {
        return false;
    }
    const double depth = kind == Crown::Kind::conifer ? reach / (outline + 1e-9) : std::sqrt(reach * reach + level * level);
    if (depth <= 0.55 && share >= 0.35) return false;  // most leaves are on the outside,
    // and hang in clumps. Told last, because the noise costs more than all before it.
    const double clump_size = kind == Crown::Kind::bush ? 0.35 : kind == Crown::Kind::conifer ? 0.5 : 0.9;
    const double edge = depth > 0.8 ? (1.0 - depth) * 4.0 : 1.0;  // frayed towards the outline
    const double clump = smooth_noise(p.x() / clump_size, p.y() / clump_size, p.z() / clump_size, seed);
    return clump >= 0.62 - 0.3 * std::min(1.0, edge);
}

}  // namespace strata
