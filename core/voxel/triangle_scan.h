#pragma once

// Which cells of a grid a triangle meets, decided in integers alone. Everything here is one idea: for a row of columns of cells, the
// range of columns and then, column by column, the range of cells. Both are quotients that are carried on by additions as a line is
// drawn, so that a column costs some additions and no division, and none of it is rounded.

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <limits>
#include <vector>

namespace strata {

__extension__ using Int128 = __int128;

/// Corners in grid units: whole numbers whose differences along an axis are at most 2^30.
struct GridTriangle {
    std::array<std::array<int32_t, 3>, 3> corners;
};

/// Cells, first and last included: cell i of size 2^c units is [i, i + 1] * 2^c.
struct CellRange {
    std::array<int32_t, 3> first, last;

    bool empty() const { return first[0] > last[0] || first[1] > last[1] || first[2] > last[2]; }
    CellRange clipped(const CellRange& to) const {
        CellRange range;
        for (size_t a = 0; a < 3; ++a) {
            range.first[a] = std::max(first[a], to.first[a]);
            range.last[a] = std::min(last[a], to.last[a]);
        }
        return range;
    }
};

/// Cells of 2^c units that the triangle's box touches.
inline CellRange touched_cells(const GridTriangle& t, int c) {
    CellRange range;
    for (size_t a = 0; a < 3; ++a) {
        const auto [low, high] = std::minmax({t.corners[0][a], t.corners[1][a], t.corners[2][a]});
        range.first[a] = (low - 1) >> c;
        range.last[a] = high >> c;
    }
    return range;
}

inline std::array<int64_t, 3> normal_of(const GridTriangle& t) {
    const auto& [p, q, r] = t.corners;
    const auto part = [&](size_t a, size_t b) { return int64_t{q[a] - p[a]} * (r[b] - p[b]) - int64_t{q[b] - p[b]} * (r[a] - p[a]); };
    return {part(1, 2), part(2, 0), part(0, 1)};
}

/// floor(a / b) and what is left, for b > 0.
struct Quotient {
    int64_t whole, rest;
};
inline Quotient divide_down(int64_t a, int64_t b) {
    Quotient q = {a / b, a % b};
    if (q.rest < 0) {
        q.rest += b;
        --q.whole;
    }
    return q;
}
inline Quotient divide_down(Int128 a, int64_t b) {
    Int128 whole = a / b;
    Int128 rest = a - whole * b;
    if (rest < 0) {
        rest += b;
        --whole;
    }
    return {int64_t(whole), int64_t(rest)};
}

/// floor((start + i * step) / divisor) for i = 0, 1, ...
class SteppedQuotient {
public:
    SteppedQuotient(Quotient start, Quotient step, int64_t divisor) : now_(start), step_(step), divisor_(divisor) {}

    int64_t whole() const { return now_.whole; }
    bool exact() const { return now_.rest == 0; }
    void advance() {
        now_.whole += step_.whole;
        now_.rest += step_.rest - divisor_;
        const int64_t under = now_.rest >> 63;  // all ones where the rest did not reach the divisor
        now_.rest += divisor_ & under;
        now_.whole += 1 + under;
    }

private:
    Quotient now_, step_;
    int64_t divisor_;
};

/// Cells of a row, both ends included; first > last: none.
struct CellSpan {
    int32_t first = std::numeric_limits<int32_t>::max(), last = std::numeric_limits<int32_t>::min();

    bool empty() const { return first > last; }
    void extend(int32_t low, int32_t high) {
        first = std::min(first, low);
        last = std::max(last, high);
    }
};

/// How lines through the centers of columns meet an edge of a triangle's projection.
enum class EdgeRule {
    closed,  // a center on the edge lies inside
    moved    // each center counts as if it lay a little higher along a, and much less higher along b: inside exactly one of neighbors
};

/// Scans triangles. Keeps its buffers: one a thread.
/// c     a cell is 2^c units
/// clip  the cells that are asked for
class TriangleScanner {
public:
    /// Cells whose closed box shares a point with the triangle: those that no plane of the separating axis theorem (three faces, the
    /// triangle's plane, nine of an edge and an axis) has strictly on the other side. A triangle of no area is a segment or a point.
    /// emit(w, i, j, first, last)  a run of cells along axis w at i along axis w + 1 and j along w + 2 (mod 3)
    template <class Emit>
    void scan_touched(const GridTriangle& t, int c, const CellRange& clip, Emit&& emit) {
        const CellRange box = touched_cells(t, c);
        const CellRange range = box.clipped(clip);
        if (range.empty()) return;
        const std::array<int64_t, 3> n = normal_of(t);
        std::array<int, 3> extent;
        for (size_t a = 0; a < 3; ++a) extent[a] = box.last[a] - box.first[a];
        // A row of cells: as it is connected, the triangle meets every one.
        for (int w = 0; w < 3; ++w) {
            const int u = next(w), v = next(u);
            if (extent[size_t(u)] != 0 || extent[size_t(v)] != 0) continue;
            emit(w, range.first[size_t(u)], range.first[size_t(v)], range.first[size_t(w)], range.last[size_t(w)]);
            return;
        }
        if (std::max({extent[0], extent[1], extent[2]}) < 4) {
            scan_few(t, n, c, box, range, emit);
            return;
        }
        // Along the axis nearest to the normal the plane leaves few cells a column.
        const std::array<uint64_t, 3> size = {magnitude(n[0]), magnitude(n[1]), magnitude(n[2])};
        const int w = size[0] >= size[1] ? (size[0] >= size[2] ? 0 : 2) : (size[1] >= size[2] ? 1 : 2);
        const int u = next(w), v = next(u);
        const size_t su = size_t(u), sv = size_t(v), sw = size_t(w);
        const int rows = range.last[su] - range.first[su] + 1, columns = range.last[sv] - range.first[sv] + 1;
        CellSpan* const columns_of_row = spans(0, rows);
        CellSpan* const cells_of_row = spans(1, rows);
        CellSpan* const cells_of_column = spans(2, columns);
        touched_spans(t, u, v, c, range.first[su], rows, columns_of_row);
        touched_spans(t, u, w, c, range.first[su], rows, cells_of_row);
        touched_spans(t, v, w, c, range.first[sv], columns, cells_of_column);

        const bool flat = n[sw] == 0;  // no area: edges decide alone
        const std::array<int32_t, 3>& base = range.first;
        const int64_t sign = n[sw] < 0 ? -1 : 1;
        const int64_t nu = sign * n[su], nv = sign * n[sv], nw = flat ? 1 : sign * n[sw];
        const Int128 d = sign * plane_offset(t, n, base, c);
        const Int128 low = ((d - 1) >> c) - std::max<int64_t>(nu, 0) - std::max<int64_t>(nv, 0);
        const Int128 high = (d >> c) + std::max<int64_t>(-nu, 0) + std::max<int64_t>(-nv, 0);
        const bool narrow = fits(low, nu, nv, rows, columns) && fits(high, nu, nv, rows, columns);
        const Quotient step = nv > 0 ? Quotient{-1, nw - nv} : (-nv == nw ? Quotient{1, 0} : Quotient{0, -nv});  // |nv| <= nw
        for (int i = 0; i < rows; ++i) {
            if (columns_of_row[i].empty()) continue;
            const int j0 = std::max(columns_of_row[i].first - base[sv], 0), j1 = std::min(columns_of_row[i].last - base[sv], columns - 1);
            if (j0 > j1) continue;
            const int32_t row_first = std::max(cells_of_row[i].first, range.first[sw]),
                          row_last = std::min(cells_of_row[i].last, range.last[sw]);
            if (row_first > row_last) continue;
            if (flat) {
                for (int j = j0; j <= j1; ++j) {
                    const int32_t first = std::max(row_first, cells_of_column[j].first), last = std::min(row_last, cells_of_column[j].last);
                    if (first <= last) emit(w, base[su] + i, base[sv] + j, first, last);
                }
                continue;
            }
            SteppedQuotient lowest(start(low, nu, i, nv, j0, nw, narrow), step, nw),
                highest(start(high, nu, i, nv, j0, nw, narrow), step, nw);
            for (int j = j0; j <= j1; ++j, lowest.advance(), highest.advance()) {
                const int32_t first = int32_t(std::max<int64_t>(std::max(row_first, cells_of_column[j].first), base[sw] + lowest.whole()));
                const int32_t last = int32_t(std::min<int64_t>(std::min(row_last, cells_of_column[j].last), base[sw] + highest.whole()));
                if (first <= last) emit(w, base[su] + i, base[sv] + j, first, last);
            }
        }
    }

    /// Cells whose segment along w through the center, from face to face without the upper end, meets the triangle.
    /// emit(w, i, j, first, last)  as above
    template <class Emit>
    void scan_centers(const GridTriangle& t, int w, int c, const CellRange& clip, Emit&& emit) {
        const int u = next(w), v = next(u);
        const size_t su = size_t(u), sv = size_t(v), sw = size_t(w);
        const int32_t half = int32_t{1} << (c - 1);
        const CellRange range = touched_cells(t, c).clipped(clip);
        if (range.empty()) return;
        const std::array<int64_t, 3> n = normal_of(t);
        if (n[sw] == 0) {
            scan_edge_on(t, w, c, range, emit);
            return;
        }
        const int rows = range.last[su] - range.first[su] + 1, columns = range.last[sv] - range.first[sv] + 1;
        CellSpan* const columns_of_row = spans(0, rows);
        if (!center_spans<EdgeRule::closed>(t, u, v, c, half, range.first[su], rows, columns_of_row)) return;
        scan_plane(t, n, w, c, half, 0, range.first, rows, columns, columns_of_row, [&](int32_t i, int32_t j, int64_t cell) {
            if (cell >= range.first[sw] && cell <= range.last[sw]) emit(w, i, j, int32_t(cell), int32_t(cell));
        });
    }

    /// Where lines along w through points of a lattice, (i * 2^c + offset) along each axis, cross the triangle, each point counting as
    /// if it lay higher by (e^2, e^3, e) along x, y, z for a small e: then no line meets an edge and no point the triangle, and lines
    /// cross exactly one of two triangles that lie side by side.
    /// clip                       of its range along w nothing counts
    /// emit(i, j, first, sign)    the line at i along x (z if w is x or y) and j along y (x if w is y) crosses just below point `first`
    ///                            of its own; sign: of the normal along w
    template <class Emit>
    void scan_crossings(const GridTriangle& t, int w, int c, int32_t offset, const CellRange& clip, Emit&& emit) {
        const int u = w == 2 ? 0 : 2, v = w == 1 ? 0 : 1;
        const size_t su = size_t(u), sv = size_t(v), sw = size_t(w);
        CellRange range;
        for (const size_t a : {su, sv}) {
            const auto [low, high] = std::minmax({t.corners[0][a], t.corners[1][a], t.corners[2][a]});
            range.first[a] = std::max(((low - offset - 1) >> c) + 1, clip.first[a]);
            range.last[a] = std::min((high - offset) >> c, clip.last[a]);
            if (range.first[a] > range.last[a]) return;
        }
        const std::array<int64_t, 3> n = normal_of(t);
        if (n[sw] == 0) return;
        range.first[sw] = std::min({t.corners[0][sw], t.corners[1][sw], t.corners[2][sw]}) >> c;
        const int rows = range.last[su] - range.first[su] + 1, columns = range.last[sv] - range.first[sv] + 1;
        CellSpan* const columns_of_row = spans(0, rows);
        if (!center_spans<EdgeRule::moved>(t, u, v, c, offset, range.first[su], rows, columns_of_row)) return;
        // A point on the triangle lies beyond it where moving it does not move the crossing past it.
        const auto along = [&](size_t a) { return (n[a] > 0) == (n[sw] > 0); };
        const bool beyond = w == 2 || (n[2] != 0 ? along(2) : w == 0 || n[0] == 0 || along(0));
        const int sign = n[sw] < 0 ? -1 : 1;
        scan_plane(
            t, n, w, c, offset, beyond ? 1 : 0, range.first, rows, columns, columns_of_row,
            [&](int32_t i, int32_t j, int64_t cell) {
                emit(i, j, int32_t(std::clamp<int64_t>(cell + 1, std::numeric_limits<int32_t>::min(), std::numeric_limits<int32_t>::max())),
                     sign);
            },
            true);
    }

private:
    static int next(int axis) { return axis == 2 ? 0 : axis + 1; }
    static uint64_t magnitude(int64_t n) { return uint64_t(n < 0 ? -n : n); }

    CellSpan* spans(size_t table, int count) {
        if (tables_[table].size() < size_t(count)) tables_[table].resize(size_t(count));
        return tables_[table].data();
    }

    // scan_touched of a triangle whose box has no more than 4 cells an axis: all 4^2 cells of each projection at once, without a branch,
    // and then the plane for those cells that are left.
    template <class Emit>
    static void scan_few(const GridTriangle& t, const std::array<int64_t, 3>& n, int c, const CellRange& box, const CellRange& range,
                         Emit&& emit) {
        const std::array<int32_t, 3>& base = box.first;
        std::array<uint32_t, 3> from, count;
        for (size_t a = 0; a < 3; ++a) {
            from[a] = uint32_t(range.first[a] - base[a]);
            count[a] = uint32_t(range.last[a] - range.first[a] + 1);
        }
        // Cell (x, y, z) from `base` is bit 16 x + 4 y + z.
        uint64_t cells = (~uint64_t{0} >> (64 - 16 * count[0])) << 16 * from[0];
        cells &= ((uint64_t{0xffff} >> (16 - 4 * count[1])) << 4 * from[1]) * 0x0001000100010001;
        cells &= ((uint64_t{0xf} >> (4 - count[2])) << from[2]) * 0x1111111111111111;
        const auto emit_cells = [&](auto&& counts) {
            for (; cells != 0; cells &= cells - 1) {
                const int bit = std::countr_zero(cells);
                const int32_t x = bit >> 4, y = bit >> 2 & 3, z = bit & 3;
                if (counts(x, y, z)) emit(2, base[0] + x, base[1] + y, base[2] + z, base[2] + z);
            }
        };
        const auto all = [](int32_t, int32_t, int32_t) { return true; };
        // In one layer of cells the projection across it says all.
        if (box.first[0] == box.last[0]) {
            cells &= touched_squares(t, 1, 2, c, base, n[0]);
            return emit_cells(all);
        }
        const auto squares_of_xz = [&] {
            uint64_t xz = touched_squares(t, 0, 2, c, base, -n[1]);
            xz = (xz | xz << 24) & 0x000000ff000000ff;
            xz = (xz | xz << 12) & 0x000f000f000f000f;
            return xz * 0x1111;
        };
        if (box.first[1] == box.last[1]) {
            cells &= squares_of_xz();
            return emit_cells(all);
        }
        uint64_t xy = touched_squares(t, 0, 1, c, base, n[2]);
        xy = (xy | xy << 24) & 0x000000ff000000ff;
        xy = (xy | xy << 12) & 0x000f000f000f000f;
        xy = (xy | xy << 6) & 0x0303030303030303;
        xy = (xy | xy << 3) & 0x1111111111111111;
        cells &= xy * 0xf;
        if (box.first[2] == box.last[2]) return emit_cells(all);
        cells &= squares_of_xz() & touched_squares(t, 1, 2, c, base, n[0]) * 0x0001000100010001;
        const Int128 d = plane_offset(t, n, base, c);
        const int64_t most = int64_t(d >> c) - std::min<int64_t>(n[0], 0) - std::min<int64_t>(n[1], 0) - std::min<int64_t>(n[2], 0);
        const int64_t least =
            int64_t((d - 1) >> c) + 1 - std::max<int64_t>(n[0], 0) - std::max<int64_t>(n[1], 0) - std::max<int64_t>(n[2], 0);
        emit_cells([&](int32_t x, int32_t y, int32_t z) {
            const int64_t f = n[0] * x + n[1] * y + n[2] * z;
            return f >= least && f <= most;
        });
    }

    // Of 4 x 4 squares of cells of axes a and b, those that the projection touches: bit 4 i + j. Outside its box also others.
    // turns  the sign of its area as seen with a to the right and b up
    static uint64_t touched_squares(const GridTriangle& t, size_t a, size_t b, int c, const std::array<int32_t, 3>& base, int64_t turns) {
        using Pair __attribute__((vector_size(16))) = int64_t;
        using Bits __attribute__((vector_size(16))) = uint64_t;
        // Twice the area between an edge and the corner of each square that lies farthest to its left: negative, it is all to the right.
        // Of a triangle without area some edges go one way and some the other.
        const int64_t sign = turns < 0 ? -1 : 1;
        Pair left[3], left_far[3], step[3];  // i = 0, 1 and 2, 3
        for (size_t k = 0; k < 3; ++k) {
            const std::array<int32_t, 3>&p = t.corners[k], &q = t.corners[k == 2 ? 0 : k + 1];
            const int64_t da = sign * (p[b] - q[b]), db = sign * (q[a] - p[a]);
            const int64_t pa = p[a] - (int64_t{base[a]} << c), pb = p[b] - (int64_t{base[b]} << c);
            const int64_t first = ((std::max<int64_t>(da, 0) + std::max<int64_t>(db, 0)) << c) - da * pa - db * pb;
            const int64_t aside = da * (int64_t{1} << c), along = db * (int64_t{1} << c);
            left[k] = Pair{first, first + aside};
            left_far[k] = left[k] + Pair{2 * aside, 2 * aside};
            step[k] = Pair{along, along};
        }
        Bits right = {};
        for (int j = 0; j < 4; ++j) {
            right |= (Bits(left[0] | left[1] | left[2]) >> 63) << j | (Bits(left_far[0] | left_far[1] | left_far[2]) >> 63) << (8 + j);
            for (size_t k = 0; k < 3; ++k) {
                left[k] += step[k];
                left_far[k] += step[k];
            }
        }
        return ~(right[0] | right[1] << 4) & 0xffff;
    }

    // n . (corner - lower corner of cell `base`)
    static Int128 plane_offset(const GridTriangle& t, const std::array<int64_t, 3>& n, const std::array<int32_t, 3>& base, int c) {
        Int128 d = 0;
        for (size_t a = 0; a < 3; ++a) d += Int128(n[a]) * (t.corners[0][a] - (int64_t{base[a]} << c));
        return d;
    }
    static bool fits(Int128 h, int64_t nu, int64_t nv, int rows, int columns) {
        constexpr Int128 kMost = Int128(1) << 62;
        const Int128 reach = Int128(magnitude(nu)) * rows + Int128(magnitude(nv)) * columns;
        return h + reach < kMost && h - reach > -kMost;
    }
    static Quotient start(Int128 h, int64_t nu, int i, int64_t nv, int j, int64_t nw, bool narrow) {
        if (narrow) return divide_down(int64_t(h) - nu * i - nv * j, nw);
        return divide_down(h - Int128(nu) * i - Int128(nv) * j, nw);
    }

    // Cells of b that the projection to the axes a, b touches in each slab of cells of a.
    static void touched_spans(const GridTriangle& t, int a, int b, int c, int32_t first, int count, CellSpan* spans) {
        const size_t sa = size_t(a), sb = size_t(b);
        const int64_t mask = (int64_t{1} << c) - 1;
        const int32_t last = first + count - 1;
        std::fill(spans, spans + count, CellSpan());
        for (size_t k = 0; k < 3; ++k) {
            const auto *p = &t.corners[k], *q = &t.corners[k == 2 ? 0 : k + 1];
            const int32_t low = ((*p)[sb] - 1) >> c, high = (*p)[sb] >> c;
            const int32_t slab = (*p)[sa] >> c, slab_below = ((*p)[sa] - 1) >> c;  // another one where the corner is on the face between
            if (slab >= first && slab <= last) spans[slab - first].extend(low, high);
            if (slab_below != slab && slab_below >= first && slab_below <= last) spans[slab_below - first].extend(low, high);
            if ((*p)[sa] > (*q)[sa]) std::swap(p, q);
            const int32_t from = std::max(((*p)[sa] >> c) + 1, first), to = std::min(((*q)[sa] - 1) >> c, last + 1);
            if (from > to) continue;
            const int64_t da = (*q)[sa] - (*p)[sa], db = (*q)[sb] - (*p)[sb];
            const int64_t position = (*p)[sb] * da + ((int64_t{from} << c) - (*p)[sa]) * db;  // of the crossing along b, times da
            const bool on_units = (position & mask) == 0;
            SteppedQuotient cell(divide_down(position >> c, da), from < to ? divide_down(db, da) : Quotient{0, 0}, da);
            for (int32_t face = from; face <= to; ++face, cell.advance()) {
                const int32_t upper = int32_t(cell.whole()), lower = upper - (on_units && cell.exact());
                if (face > first) spans[face - 1 - first].extend(lower, upper);
                if (face <= last) spans[face - first].extend(lower, upper);
            }
        }
    }

    // Lattice points along b inside the projection to the axes a, b, on each line at a lattice point of a. False: there are none.
    template <EdgeRule rule>
    static bool center_spans(const GridTriangle& t, int a, int b, int c, int32_t offset, int32_t first, int count, CellSpan* spans) {
        const size_t sa = size_t(a), sb = size_t(b);
        const int64_t mask = (int64_t{1} << c) - 1;
        const int32_t last = first + count - 1;
        std::fill(spans, spans + count, CellSpan());
        bool any = false;
        for (size_t k = 0; k < 3; ++k) {
            const auto *p = &t.corners[k], *q = &t.corners[k == 2 ? 0 : k + 1];
            if ((*p)[sa] == (*q)[sa]) continue;
            if ((*p)[sa] > (*q)[sa]) std::swap(p, q);
            const int32_t end = (*q)[sa] - offset - (rule == EdgeRule::moved);
            const int32_t from = std::max((((*p)[sa] - offset - 1) >> c) + 1, first), to = std::min(end >> c, last);
            if (from > to) continue;
            any = true;
            const int64_t da = (*q)[sa] - (*p)[sa], db = (*q)[sb] - (*p)[sb];
            const int64_t position = ((*p)[sb] - int64_t{offset}) * da + ((int64_t{from} << c) + offset - (*p)[sa]) * db;
            const bool on_units = (position & mask) == 0;
            SteppedQuotient cell(divide_down(position >> c, da), from < to ? divide_down(db, da) : Quotient{0, 0}, da);
            for (int32_t line = from; line <= to; ++line, cell.advance()) {
                const int32_t point = int32_t(cell.whole());
                const bool exact = on_units && cell.exact();
                if (rule == EdgeRule::closed) {
                    spans[line - first].extend(exact ? point : point + 1, point);
                } else {
                    const int32_t beyond = exact && db <= 0 ? point : point + 1;  // the first point past the edge
                    spans[line - first].extend(beyond, beyond - 1);
                }
            }
        }
        return any;
    }

    // Calls visit(i, j, floor((w - offset - tie) / 2^c)) for the plane's w at the lattice points of the spans, where tie is 0 or less
    // than a unit.
    template <class Visit>
    static void scan_plane(const GridTriangle& t, const std::array<int64_t, 3>& n, int w, int c, int32_t offset, int tie,
                           const std::array<int32_t, 3>& base, int rows, int columns, const CellSpan* columns_of_row, Visit&& visit,
                           bool lattice_of_w = false) {
        const int u = lattice_of_w ? (w == 2 ? 0 : 2) : next(w), v = lattice_of_w ? (w == 1 ? 0 : 1) : next(next(w));
        const size_t su = size_t(u), sv = size_t(v), sw = size_t(w);
        const int64_t sign = n[sw] < 0 ? -1 : 1;
        const int64_t nu = sign * n[su], nv = sign * n[sv], nw = sign * n[sw];
        const Int128 d = sign * plane_offset(t, n, base, c) - Int128(nu + nv) * offset - (lattice_of_w ? Int128(nw) * offset : 0) - tie;
        const Int128 h = d >> c;
        const bool narrow = fits(h, nu, nv, rows, columns);
        const Quotient step = columns > 1 ? divide_down(-nv, nw) : Quotient{0, 0};
        for (int i = 0; i < rows; ++i) {
            if (columns_of_row[i].empty()) continue;
            const int j0 = std::max(columns_of_row[i].first - base[sv], 0), j1 = std::min(columns_of_row[i].last - base[sv], columns - 1);
            if (j0 > j1) continue;
            SteppedQuotient cell(start(h, nu, i, nv, j0, nw, narrow), step, nw);
            for (int j = j0; j <= j1; ++j, cell.advance()) visit(base[su] + i, base[sv] + j, base[sw] + cell.whole());
        }
    }

    // scan_centers of a triangle whose projection along w is a segment or a point: lines meet it only where they meet that exactly.
    template <class Emit>
    static void scan_edge_on(const GridTriangle& t, int w, int c, const CellRange& range, Emit&& emit) {
        int u = next(w), v = next(u);
        const int64_t half = int64_t{1} << (c - 1), mask = (int64_t{1} << c) - 1;
        const auto lowest = [&](int axis) {
            return std::min({t.corners[0][size_t(axis)], t.corners[1][size_t(axis)], t.corners[2][size_t(axis)]});
        };
        const auto highest = [&](int axis) {
            return std::max({t.corners[0][size_t(axis)], t.corners[1][size_t(axis)], t.corners[2][size_t(axis)]});
        };
        const bool swapped = lowest(u) == highest(u);
        if (swapped) std::swap(u, v);
        const size_t su = size_t(u), sv = size_t(v), sw = size_t(w);
        const auto hand_out = [&](int32_t i, int32_t j, int64_t low, int64_t high) {
            if (j < range.first[sv] || j > range.last[sv]) return;
            const int32_t first = int32_t(std::max<int64_t>(low, range.first[sw])), last = int32_t(std::min<int64_t>(high, range.last[sw]));
            if (first > last) return;
            if (swapped) emit(w, j, i, first, last);
            else emit(w, i, j, first, last);
        };
        if (lowest(u) == highest(u)) {  // a point
            if (((lowest(u) - half) & mask) == 0 && ((lowest(v) - half) & mask) == 0 && lowest(u) >> c >= range.first[su] &&
                lowest(u) >> c <= range.last[su])
                hand_out(lowest(u) >> c, lowest(v) >> c, lowest(w) >> c, highest(w) >> c);
            return;
        }
        const auto &p = *std::min_element(t.corners.begin(), t.corners.end(), [&](const auto&l, const auto&r) { return l[su] < r[su]; }),
                   &q = *std::max_element(t.corners.begin(), t.corners.end(), [&](const auto&l, const auto&r) { return l[su] < r[su]; });
        const int64_t da = q[su] - p[su], db = q[sv] - p[sv];
        if (db == 0 && ((p[sv] - half) & mask) != 0) return;
        const int32_t from = std::max(int32_t((p[su] - half - 1) >> c) + 1, range.first[su]),
                      to = std::min(int32_t((q[su] - half) >> c), range.last[su]);
        for (int32_t i = from; i <= to; ++i) {
            const int64_t line = (int64_t{i} << c) + half;
            const int64_t position = (p[sv] - half) * da + (line - p[su]) * db;
            if ((position & mask) != 0 || (position >> c) % da != 0) continue;
            int64_t low = std::numeric_limits<int64_t>::max(), high = std::numeric_limits<int64_t>::min();
            for (size_t k = 0; k < 3; ++k) {
                const auto *e = &t.corners[k], *f = &t.corners[k == 2 ? 0 : k + 1];
                if ((*e)[su] > (*f)[su]) std::swap(e, f);
                if ((*e)[su] == (*f)[su] || (*e)[su] > line || (*f)[su] < line) continue;
                const int64_t run = (*f)[su] - (*e)[su];
                const int64_t cell = divide_down(((*e)[sw] * run + (line - (*e)[su]) * ((*f)[sw] - (*e)[sw])) >> c, run).whole;
                low = std::min(low, cell);
                high = std::max(high, cell);
            }
            hand_out(i, int32_t((position >> c) / da), low, high);
        }
    }

    std::array<std::vector<CellSpan>, 3> tables_;
};

}  // namespace strata
