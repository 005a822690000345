#include "core/surface/cell_cases.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <map>
#include <set>

#include "core/math/random.h"

namespace strata {
namespace {

using Edge = std::pair<int, int>;

bool is_crossed(unsigned cell_case, size_t edge) {
    return (cell_case >> kCellEdge[edge].lower & 1) != (cell_case >> kCellEdge[edge].upper & 1);
}
bool in_one_face(int a, int b) {
    return a < kCellEdges && b < kCellEdges && (kCellEdge[size_t(a)].faces & kCellEdge[size_t(b)].faces) != 0;
}

// The vertices of a patch by number: 0 to 11 on edges, then those within the cell.
int vertex_at(uint8_t place) { return place < 8 ? place : place < 12 ? kCellEdges + place - 8 : place - 4; }
int vertex_of(const CellPatch& patch, size_t n) { return vertex_at(patch.vertices[n]); }

// How often each triangle edge is walked, and in which direction.
std::map<Edge, int> walks_of(const CellPatch& patch) {
    std::map<Edge, int> walks;
    for (size_t t = 0; t < patch.triangles; ++t)
        for (size_t n = 0; n < 3; ++n) ++walks[{vertex_of(patch, 3 * t + n), vertex_of(patch, 3 * t + (n + 1) % 3)}];
    return walks;
}

TEST(CellCases, EdgesAndFacesAreThoseOfACube) {
    std::set<std::pair<int, int>> edges;
    for (const CellEdge& edge : kCellEdge) {
        EXPECT_EQ(edge.upper - edge.lower, 1 << edge.axis);
        EXPECT_EQ(std::popcount(edge.faces), 2);
        edges.insert({edge.lower, edge.upper});
    }
    EXPECT_EQ(edges.size(), 12u);
    for (size_t e = 0; e < 4; ++e) EXPECT_EQ(kCellEdge[8 + e].lower, kCellEdge[4 + e].lower + 1);
    std::set<int> places;
    for (size_t e = 0; e < kCellEdges; ++e) {
        EXPECT_EQ(vertex_at(CellPatch::place_of_edge(e)), int(e));
        places.insert(CellPatch::place_of_edge(e));
    }
    for (size_t n = 0; n < CellPatch::kMostInner; ++n) {
        EXPECT_EQ(vertex_at(CellPatch::place_of_inner(n)), int(kCellEdges + n));
        places.insert(CellPatch::place_of_inner(n));
    }
    EXPECT_EQ(places.size(), CellPatch::kPlaces);
    // Each cube edge is walked once in either direction by the two faces that have it: all are seen from outside, or all from inside.
    std::set<std::pair<int, int>> walked;
    for (const auto& face : kFaceCorners)
        for (size_t n = 0; n < 4; ++n) EXPECT_TRUE(walked.insert({face[n], face[(n + 1) % 4]}).second);
    EXPECT_EQ(walked.size(), 24u);
}

// In each way that the surface can run, the patch is a manifold whose boundary is in the cell's faces, and nothing else of it is: the
// patches of two cells meet in the face's segments alone, whatever else the cells decide.
TEST(CellCases, EveryPatchIsAManifoldThatTouchesFacesOnlyWithItsBoundary) {
    std::map<std::pair<unsigned, unsigned>, std::set<Edge>> boundary_of;
    for (const CellCases::Listed& listed : CellCases::get().list()) {
        const std::string where = "case " + std::to_string(listed.cell_case) + ", faces " + std::to_string(listed.joined_faces) +
                                  (listed.tunnel ? ", tunnel" : "");
        const auto walks = walks_of(listed.patch);
        std::set<Edge> boundary;
        std::map<int, int> boundary_steps;
        for (const auto& [edge, count] : walks) {
            EXPECT_EQ(count, 1) << where;
            const bool inner = walks.count({edge.second, edge.first}) != 0;
            EXPECT_EQ(inner, !in_one_face(edge.first, edge.second)) << where << ", " << edge.first << "-" << edge.second;
            if (!inner) {
                boundary.insert(edge);
                ++boundary_steps[edge.first];
            }
        }
        // Each crossed edge of the cell has the one vertex, from which the boundary goes on once.
        for (size_t e = 0; e < kCellEdges; ++e)
            EXPECT_EQ(boundary_steps[int(e)], is_crossed(listed.cell_case, e)) << where << ", edge " << e;
        // Around a vertex within, the triangles are one fan: as many edges as triangles, connected.
        for (int v = kCellEdges; v < kCellEdges + listed.patch.inner; ++v) {
            std::map<int, int> next;
            for (size_t t = 0; t < listed.patch.triangles; ++t)
                for (size_t n = 0; n < 3; ++n)
                    if (vertex_of(listed.patch, 3 * t + n) == v)
                        next[vertex_of(listed.patch, 3 * t + (n + 1) % 3)] = vertex_of(listed.patch, 3 * t + (n + 2) % 3);
            ASSERT_GE(next.size(), 3u) << where;
            size_t walked = 0;
            int at = next.begin()->first;
            do {
                ++walked;
                at = next[at];
            } while (at != next.begin()->first && walked <= next.size());
            EXPECT_EQ(walked, next.size()) << where;
            EXPECT_EQ(std::popcount(listed.patch.inner_edges[size_t(v - kCellEdges)]) > 0, true) << where;
        }
        // A tunnel changes nothing at the faces.
        const auto [known, first] = boundary_of.insert({{listed.cell_case, listed.joined_faces}, boundary});
        if (!first) EXPECT_EQ(known->second, boundary) << where;
    }
    size_t ways = 0;
    for (unsigned cell_case = 0; cell_case < 256; ++cell_case) {
        size_t decisions = 1;
        for (const auto& face : kFaceCorners) {
            unsigned signs = 0;
            for (size_t n = 0; n < 4; ++n) signs |= (cell_case >> face[n] & 1) << n;
            if (signs == 0b0101 || signs == 0b1010) decisions *= 2;
        }
        ways += decisions;
    }
    EXPECT_EQ(boundary_of.size(), ways);
}

// Across a face the boundary of one cell's patch is that of the other's, walked the other way.
TEST(CellCases, NeighborsAgreeOnTheirFace) {
    std::map<std::pair<unsigned, unsigned>, std::set<Edge>> boundary_of;
    for (const CellCases::Listed& listed : CellCases::get().list()) {
        if (listed.tunnel) continue;
        const auto walks = walks_of(listed.patch);
        for (const auto& [edge, count] : walks)
            if (walks.count({edge.second, edge.first}) == 0) boundary_of[{listed.cell_case, listed.joined_faces}].insert(edge);
    }
    for (unsigned axis = 0; axis < 3; ++axis) {
        const unsigned near = 2 * axis, far = near + 1, step = 1u << axis;
        // The signs on the far face of one, as (signs, decision) -> segments named by the cube edges of the near face.
        std::map<std::pair<unsigned, bool>, std::set<Edge>> on_far, on_near;
        const auto edge_at = [&](size_t e, bool shift) {
            for (int n = 0; n < kCellEdges; ++n)
                if (kCellEdge[size_t(n)].lower == kCellEdge[e].lower - (shift ? step : 0) && kCellEdge[size_t(n)].axis == kCellEdge[e].axis)
                    return n;
            return -1;
        };
        for (const auto& [way, edges] : boundary_of)
            for (const unsigned face : {near, far}) {
                unsigned signs = 0;
                for (unsigned c = 0; c < 8; ++c)
                    if ((c >> axis & 1) == (face & 1)) signs |= (way.first >> c & 1) << (c & ~step);
                std::set<Edge> segments;
                for (const auto& [a, b] : edges) {
                    if ((kCellEdge[size_t(a)].faces & kCellEdge[size_t(b)].faces & 1u << face) == 0) continue;
                    const int p = edge_at(size_t(a), face == far), q = edge_at(size_t(b), face == far);
                    segments.insert(face == far ? Edge(p, q) : Edge(q, p));
                }
                const auto [known, first] = (face == far ? on_far : on_near).insert({{signs, (way.second >> face & 1) != 0}, segments});
                EXPECT_EQ(known->second, segments);  // and nothing else of the cell matters
            }
        EXPECT_EQ(on_far, on_near);
    }
}

TEST(CellCases, PlainTablesAreThePatchesAndTurnedInAMirror) {
    for (const CellCases::Listed& listed : CellCases::get().list()) {
        const auto& plain = CellCases::get().plain(false);
        const auto& mirrored = CellCases::get().plain(true);
        const uint8_t triangles = plain.triangles[listed.cell_case];
        EXPECT_EQ(mirrored.triangles[listed.cell_case], triangles);
        if (triangles == CellCases::kUndecided) continue;
        EXPECT_EQ(triangles, listed.patch.triangles);
        EXPECT_EQ(listed.joined_faces, 0u);
        EXPECT_FALSE(listed.tunnel);
        for (size_t v = 0; v < 3u * triangles; ++v) {
            EXPECT_EQ(plain.vertices[listed.cell_case][v], listed.patch.vertices[v]);
            EXPECT_EQ(mirrored.vertices[listed.cell_case][v / 3 * 3 + 2 - v % 3], listed.patch.vertices[v]);
        }
    }
}

TEST(CellCases, AFaceIsDecidedTheSameFromBothSides) {
    Random random(11);
    for (int n = 0; n < 20000; ++n) {
        // Two cells that share the face i = 1 of the first, with alternating signs there and values that nearly tie.
        CellValues a, b;
        for (double& v : a) v = double(float(random.uniform(-1.0, 1.0)));
        for (double& v : b) v = double(float(random.uniform(-1.0, 1.0)));
        const double scale = std::ldexp(1.0, int(random.bits() % 40) - 20);
        const double p = double(float(random.uniform(0.5, 1.0) * scale)), q = double(float(random.uniform(0.5, 1.0)));
        a[1] = p;
        a[7] = q;
        a[3] = n % 2 == 0 ? -p : -q;
        a[5] = n % 2 == 0 ? -q : -p;
        if (n % 3 == 0) a[5] = std::nextafter(float(a[5]), -3.0f);
        for (size_t c : {1, 3, 5, 7}) b[c - 1] = a[c];
        unsigned case_a = 0, case_b = 0;
        for (size_t c = 0; c < 8; ++c) {
            case_a |= unsigned(a[c] >= 0.0) << c;
            case_b |= unsigned(b[c] >= 0.0) << c;
        }
        const auto segments = [](const CellPatch& patch, unsigned face) {
            std::set<Edge> found;
            for (const auto& [edge, count] : walks_of(patch))
                if (edge.first < kCellEdges && edge.second < kCellEdges &&
                    (kCellEdge[size_t(edge.first)].faces & kCellEdge[size_t(edge.second)].faces & 1u << face) != 0)
                    found.insert(edge);
            return found;
        };
        const auto of_a = segments(*CellCases::get().decide(case_a, a).patch, 1);
        std::set<Edge> of_b;
        for (const auto& [p_edge, q_edge] : segments(*CellCases::get().decide(case_b, b).patch, 0)) {
            // Edges of the face i = 0 and those of i = 1: 4-7 and 8-11; the other edges of the face do not run along i.
            of_b.insert({q_edge + 4, p_edge + 4});
        }
        ASSERT_EQ(of_a, of_b);
    }
}

}  // namespace
}  // namespace strata
