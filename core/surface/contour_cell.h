#pragma once

#include <array>
#include <cstdint>

namespace strata {

/// A cell between 8 samples. Corner c is its sample (c & 1, c >> 1 & 1, c >> 2); a case has bit c where corner c is inside.
using CellValues = std::array<double, 8>;

/// Edges 0-3 run along i, at (j, k) = (e & 1, e >> 1); 4, 5 along j at i = 0 and k = 0, 1; 6, 7 along k at i = 0 and j = 0, 1; 8 to 11 are
/// 4 to 7 at i = 1. A cell's edges 0 to 7 are those that no later cell of its row has, which is what the order is for.
struct CellEdge {
    uint8_t lower, upper;  // corners
    uint8_t axis;
    uint8_t faces;  // the two that it lies in, bit 2 * axis + side
};
inline constexpr int kCellEdges = 12;

constexpr std::array<CellEdge, kCellEdges> make_cell_edges() {
    std::array<CellEdge, kCellEdges> edges{};
    for (unsigned e = 0; e < kCellEdges; ++e) {
        const unsigned side = e >= 8 ? 1 : 0, bit = e & 1;
        const unsigned axis = e < 4 ? 0 : (e & 2) == 0 ? 1 : 2;
        const unsigned lower = axis == 0 ? 2 * e : axis == 1 ? 4 * bit + side : 2 * bit + side;
        unsigned faces = 0;
        for (unsigned other = 0; other < 3; ++other)
            if (other != axis) faces |= 1u << (2 * other + (lower >> other & 1));
        edges[e] = {uint8_t(lower), uint8_t(lower + (1u << axis)), uint8_t(axis), uint8_t(faces)};
    }
    return edges;
}
inline constexpr std::array<CellEdge, kCellEdges> kCellEdge = make_cell_edges();

/// The edges of each case that are crossed, a bit each.
constexpr std::array<uint16_t, 256> make_crossed_edges() {
    std::array<uint16_t, 256> crossed{};
    for (unsigned cell_case = 0; cell_case < 256; ++cell_case)
        for (unsigned e = 0; e < kCellEdges; ++e)
            if (((cell_case >> kCellEdge[e].lower ^ cell_case >> kCellEdge[e].upper) & 1) != 0)
                crossed[cell_case] = uint16_t(crossed[cell_case] | 1u << e);
    return crossed;
}
inline constexpr std::array<uint16_t, 256> kCrossedEdges = make_crossed_edges();

/// Corners of face 2 * axis + side, counterclockwise seen from outside the cell.
constexpr std::array<std::array<uint8_t, 4>, 6> make_face_corners() {
    std::array<std::array<uint8_t, 4>, 6> faces{};
    for (unsigned axis = 0; axis < 3; ++axis)
        for (unsigned side = 0; side < 2; ++side) {
            const unsigned u = 1u << (axis + 1) % 3, v = 1u << (axis + 2) % 3, at = side << axis;
            if (side == 1) faces[2 * axis + side] = {uint8_t(at), uint8_t(at + u), uint8_t(at + u + v), uint8_t(at + v)};
            else faces[2 * axis + side] = {uint8_t(at), uint8_t(at + v), uint8_t(at + u + v), uint8_t(at + u)};
        }
    return faces;
}
inline constexpr std::array<std::array<uint8_t, 4>, 6> kFaceCorners = make_face_corners();

}  // namespace strata
