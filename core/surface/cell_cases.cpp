#include "core/surface/cell_cases.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>
#include <utility>

#include "core/surface/cell_interior.h"
#include "core/surface/joined.h"

namespace strata {
namespace {

using Loop = std::vector<int>;  // edges; the surface is to the left, seen from outside of what it bounds

bool is_inside(unsigned cell_case, unsigned corner) { return (cell_case >> corner & 1) != 0; }
bool is_ambiguous(unsigned cell_case, int face) {
    const auto& corners = kFaceCorners[size_t(face)];
    for (size_t i = 0; i < 4; ++i)
        if (is_inside(cell_case, corners[i]) == is_inside(cell_case, corners[(i + 1) % 4])) return false;
    return true;
}
bool share_face(int a, int b) { return (kCellEdge[size_t(a)].faces & kCellEdge[size_t(b)].faces) != 0; }

int edge_between(unsigned a, unsigned b) {
    for (int e = 0; e < kCellEdges; ++e)
        if (kCellEdge[size_t(e)].lower == std::min(a, b) && kCellEdge[size_t(e)].upper == std::max(a, b)) return e;
    return -1;
}

// The loops of segments on the faces. Going around a face counterclockwise, seen from outside the cell, a segment leads from where the
// round enters the inside to where it leaves it; then triangles along loops are counterclockwise seen from outside the surface.
std::vector<Loop> trace_loops(unsigned cell_case, unsigned joined_faces) {
    std::array<int, kCellEdges> next;
    next.fill(-1);
    for (int face = 0; face < 6; ++face) {
        std::array<int, 2> leaving = {-1, -1}, entering = {-1, -1};
        int leaves = 0, enters = 0;
        for (size_t i = 0; i < 4; ++i) {
            const unsigned from = kFaceCorners[size_t(face)][i], to = kFaceCorners[size_t(face)][(i + 1) % 4];
            if (is_inside(cell_case, from) == is_inside(cell_case, to)) continue;
            if (is_inside(cell_case, from)) leaving[size_t(leaves++)] = edge_between(from, to);
            else entering[size_t(enters++)] = edge_between(from, to);
        }
        if (leaves == 1) next[size_t(entering[0])] = leaving[0];
        if (leaves != 2) continue;
        // In the order of the round, leaving i is followed by an entering. What is apart inside is cut off: to the entering before it.
        const bool first_is_inside = is_inside(cell_case, kFaceCorners[size_t(face)][0]);
        const size_t after = first_is_inside ? 0 : 1;  // the entering that follows leaving 0
        const bool joined = (joined_faces >> face & 1) != 0;
        const size_t partner = joined ? after : 1 - after;
        next[size_t(entering[partner])] = leaving[0];
        next[size_t(entering[1 - partner])] = leaving[1];
    }
    std::vector<Loop> loops;
    std::array<bool, kCellEdges> seen = {};
    for (int e = 0; e < kCellEdges; ++e) {
        if (next[size_t(e)] < 0 || seen[size_t(e)]) continue;
        Loop loop;
        for (int at = e; !seen[size_t(at)]; at = next[size_t(at)]) {
            seen[size_t(at)] = true;
            loop.push_back(at);
        }
        loops.push_back(std::move(loop));
    }
    return loops;
}

// Squared distance of the middles of two edges, times 4.
int squared_distance(int a, int b) {
    int sum = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
        const auto twice = [axis](int e) {
            return int(kCellEdge[size_t(e)].lower >> axis & 1) + int(kCellEdge[size_t(e)].upper >> axis & 1);
        };
        const int d = twice(a) - twice(b);
        sum += d * d;
    }
    return sum;
}

constexpr int kNever = 1 << 20;

void add_triangle(CellPatch& patch, int a, int b, int c) {
    assert(patch.triangles < CellPatch::kMostTriangles);
    const size_t at = size_t(3) * patch.triangles++;
    patch.vertices[at] = uint8_t(a);
    patch.vertices[at + 1] = uint8_t(b);
    patch.vertices[at + 2] = uint8_t(c);
}

int add_inner(CellPatch& patch, uint16_t edges) {
    assert(patch.inner < CellPatch::kMostInner);
    patch.inner_edges[patch.inner] = edges;
    return kCellEdges + patch.inner++;
}

// The chords of least total squared length that cut a loop into triangles, none of them in a face.
void add_disk(const Loop& loop, CellPatch& patch) {
    const size_t n = loop.size();
    std::vector<std::vector<int>> cost(n, std::vector<int>(n, kNever)), apex(n, std::vector<int>(n, -1));
    for (size_t span = 1; span < n; ++span)
        for (size_t i = 0; i + span < n; ++i) {
            const size_t j = i + span;
            if (span == 1) {
                cost[i][j] = 0;
                continue;
            }
            const bool is_side = span == n - 1;
            if (!is_side && share_face(loop[i], loop[j])) continue;
            for (size_t m = i + 1; m < j; ++m)
                if (const int sum = cost[i][m] + cost[m][j] + (is_side ? 0 : squared_distance(loop[i], loop[j])); sum < cost[i][j]) {
                    cost[i][j] = sum;
                    apex[i][j] = int(m);
                }
        }
    if (cost[0][n - 1] >= kNever) {
        uint16_t edges = 0;
        for (const int e : loop) edges = uint16_t(edges | 1u << e);
        const int middle = add_inner(patch, edges);
        for (size_t i = 0; i < n; ++i) add_triangle(patch, loop[i], loop[(i + 1) % n], middle);
        return;
    }
    const auto add = [&](const auto& self, size_t i, size_t j) -> void {
        if (j - i < 2) return;
        const auto m = size_t(apex[i][j]);
        self(self, i, m);
        add_triangle(patch, loop[i], loop[m], loop[j]);
        self(self, m, j);
    };
    add(add, 0, n - 1);
}

// A band between two loops, with chords of least total squared length, none of them in a face and none twice: there are few to try.
class BandSearch {
public:
    BandSearch(const Loop& a, const Loop& b) : a_(a), b_(b.rbegin(), b.rend()) {}  // along a, b runs the other way

    /// returns  false: there is none
    bool add_to(CellPatch& patch) {
        for (first_ = 0; first_ < b_.size(); ++first_) {
            used_ = {};
            steps_.clear();
            extend(0, 0, 0);
        }
        if (least_ == kNever) return false;
        size_t i = 0, j = best_first_;
        for (const bool along_a : best_) {
            if (along_a) {
                add_triangle(patch, from_a(i), from_a(i + 1), from_b(j));
                ++i;
            } else {
                add_triangle(patch, from_b(j + 1), from_b(j), from_a(i));
                ++j;
            }
        }
        return true;
    }

private:
    int from_a(size_t i) const { return a_[i % a_.size()]; }
    int from_b(size_t j) const { return b_[j % b_.size()]; }

    // From the chord between a's i-th vertex and b's j-th after the first, all chords before it being used, at that cost.
    void extend(size_t i, size_t j, int cost) {
        const int p = from_a(i), q = from_b(first_ + j);
        if (i == a_.size() && j == b_.size()) {  // back at the first chord
            if (cost >= least_) return;
            least_ = cost;
            best_ = steps_;
            best_first_ = first_;
            return;
        }
        if (share_face(p, q) || used_[size_t(p)][size_t(q)] || cost + squared_distance(p, q) >= least_) return;
        cost += squared_distance(p, q);
        used_[size_t(p)][size_t(q)] = true;
        for (const bool along_a : {true, false}) {
            if (along_a ? i == a_.size() : j == b_.size()) continue;
            steps_.push_back(along_a);
            extend(i + (along_a ? 1 : 0), j + (along_a ? 0 : 1), cost);
            steps_.pop_back();
        }
        used_[size_t(p)][size_t(q)] = false;
    }

    Loop a_, b_;
    size_t first_ = 0, best_first_ = 0;
    int least_ = kNever;
    std::vector<bool> steps_, best_;  // true: along a
    std::array<std::array<bool, kCellEdges>, kCellEdges> used_ = {};
};

// A band by way of a ring of three vertices within the cell, each amid a third of either loop.
void add_band_by_ring(const Loop& a, const Loop& b, CellPatch& patch) {
    const Loop back(b.rbegin(), b.rend());
    const auto begin_of = [](size_t n, size_t third) { return third * n / 3; };
    size_t turn = 0;  // of b, so that thirds lie beside each other
    double least = std::numeric_limits<double>::infinity();
    for (size_t candidate = 0; candidate < b.size(); ++candidate) {
        double sum = 0.0;
        for (size_t third = 0; third < 3; ++third) {
            const size_t i0 = begin_of(a.size(), third), i1 = begin_of(a.size(), third + 1);
            const size_t j0 = begin_of(b.size(), third), j1 = begin_of(b.size(), third + 1);
            for (size_t i = i0; i < i1; ++i)
                for (size_t j = j0; j < j1; ++j)
                    sum += double(squared_distance(a[i], back[(j + candidate) % b.size()])) / double((i1 - i0) * (j1 - j0));
        }
        if (sum >= least) continue;
        least = sum;
        turn = candidate;
    }
    const auto other = [&](size_t j) { return back[(j + turn) % b.size()]; };
    std::array<int, 4> ring;
    for (size_t third = 0; third < 3; ++third) {
        unsigned edges = 0;
        for (size_t i = begin_of(a.size(), third); i < begin_of(a.size(), third + 1); ++i) edges |= 1u << a[i];
        for (size_t j = begin_of(b.size(), third); j < begin_of(b.size(), third + 1); ++j) edges |= 1u << other(j);
        ring[third] = add_inner(patch, uint16_t(edges));
    }
    ring[3] = ring[0];
    for (size_t third = 0; third < 3; ++third) {
        const size_t i1 = begin_of(a.size(), third + 1), j1 = begin_of(b.size(), third + 1);
        for (size_t i = begin_of(a.size(), third); i < i1; ++i) add_triangle(patch, a[i], a[(i + 1) % a.size()], ring[third]);
        add_triangle(patch, ring[third + 1], ring[third], a[i1 % a.size()]);
        for (size_t j = begin_of(b.size(), third); j < j1; ++j) add_triangle(patch, other(j + 1), other(j), ring[third]);
        add_triangle(patch, ring[third], ring[third + 1], other(j1));
    }
}

// With the vertices, until now 0 to 11 on edges and from 12 on within, in their places.
CellPatch placed(CellPatch patch) {
    for (uint8_t& v : patch.vertices) v = v < kCellEdges ? CellPatch::place_of_edge(v) : CellPatch::place_of_inner(size_t(v - kCellEdges));
    return patch;
}

// Regions of the cell's boundary, each known by its least corner.
Joined<8> join_corners_on_boundary(unsigned cell_case, unsigned joined_faces) {
    Joined<8> regions;
    for (const CellEdge& edge : kCellEdge)
        if (is_inside(cell_case, edge.lower) == is_inside(cell_case, edge.upper)) regions.join(edge.lower, edge.upper);
    for (int face = 0; face < 6; ++face) {
        if (!is_ambiguous(cell_case, face)) continue;
        const auto& corners = kFaceCorners[size_t(face)];
        const bool inside_joined = (joined_faces >> face & 1) != 0;
        const size_t first = is_inside(cell_case, corners[0]) == inside_joined ? 0 : 1;
        regions.join(corners[first], corners[first + 2]);
    }
    return regions;
}

}  // namespace

const CellCases& CellCases::get() {
    static const CellCases cases;
    return cases;
}

CellCases::CellCases() {
    for (unsigned cell_case = 0; cell_case < 256; ++cell_case) {
        for (int face = 0; face < 6; ++face)
            if (is_ambiguous(cell_case, face)) ambiguous_faces_[cell_case] |= uint8_t(1u << face);
        first_way_[cell_case] = uint32_t(ways_.size());
        const unsigned ambiguous = ambiguous_faces_[cell_case];
        unsigned joined = 0;  // every subset of the ambiguous faces, in the order of their bits put together
        do {
            derive(cell_case, joined);
            joined = (joined - ambiguous) & ambiguous;
        } while (joined != 0);

        const Way& way = ways_[first_way_[cell_case]];
        const CellPatch& patch = patches_[way.patch];
        const bool is_plain = ambiguous == 0 && way.tunnels.empty();
        assert(!is_plain || (patch.triangles <= 5 && patch.inner == 0));
        for (const bool mirrored : {false, true}) {
            Plain& plain = plain_[mirrored];
            plain.triangles[cell_case] = is_plain ? patch.triangles : kUndecided;
            plain.vertices[cell_case] = {};
            for (size_t t = 0; is_plain && t < patch.triangles; ++t)
                for (size_t v = 0; v < 3; ++v) plain.vertices[cell_case][3 * t + v] = patch.vertices[3 * t + (mirrored ? 2 - v : v)];
        }
    }
}

void CellCases::derive(unsigned cell_case, unsigned joined_faces) {
    const std::vector<Loop> loops = trace_loops(cell_case, joined_faces);
    Way way{.patch = uint32_t(patches_.size()), .tunnels = {}};
    CellPatch disks;
    for (const Loop& loop : loops) add_disk(loop, disks);
    patches_.push_back(placed(disks));

    const Joined<8> regions = join_corners_on_boundary(cell_case, joined_faces);
    const auto region = [&](const Loop& loop, bool inside) {
        const CellEdge& edge = kCellEdge[size_t(loop[0])];
        return regions.find(is_inside(cell_case, edge.lower) == inside ? edge.lower : edge.upper);
    };
    for (size_t i = 0; i < loops.size(); ++i)
        for (size_t j = i + 1; j < loops.size(); ++j)
            for (const bool inside : {false, true}) {  // which side of both loops the tunnel joins; on the other they have one region
                if (region(loops[i], !inside) != region(loops[j], !inside)) continue;
                CellPatch patch;
                if (!BandSearch(loops[i], loops[j]).add_to(patch)) add_band_by_ring(loops[i], loops[j], patch);
                for (size_t other = 0; other < loops.size(); ++other)
                    if (other != i && other != j) add_disk(loops[other], patch);
                way.tunnels.push_back({uint8_t(region(loops[i], inside)), uint8_t(region(loops[j], inside)), uint32_t(patches_.size())});
                patches_.push_back(placed(patch));
            }
    ways_.push_back(std::move(way));
}

CellDecision CellCases::decide(unsigned cell_case, const CellValues& values) const {
    uint32_t way_index = first_way_[cell_case];
    uint32_t bit = 1;
    for (unsigned faces = ambiguous_faces_[cell_case]; faces != 0; faces &= faces - 1) {
        const auto& corners = kFaceCorners[size_t(std::countr_zero(faces))];
        const double even = values[corners[0]] * values[corners[2]], odd = values[corners[1]] * values[corners[3]];
        // Both cells of a face find the same: a product does not depend on the order of its factors. What is not finite leaves it apart.
        const bool joined = is_inside(cell_case, corners[0]) ? even >= odd : odd >= even;
        if (joined) way_index += bit;
        bit <<= 1;
    }
    const Way& way = ways_[way_index];
    if (!way.tunnels.empty()) {
        const std::array<uint8_t, 8> joined = join_corners_within(values, cell_case);
        for (const Tunnel& tunnel : way.tunnels)
            if (joined[tunnel.corner_a] == joined[tunnel.corner_b]) return {&patches_[tunnel.patch], true};
    }
    return {&patches_[way.patch], false};
}

std::vector<CellCases::Listed> CellCases::list() const {
    std::vector<Listed> all;
    for (unsigned cell_case = 0; cell_case < 256; ++cell_case) {
        const unsigned ambiguous = ambiguous_faces_[cell_case];
        unsigned joined = 0;
        size_t way = first_way_[cell_case];
        do {
            all.push_back({cell_case, joined, false, patches_[ways_[way].patch]});
            for (const Tunnel& tunnel : ways_[way].tunnels) all.push_back({cell_case, joined, true, patches_[tunnel.patch]});
            ++way;
            joined = (joined - ambiguous) & ambiguous;
        } while (joined != 0);
    }
    return all;
}

}  // namespace strata
