#include "core/voxel/hole_caps.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "core/math/random.h"
#include "core/voxel/solid_angle_kernel.h"

namespace strata {
namespace {

using Point = HoleCaps::Point;

struct BoundaryEdge {
    uint32_t from, to;
};

// Edges that triangles run through more often one way than the other, so often. name: of a vertex, the same for all at its place.
template <class Name>
std::vector<BoundaryEdge> boundary_of(const std::vector<std::array<uint32_t, 3>>& triangles, size_t vertices, const Name& name) {
    // All edges of a vertex lie together, under the lower name.
    struct End {
        uint32_t other;
        int32_t turns;
    };
    std::vector<uint64_t> place(vertices + 1);
    const auto each_edge = [&](auto&& visit) {
        for (const auto& t : triangles) {
            const std::array<uint32_t, 3> v = {name(t[0]), name(t[1]), name(t[2])};
            for (size_t k = 0; k < 3; ++k)
                if (const uint32_t a = v[k], b = v[k == 2 ? 0 : k + 1]; a != b) visit(std::min(a, b), std::max(a, b), a < b ? 1 : -1);
        }
    };
    each_edge([&](uint32_t low, uint32_t, int32_t) { ++place[low + 1]; });
    for (size_t i = 1; i < place.size(); ++i) place[i] += place[i - 1];
    std::vector<End> ends(place.back());
    {
        std::vector<uint64_t> next(place.begin(), place.end() - 1);
        each_edge([&](uint32_t low, uint32_t high, int32_t turns) { ends[next[low]++] = {high, turns}; });
    }
    std::vector<BoundaryEdge> boundary;
    for (uint32_t v = 0; v < vertices; ++v) {
        const auto begin = ends.begin() + std::ptrdiff_t(place[v]), end = ends.begin() + std::ptrdiff_t(place[v + 1]);
        std::sort(begin, end, [](const End& a, const End& b) { return a.other < b.other; });
        for (auto run = begin; run != end;) {
            const uint32_t other = run->other;
            int64_t turns = 0;
            for (; run != end && run->other == other; ++run) turns += run->turns;
            for (; turns > 0; --turns) boundary.push_back({v, other});
            for (; turns < 0; ++turns) boundary.push_back({other, v});
        }
    }
    return boundary;
}

// For each vertex that a triangle uses the first such at its place.
std::vector<uint32_t> first_at_place(const TriangleMesh& mesh, const GridMesh& grid) {
    constexpr uint32_t kNone = ~uint32_t{0};
    const size_t n = mesh.positions.size();
    std::vector<uint32_t> table(std::bit_ceil(2 * n + 1), kNone), first(n, kNone);
    for (const auto& triangle : mesh.triangles)
        for (const uint32_t v : triangle) first[v] = v;
    for (size_t i = 0; i < n; ++i) {
        if (first[i] == kNone) continue;  // it may lie anywhere
        const Point p = grid.place(uint32_t(i));
        size_t slot = mix_bits(uint64_t(p[0]) ^ mix_bits(uint64_t(p[1]) ^ mix_bits(uint64_t(p[2])))) & (table.size() - 1);
        while (table[slot] != kNone && grid.place(table[slot]) != p) slot = (slot + 1) & (table.size() - 1);
        if (table[slot] == kNone) table[slot] = uint32_t(i);
        first[i] = table[slot];
    }
    return first;
}

Vec3d vector_of(const Point& p) { return {double(p[0]), double(p[1]), double(p[2])}; }

// det(a - p, b - p, c - p): its sign exact where all differences have 40 bits. Where it is 0, that of p moved as lattice points are.
struct Determinant {
    double size;
    int sign;
};
Determinant determinant(const std::array<Point, 3>& t, const Point& p) {
    std::array<Point, 3> d;
    int64_t most = 0;
    for (size_t k = 0; k < 3; ++k)
        for (size_t a = 0; a < 3; ++a) {
            d[k][a] = t[k][a] - p[a];
            most = std::max(most, std::abs(d[k][a]));
        }
    const auto sign_of = [](auto x) { return (x > 0) - (x < 0); };
    const auto minor = [&]<class Number>(size_t a, size_t b, Number) {
        return Number(d[1][a]) * Number(d[2][b]) - Number(d[1][b]) * Number(d[2][a]);
    };
    const auto value = [&]<class Number>(Number n) {
        return Number(d[0][0]) * minor(1, 2, n) + Number(d[0][1]) * minor(2, 0, n) + Number(d[0][2]) * minor(0, 1, n);
    };
    if (most >= int64_t{1} << 40) {
        const long double det = value(0.0L);
        return {double(std::abs(det)), sign_of(det)};
    }
    const Int128 det = value(Int128{0});
    if (det != 0) return {double(det < 0 ? -det : det), sign_of(det)};
    const auto normal = [&](size_t a, size_t b) {
        return Int128(t[1][a] - t[0][a]) * (t[2][b] - t[0][b]) - Int128(t[1][b] - t[0][b]) * (t[2][a] - t[0][a]);
    };
    for (const auto& [a, b] : {std::pair<size_t, size_t>{0, 1}, {1, 2}, {2, 0}})  // z, x, y: the order in which p is moved
        if (const Int128 n = normal(a, b); n != 0) return {0.0, -sign_of(n)};
    return {0.0, 0};
}

// Seen from a distance d, an area takes a solid angle of no more than area / d^2. Infinite where boxes meet.
template <class Part>
double bound_of(const Part& part, const Vec3d& low, const Vec3d& high) {
    return part.area / (4.0 * M_PI * (low - part.box.max).cwiseMax(part.box.min - high).cwiseMax(0.0).squaredNorm());
}

constexpr double kMostOfOthers = 0.02;  // winding number of all parts that are not looked at one by one
constexpr double kRounding = 1e-9;      // winding numbers over 1/2 by no more than this are not over it

}  // namespace

uint64_t HoleCaps::memory_needed(const TriangleMesh& mesh) { return 24 * mesh.triangles.size() + 16 * mesh.positions.size() + 24; }

HoleCaps::HoleCaps(const TriangleMesh& mesh, const GridMesh& grid) : bits_(grid.bits()) {
    std::vector<BoundaryEdge> boundary = boundary_of(mesh.triangles, mesh.positions.size(), [](uint32_t v) { return v; });
    if (boundary.empty()) return;
    {
        const std::vector<uint32_t> first = first_at_place(mesh, grid);
        boundary = boundary_of(mesh.triangles, mesh.positions.size(), [&](uint32_t v) { return first[v]; });
    }
    // Parts that hang together, in the order of their first edges.
    std::map<uint32_t, uint32_t> parent;
    const auto root = [&](uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const auto& [from, to] : boundary) {
        parent.try_emplace(from, from);
        parent.try_emplace(to, to);
        parent[root(from)] = root(to);
    }
    std::map<uint32_t, uint32_t> part_of_root;
    std::vector<std::vector<BoundaryEdge>> edges;
    for (const BoundaryEdge& edge : boundary) {
        const auto [found, added] = part_of_root.try_emplace(root(edge.from), uint32_t(edges.size()));
        if (added) edges.emplace_back();
        edges[found->second].push_back(edge);
    }
    for (const std::vector<BoundaryEdge>& part_edges : edges) {
        std::array<Int128, 3> sum = {};
        for (const BoundaryEdge& edge : part_edges) {
            const Point p = grid.place(edge.from);
            for (size_t a = 0; a < 3; ++a) sum[a] += p[a];
        }
        Point apex;
        for (size_t a = 0; a < 3; ++a) apex[a] = int64_t(sum[a] / Int128(part_edges.size())) | 1;  // no center of a voxel
        Part part;
        part.begin = caps_.size();
        part.apex = vector_of(apex);
        part.box.extend(part.apex);
        for (const BoundaryEdge& edge : part_edges) {
            caps_.push_back({grid.place(edge.to), grid.place(edge.from), apex});  // against the triangle at the edge
            const Vec3d p = vector_of(caps_.back()[0]), q = vector_of(caps_.back()[1]), r = vector_of(apex);
            part.box.extend(p);
            part.box.extend(q);
            part.area += 0.5 * (q - p).cross(r - p).norm();
        }
        part.end = caps_.size();
        parts_.push_back(part);
    }
    for (const auto& [ends, which] : {std::pair{&from_, size_t{0}}, {&to_, size_t{1}}})
        for (const std::array<Point, 3>& cap : caps_) {
            ends->x.push_back(double(cap[which][0]));
            ends->y.push_back(double(cap[which][1]));
            ends->z.push_back(double(cap[which][2]));
        }
}

void HolesNearby::look_from(const std::array<uint32_t, 3>& first, uint32_t size) {
    near_.clear();
    all_.clear();
    by_bound_.clear();
    far_ = 0.0;
    const double unit = std::ldexp(1.0, caps_.bits_);
    const Vec3d low = unit * Vec3d(first[0], first[1], first[2]), high = low.array() + unit * size;
    for (uint32_t i = 0; i < caps_.parts_.size(); ++i) {
        const HoleCaps::Part& part = caps_.parts_[i];
        if (part.area == 0.0) continue;
        all_.push_back(i);
        by_bound_.push_back({bound_of(part, low, high), i});
    }
    std::sort(by_bound_.begin(), by_bound_.end());
    for (const auto& [bound, i] : by_bound_) {
        if (near_.empty() && far_ + bound < kMostOfOthers) far_ += bound;
        else near_.push_back(i);
    }
    std::sort(near_.begin(), near_.end());
}

std::optional<int> HolesNearby::least_inside(const std::array<uint32_t, 3>& first, uint32_t size, bool capped) {
    const double unit = std::ldexp(1.0, caps_.bits_);
    const Vec3d low = unit * (Vec3d(first[0], first[1], first[2]).array() + 0.5).matrix(), high = low.array() + unit * (size - 1);
    double most = far_;
    for (const uint32_t i : near_) most += bound_of(caps_.parts_[i], low, high);
    if (most < 0.499) return 1;
    if (capped) return {};
    Point center;
    for (size_t a = 0; a < 3; ++a) center[a] = (int64_t{2 * first[a] + size} << caps_.bits_) / 2;
    const double radius = 0.5 * std::sqrt(3.0) * unit * (size - 1);
    const double change = slope_bound(vector_of(center), radius) * radius + far_ + 2.0 * kRounding;
    if (!(change < 0.5)) return {};
    const double limit = 0.5 + winding(center, near_);
    if (std::floor(limit - change) != std::floor(limit + change)) return {};
    return int(std::floor(limit + kRounding)) + 1;
}

int HolesNearby::least_inside(const std::array<uint32_t, 3>& voxel) {
    Point center;
    for (size_t a = 0; a < 3; ++a) center[a] = (int64_t{2 * voxel[a] + 1} << caps_.bits_) / 2;
    double limit = 0.5 + winding(center, near_);
    if (const double change = far_ + 2.0 * kRounding; far_ > 0.0 && std::floor(limit - change) != std::floor(limit + change))
        limit = 0.5 + winding(center, all_);
    return int(std::floor(limit + kRounding)) + 1;
}

// A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Trans. Biomed. Eng. 30, 1983: half of it is the angle of
// (below, det). Angles are added by multiplying them as complex numbers, and counting how often that goes around.
double HolesNearby::winding(const Point& p, const std::vector<uint32_t>& parts) {
    const Vec3d origin = vector_of(p);
    int64_t halves = 0;     // of a turn, of half a solid angle
    double quarters = 0.0;  // likewise, where a cap is seen from its rim
    double re = 1.0, im = 0.0;
    for (const uint32_t i : parts) {
        const HoleCaps::Part& part = caps_.parts_[i];
        const size_t n = part.end - part.begin;
        if (scale_.size() < n) {
            scale_.resize(n);
            angle_sine_.resize(n);
            angle_cosine_.resize(n);
        }
        double *const sine = angle_sine_.data(), *const cosine = angle_cosine_.data(), *const scales = scale_.data();
        const auto at = [&](const PointColumns& points) {
            return PointColumn{points.x.data() + part.begin, points.y.data() + part.begin, points.z.data() + part.begin};
        };
        half_solid_angles(n, at(caps_.from_), at(caps_.to_), part.apex, origin, sine, cosine, scales);
        for (size_t k = 0; k < n; ++k) {
            double s = sine[k], c = cosine[k];
            if (std::abs(s) < 1e-13 * scales[k] && c < 1e-3 * scales[k]) {  // which side p is on is decided in integers
                const Determinant det = determinant(caps_.caps_[part.begin + k], p);
                if (det.size == 0.0) {
                    if (std::abs(c) <= 1e-12 * scales[k]) quarters += 0.5 * det.sign;
                    else if (c < 0.0) halves += det.sign;
                    continue;
                }
                s = det.sign * std::max(std::abs(s), 1e-16 * scales[k]);
            }
            const double product_re = re * c - im * s, product_im = re * s + im * c;
            if (im >= 0.0 && s >= 0.0 && product_im < 0.0) halves += 2;
            if (im < 0.0 && s < 0.0 && product_im >= 0.0) halves -= 2;
            re = product_re;
            im = product_im;
            if (const double size = std::abs(re) + std::abs(im); size < 1e-100 || size > 1e100) {  // far from what a double holds
                re = size > 0.0 ? re / size : 1.0;
                im = size > 0.0 ? im / size : 0.0;
            }
        }
    }
    return 0.5 * (std::atan2(im, re) / M_PI + double(halves) + quarters);
}

// The gradient of a winding number is a line integral along the boundary, that of dl x r / (4 pi r^3), as Biot and Savart have it.
double HolesNearby::slope_bound(const Vec3d& center, double radius) const {
    double sum = 0.0;
    for (const uint32_t i : near_)
        for (size_t k = caps_.parts_[i].begin; k < caps_.parts_[i].end; ++k) {
            const Vec3d p = Vec3d(caps_.from_.x[k], caps_.from_.y[k], caps_.from_.z[k]) - center;
            const Vec3d edge = Vec3d(caps_.to_.x[k], caps_.to_.y[k], caps_.to_.z[k]) - center - p;
            const double length2 = edge.squaredNorm();
            const double t = std::clamp(-p.dot(edge) / length2, 0.0, 1.0);
            const double distance = (p + t * edge).norm() - radius;
            if (distance <= 0.0) return std::numeric_limits<double>::infinity();
            sum += std::sqrt(length2) / (distance * distance);
        }
    return sum / (4.0 * M_PI);
}

}  // namespace strata
