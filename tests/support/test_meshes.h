#pragma once

#include <Eigen/Geometry>

#include "core/surface/triangle_mesh.h"

namespace strata {

// Closed meshes, counterclockwise seen from outside.

/// A grid of rows x columns vertices, closed around both ways where asked.
/// position(i, j)  of vertices
template <class Position>
TriangleMesh grid_mesh(uint32_t rows, uint32_t columns, bool around_rows, bool around_columns, const Position& position) {
    TriangleMesh mesh;
    for (uint32_t i = 0; i < rows; ++i)
        for (uint32_t j = 0; j < columns; ++j) mesh.positions.push_back(position(i, j));
    const auto vertex = [&](uint32_t i, uint32_t j) { return (i % rows) * columns + j % columns; };
    for (uint32_t i = 0; i + !around_rows < rows; ++i)
        for (uint32_t j = 0; j + !around_columns < columns; ++j) {
            mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)});
            mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
        }
    return mesh;
}

/// Rings of latitude from pole to pole; n >= 2.
inline TriangleMesh sphere_mesh(const Vec3d& center, double radius, uint32_t n) {
    TriangleMesh mesh = grid_mesh(n + 1, 2 * n, false, true, [&](uint32_t i, uint32_t j) {
        const double theta = M_PI * i / n, phi = M_PI * j / n, r = i == 0 || i == n ? 0.0 : std::sin(theta);
        return Vec3d(center + radius * Vec3d(r * std::cos(phi), r * std::sin(phi), std::cos(theta)));
    });
    std::erase_if(mesh.triangles, [&](const auto& t) {  // of the poles' points, which coincide
        return mesh.positions[t[0]] == mesh.positions[t[1]] || mesh.positions[t[1]] == mesh.positions[t[2]] ||
               mesh.positions[t[2]] == mesh.positions[t[0]];
    });
    return mesh;
}

inline TriangleMesh torus_mesh(const Vec3d& center, double major, double minor, uint32_t n) {
    return grid_mesh(n, n, true, true, [&](uint32_t i, uint32_t j) {
        const double a = 2.0 * M_PI * i / n, b = 2.0 * M_PI * j / n, r = major + minor * std::cos(b);
        return Vec3d(center + Vec3d(r * std::cos(a), r * std::sin(a), minor * std::sin(b)));
    });
}

/// center + turn * half * {-1, 1}^3
inline TriangleMesh box_mesh(const Vec3d& center, const Vec3d& half, const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
    TriangleMesh mesh;
    for (int i = 0; i < 8; ++i)
        mesh.positions.push_back(center + turn * half.cwiseProduct(Vec3d(i & 4 ? 1 : -1, i & 2 ? 1 : -1, i & 1 ? 1 : -1)));
    for (const std::array<uint32_t, 4>& q :
         {std::array<uint32_t, 4>{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}}) {
        mesh.triangles.push_back({q[0], q[1], q[2]});
        mesh.triangles.push_back({q[0], q[2], q[3]});
    }
    return mesh;
}

inline void append(TriangleMesh& mesh, const TriangleMesh& other) {
    const uint32_t first = uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
    for (const auto& t : other.triangles) mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
}

inline void turn_inside_out(TriangleMesh& mesh) {
    for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
}

/// The volume that a closed mesh encloses.
inline double volume_of(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const auto& t : mesh.triangles) sum += mesh.positions[t[0]].dot(mesh.positions[t[1]].cross(mesh.positions[t[2]]));
    return sum / 6.0;
}

}  // namespace strata
