#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/surface/contour_cell.h"

namespace strata {

/// The triangles of one cell, once it is known how the surface runs in it.
struct CellPatch {
    static constexpr int kMostTriangles = 18, kMostInner = 4;

    uint8_t triangles = 0;
    uint8_t inner = 0;                                      // vertices within the cell
    std::array<uint8_t, 3 * kMostTriangles> vertices = {};  // [triangles * 3] places: place_of_edge, place_of_inner
    std::array<uint16_t, kMostInner> inner_edges = {};      // [inner] the edges between whose vertices it lies, a bit each

    /// The vertices of a cell have 16 places: edges 0 to 7, those within the cell, and edges 8 to 11. So two vectors of eight hold them:
    /// the next vertices on the rows of edges 0 to 7 before and after the cell, where edges 8 to 11 are what comes after 4 to 7.
    static constexpr size_t kPlaces = 16;
    static constexpr uint8_t place_of_edge(size_t edge) { return uint8_t(edge < 8 ? edge : edge + 4); }
    static constexpr uint8_t place_of_inner(size_t n) { return uint8_t(8 + n); }
};

/// How a cell's surface was decided.
struct CellDecision {
    const CellPatch* patch = nullptr;
    bool tunnel = false;
};

/// The triangles of every way in which an isosurface of a trilinear function can run through a cell, derived rather than listed.
///
/// On each face the surface is hyperbolas, that is, segments between the crossings on its edges; where there are four crossings the face's
/// decision tells which belong together. Segments join to loops, and each loop bounds a disk, except where the interior joins two loops by
/// a tunnel. A disk is triangulated without a chord that lies in a face, since the cell on the other side may have the same chord, and such
/// an edge would have four triangles; where that cannot be, a vertex within the cell is its middle.
class CellCases {
public:
    static const CellCases& get();

    /// For cases that are whole without a decision: the same triangles, ready to be looked up.
    struct Plain {
        alignas(64) std::array<std::array<uint8_t, 16>, 256> vertices;  // of at most 5 triangles
        std::array<uint8_t, 256> triangles;                             // kUndecided: ask decide()
    };
    static constexpr uint8_t kUndecided = 0xff;
    const Plain& plain(bool mirrored) const { return plain_[mirrored]; }

    /// values  of the corners, less the isovalue; inside is positive or 0
    CellDecision decide(unsigned cell_case, const CellValues& values) const;

    /// Every patch that there is, with its case and whether it has a tunnel: for tests.
    struct Listed {
        unsigned cell_case;
        unsigned joined_faces;
        bool tunnel;
        CellPatch patch;
    };
    std::vector<Listed> list() const;

private:
    struct Tunnel {
        uint8_t corner_a, corner_b;  // of the two regions of the cell's boundary that it joins
        uint32_t patch;
    };
    struct Way {  // one decision for every ambiguous face
        uint32_t patch = 0;
        std::vector<Tunnel> tunnels;
    };

    CellCases();
    void derive(unsigned cell_case, unsigned joined_faces);

    std::array<Plain, 2> plain_ = {};
    std::array<uint8_t, 256> ambiguous_faces_ = {};
    std::array<uint32_t, 256> first_way_ = {};  // of the case; ways follow each other by the bits of their ambiguous faces
    std::vector<Way> ways_;
    std::vector<CellPatch> patches_;
};

/// The cells among 64 with an ambiguous face, or where all but two opposite corners are alike: plain() has no triangles for them.
/// corners  [8] whether that corner of each is inside
inline uint64_t undecided_cells(const std::array<uint64_t, 8>& corners) {
    uint64_t found = 0;
    for (const auto& face : kFaceCorners)
        found |= (corners[face[0]] ^ corners[face[1]]) & (corners[face[1]] ^ corners[face[2]]) & (corners[face[2]] ^ corners[face[3]]);
    for (size_t one = 0; one < 4; ++one) {
        uint64_t any = 0, all = ~uint64_t{0};  // of the other six
        for (size_t other = 0; other < 4; ++other) {
            if (other == one) continue;
            any |= corners[other] | corners[7 - other];
            all &= corners[other] & corners[7 - other];
        }
        found |= (corners[one] & corners[7 - one] & ~any) | (~(corners[one] | corners[7 - one]) & all);
    }
    return found;
}

}  // namespace strata
