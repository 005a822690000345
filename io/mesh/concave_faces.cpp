#include "io/mesh/concave_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

namespace strata {
namespace {

using Triangle = std::array<uint32_t, 3>;

constexpr size_t kMostCorners = 10'000;  // of a face that is cut anew: the time grows as the square
constexpr double kFlat = 1e-6;           // of the face's area: what a triangle of a fan may turn the wrong way, by the rounding of corners in line

Vec3d area_of(const std::vector<Vec3d>& positions, const Triangle& t) {
    return (positions[t[1]] - positions[t[0]]).cross(positions[t[2]] - positions[t[0]]);
}

// A polygon that is counterclockwise in its plane.
class EarClipping {
public:
    EarClipping(std::span<const Triangle> fan, const std::vector<Vec3d>& positions, const Vec3d& normal)
        : count_(uint32_t(fan.size() + 2)), least_(1e-12 * normal.norm()) {
        const Vec3d w = normal.normalized(), u = w.unitOrthogonal(), v = w.cross(u), origin = positions[fan.front()[0]];
        for (uint32_t i = 0; i < count_; ++i) {
            vertices_.push_back(i < 2 ? fan.front()[i] : fan[i - 2][2]);
            const Vec3d p = positions[vertices_.back()] - origin;
            places_.emplace_back(u.dot(p), v.dot(p));
            before_.push_back((i + count_ - 1) % count_);
            after_.push_back((i + 1) % count_);
        }
        outward_.resize(count_);
        ear_.resize(count_);
        for (uint32_t i = 0; i < count_; ++i) {
            outward_[i] = turns_out(i);
            if (!outward_[i]) inward_.push_back(i);
        }
        for (uint32_t i = 0; i < count_; ++i) ear_[i] = is_ear(i);
    }

    // Each triangle goes in the place of one of the fan.
    void cut(std::span<Triangle> out) {
        uint32_t at = 1;
        for (Triangle& triangle : out) {
            at = next_tip(at);
            const uint32_t a = before_[at], c = after_[at];
            triangle = {vertices_[a], vertices_[at], vertices_[c]};
            if (!outward_[at]) std::erase(inward_, at);
            after_[a] = c;
            before_[c] = a;
            --count_;
            // Cutting off an ear changes nothing for others: where one of them was hindered by a corner that turns outwards, one that turns inwards hindered, too.
            for (const uint32_t neighbor : {a, c}) {
                if (!outward_[neighbor] && turns_out(neighbor)) {
                    outward_[neighbor] = true;
                    std::erase(inward_, neighbor);
                }
                ear_[neighbor] = is_ear(neighbor);
            }
            at = c;
        }
    }

private:
    static double turn(const Vec2d& a, const Vec2d& b, const Vec2d& c) { return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()); }

    bool turns_out(uint32_t i) const { return turn(places_[before_[i]], places_[i], places_[after_[i]]) > least_; }

    // What crosses itself or has no area may have no ear: then any corner that turns outwards, then any.
    uint32_t next_tip(uint32_t from) const {
        for (const std::vector<bool>* const wanted : {&ear_, &outward_}) {
            uint32_t i = from;
            for (uint32_t n = 0; n < count_; ++n, i = after_[i])
                if ((*wanted)[i]) return i;
        }
        return from;
    }

    // Nothing of the polygon lies in the triangle. Corners at the places of the triangle's own, as where a hole is joined to the outline, are no hindrance.
    bool is_ear(uint32_t i) const {
        if (!outward_[i]) return false;
        const Vec2d &a = places_[before_[i]], &b = places_[i], &c = places_[after_[i]];
        const Vec2d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        for (const uint32_t other : inward_) {
            const Vec2d& p = places_[other];
            if (p.x() < low.x() || p.x() > high.x() || p.y() < low.y() || p.y() > high.y() || p == a || p == b || p == c) continue;
            if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return false;
        }
        return true;
    }

    uint32_t count_;  // of corners left
    double least_;    // turns below are none
    std::vector<uint32_t> vertices_, before_, after_;
    std::vector<Vec2d> places_;
    std::vector<bool> outward_, ear_;
    std::vector<uint32_t> inward_;  // corners left that do not turn outwards
};

// Whether it stays a fan that should not.
bool cut_anew(TriangleMesh& mesh, std::span<Triangle> fan) {
    Vec3d normal = Vec3d::Zero();  // of twice the face's area
    for (const Triangle& triangle : fan) normal += area_of(mesh.positions, triangle);
    const double squared = normal.squaredNorm();
    if (!(squared > 0.0 && std::isfinite(squared))) return false;
    const bool fits = std::all_of(fan.begin(), fan.end(), [&](const Triangle& t) { return area_of(mesh.positions, t).dot(normal) >= -kFlat * squared; });
    if (fits) return false;
    if (fan.size() + 2 > kMostCorners) return true;
    EarClipping(fan, mesh.positions, normal).cut(fan);
    return false;
}

}  // namespace

void ConcaveFaces::add_fan(TriangleMesh& mesh, size_t begin, bool placed) {
    const size_t count = mesh.triangles.size() - begin;
    if (count < 2) return;
    if (placed)
        too_long_ += cut_anew(mesh, std::span(mesh.triangles).subspan(begin));
    else
        memory_.push(waiting_, {uint32_t(begin), uint32_t(count)});
}

void ConcaveFaces::finish(TriangleMesh& mesh, std::vector<std::string>& notes) {
    for (const auto& [begin, count] : waiting_) too_long_ += cut_anew(mesh, std::span(mesh.triangles).subspan(begin, count));
    memory_.release(waiting_);
    if (too_long_ > 0) notes.push_back(std::to_string(too_long_) + " concave faces of more than " + std::to_string(kMostCorners) + " corners are cut as if they were convex");
}

}  // namespace strata
