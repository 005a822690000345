#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/simd_target.h"
#include "core/surface/cell_cases.h"
#include "core/surface/edge_cut.h"
#include "core/surface/field_slope.h"
#include "core/surface/inner_vertex.h"
#include "core/surface/slab_contour.h"

namespace strata {

struct SlabContour::Findings {
    SampleStatistics samples;
    CutStatistics cuts;
    uint64_t ambiguous = 0, tunnels = 0;
    bool meets_boundary = false;
};

namespace slab {

using U32x8 = uint32_t __attribute__((vector_size(32)));
#if !defined(__clang__)
using U32x16 = uint32_t __attribute__((vector_size(64)));
using U8x16 = uint8_t __attribute__((vector_size(16)));
#endif

inline constexpr double kOutside = -std::numeric_limits<double>::infinity();  // the value of samples beyond a closed grid

// Which of the edges 0 to 7 of a case are crossed: by so much the numbers of the next vertices on those eight rows of edges grow.
constexpr std::array<std::array<uint32_t, 8>, 256> make_steps() {
    std::array<std::array<uint32_t, 8>, 256> steps{};
    for (unsigned c = 0; c < 256; ++c)
        for (size_t e = 0; e < 8; ++e) steps[c][e] = ((c >> kCellEdge[e].lower) ^ (c >> kCellEdge[e].upper)) & 1;
    return steps;
}
alignas(64) inline constexpr std::array<std::array<uint32_t, 8>, 256> kSteps = make_steps();

// Bits i and i + 1 of a row.
inline unsigned two_bits(const uint64_t* row, size_t i) {
    if constexpr (std::endian::native == std::endian::little) {
        uint16_t bytes;
        std::memcpy(&bytes, reinterpret_cast<const char*>(row) + i / 8, sizeof bytes);
        return unsigned(bytes >> (i & 7)) & 3;
    } else {
        const size_t w = i / 64, bit = i % 64;
        return unsigned(row[w] >> bit | row[w + 1] << 1 << (63 - bit)) & 3;
    }
}

// All 16 of the ids in the places of vertices: one instruction of AVX-512, for which Clang has no word.
inline void put_permuted(const std::array<uint32_t, 16>& ids, const std::array<uint8_t, 16>& vertices, uint32_t* out) {
#if defined(__clang__)
    for (size_t v = 0; v < 16; ++v) out[v] = ids[vertices[v]];
#else
    U8x16 places;
    U32x16 all;
    std::memcpy(&places, vertices.data(), sizeof places);
    std::memcpy(&all, ids.data(), sizeof all);
    all = __builtin_shuffle(all, __builtin_convertvector(places, U32x16));
    std::memcpy(out, &all, sizeof all);
#endif
}

inline uint64_t next_bits(const uint64_t* row, size_t w) { return row[w] >> 1 | row[w + 1] << 63; }

template <typename Kernel>
Kernel* kernel_for(SimdLevel level, Kernel* baseline, Kernel* avx2, Kernel* avx512) {
    return level == SimdLevel::avx512 ? avx512 : level == SimdLevel::avx2 ? avx2 : baseline;
}

}  // namespace slab

/// The loops over rows, compiled for each instruction set.
struct SlabKernel {
    using Rows = std::array<const uint64_t*, 4>;  // of bits, at (j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)

    static Rows rows_of(SlabContour& slab, int64_t layer, size_t isovalue, int64_t j) {
        return {slab.mask(layer, isovalue, j), slab.mask(layer, isovalue, j + 1), slab.mask(layer + 1, isovalue, j),
                slab.mask(layer + 1, isovalue, j + 1)};
    }
    static unsigned case_of(const Rows& rows, size_t i) {
        return slab::two_bits(rows[0], i) | slab::two_bits(rows[1], i) << 2 | slab::two_bits(rows[2], i) << 4 | slab::two_bits(rows[3], i) << 6;
    }

    // Bits of a row's last word of cells.
    static uint64_t last_cells(const SlabContour& slab) {
        const auto rest = unsigned((slab.columns_ - 1) % 64);
        return rest == 0 ? ~uint64_t{0} : (uint64_t{1} << rest) - 1;
    }
    static size_t cell_words(const SlabContour& slab) { return size_t(slab.columns_ - 1 + 63) / 64; }

    static void find_active(const SlabContour& slab, const Rows& rows, uint64_t* active) {
        const size_t words = cell_words(slab);
        const uint64_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3];
        for (size_t w = 0; w < words; ++w) {
            const uint64_t any = a[w] | b[w] | c[w] | d[w], all = a[w] & b[w] & c[w] & d[w];
            const uint64_t next_any = a[w + 1] | b[w + 1] | c[w + 1] | d[w + 1], next_all = a[w + 1] & b[w + 1] & c[w + 1] & d[w + 1];
            active[w] = (any | any >> 1 | next_any << 63) & ~(all & (all >> 1 | next_all << 63));
        }
        active[words - 1] &= last_cells(slab);
    }

    static uint64_t undecided(const Rows& rows, size_t w) {
        std::array<uint64_t, 8> corners;
        for (size_t r = 0; r < 4; ++r) {
            corners[2 * r] = rows[r][w];
            corners[2 * r + 1] = slab::next_bits(rows[r], w);
        }
        return undecided_cells(corners);
    }

    // The sample of a row of the padded grid; nullptr: it is outside.
    static const float* samples_of(const SlabContour& slab, const SlabSamples& samples, int64_t j, int64_t k) {
        const int64_t row = j - slab.pad_, slice = k - slab.pad_;
        if (row < 0 || row >= slab.samples_[1] || slice < 0 || slice >= slab.samples_[2]) return nullptr;
        return samples.values + ((slice - samples.first_slice) * slab.samples_[1] + row) * slab.samples_[0];
    }

    static CellValues values_of(const SlabContour& slab, const SlabSamples& samples, double isovalue, int64_t i, int64_t j, int64_t k) {
        CellValues values;
        for (int64_t c = 0; c < 8; ++c) {
            const float* const row = samples_of(slab, samples, j + (c >> 1 & 1), k + (c >> 2));
            const int64_t column = i + (c & 1) - slab.pad_;
            const bool outside = row == nullptr || column < 0 || column >= slab.samples_[0];
            values[size_t(c)] = outside ? slab::kOutside : slab.below_ ? isovalue - double(row[column]) : double(row[column]) - isovalue;
        }
        return values;
    }

    static void count_slice(SlabContour& slab, int64_t slice, SlabContour::Findings& findings) {
        const int64_t k = slab.slab_first_ + slice;
        const size_t words = slab.stride_ - 1, cells = cell_words(slab);
        const auto last_column = size_t(slab.columns_ - 1);
        const bool slice_at_boundary = k == slab.pad_ || k == slab.slices_ - 1 - slab.pad_;
        for (size_t s = 0; s < slab.isovalues_.size(); ++s) {
            SlabContour::Unit& total = slab.slice_units_[slab.unit(slice, s)];
            total = {};
            for (int64_t j = 0; j < slab.rows_; ++j) {
                const uint64_t* const row = slab.mask(slice, s, j);
                const uint64_t* const next = slab.mask(slice, s, j + 1 < slab.rows_ ? j + 1 : j);
                unsigned x = 0, y = 0;
                for (size_t w = 0; w < cells; ++w) {
                    const uint64_t crossed = (row[w] ^ slab::next_bits(row, w)) & (w + 1 == cells ? last_cells(slab) : ~uint64_t{0});
                    x += unsigned(std::popcount(crossed));
                }
                for (size_t w = 0; w < words; ++w) y += unsigned(std::popcount(row[w] ^ next[w]));
                slab.slice_rows_[slab.unit(slice, s) * size_t(slab.rows_) + size_t(j)] = {x, y};
                total.vertices += x + y;

                const bool row_at_boundary = j == slab.pad_ || j == slab.rows_ - 1 - slab.pad_;
                if (slab.pad_ == 1) {  // closed there wherever a sample is inside
                    uint64_t any = 0;
                    if (slice_at_boundary || row_at_boundary)
                        for (size_t w = 0; w < words; ++w) any |= row[w];
                    any |= (row[0] >> 1 | row[(last_column - 1) / 64] >> (last_column - 1) % 64) & 1;
                    findings.meets_boundary |= any != 0;
                } else {
                    const uint64_t ends = (row[0] ^ next[0]) | (row[last_column / 64] ^ next[last_column / 64]) >> last_column % 64;
                    findings.meets_boundary |= (slice_at_boundary && x + y > 0) || (row_at_boundary && x > 0) || (ends & 1) != 0;
                }
            }
        }
    }

    static void count_layer(SlabContour& slab, const SlabSamples& samples, int64_t layer, SlabContour::Findings& findings) {
        const CellCases& cases = CellCases::get();
        const size_t words = slab.stride_ - 1, cells = cell_words(slab);
        const auto last_column = size_t(slab.columns_ - 1);
        const auto rows_per_unit = size_t(slab.rows_);
        std::vector<uint64_t> active(cells);
        for (size_t s = 0; s < slab.isovalues_.size(); ++s) {
            SlabContour::Unit& total = slab.layer_units_[slab.unit(layer, s)];
            total = {};
            SlabContour::LayerRow* const out = slab.layer_rows_.data() + slab.unit(layer, s) * rows_per_unit;
            for (int64_t j = 0; j < slab.rows_; ++j) {
                const uint64_t *low = slab.mask(layer, s, j), *high = slab.mask(layer + 1, s, j);
                unsigned z = 0;
                for (size_t w = 0; w < words; ++w) z += unsigned(std::popcount(low[w] ^ high[w]));
                out[j] = {z, 0, 0};
                total.vertices += z;
                const uint64_t ends = (low[0] ^ high[0]) | (low[last_column / 64] ^ high[last_column / 64]) >> last_column % 64;
                if (slab.pad_ == 0) findings.meets_boundary |= ((j == 0 || j == slab.rows_ - 1) && z > 0) || (ends & 1) != 0;
            }
            const SlabContour::SliceRow* const below = slab.slice_rows_.data() + slab.unit(layer, s) * rows_per_unit;
            const SlabContour::SliceRow* const above = slab.slice_rows_.data() + slab.unit(layer + 1, s) * rows_per_unit;
            // How often a row's crossings of edges along j or k are met by the cells at both sides: twice, but for those at its ends.
            const auto met = [&](uint32_t count, const uint64_t* row, const uint64_t* next) {
                const uint64_t first = row[0] ^ next[0], last = (row[last_column / 64] ^ next[last_column / 64]) >> last_column % 64;
                return 2 * int64_t{count} - int64_t(first & 1) - int64_t(last & 1);
            };
            for (int64_t j = 0; j + 1 < slab.rows_; ++j) {
                const Rows rows = rows_of(slab, layer, s, j);
                // A loop of n crossings bounds n - 2 triangles, and a plain cell that the surface crosses has one loop: their number is
                // that of the cells' crossings less twice the cells.
                int64_t triangles = int64_t{below[j].x} + below[j + 1].x + above[j].x + above[j + 1].x;
                triangles += met(below[j].y, rows[0], rows[1]) + met(above[j].y, rows[2], rows[3]);
                triangles += met(out[j].z, rows[0], rows[2]) + met(out[j + 1].z, rows[1], rows[3]);
                if (triangles == 0) continue;
                find_active(slab, rows, active.data());
                unsigned inner = 0;
                for (size_t w = 0; w < cells; ++w) {
                    if (active[w] == 0) continue;
                    triangles -= 2 * std::popcount(active[w]);
                    for (uint64_t left = active[w] & undecided(rows, w); left != 0; left &= left - 1) {
                        const size_t i = 64 * w + size_t(std::countr_zero(left));
                        const unsigned cell_case = case_of(rows, i);
                        const CellDecision decision =
                            cases.decide(cell_case, values_of(slab, samples, slab.isovalues_[s], int64_t(i), j, slab.slab_first_ + layer));
                        triangles += decision.patch->triangles + 2 - std::popcount(kCrossedEdges[cell_case]);
                        inner += decision.patch->inner;
                        ++findings.ambiguous;
                        findings.tunnels += decision.tunnel;
                    }
                }
                out[j].triangles = uint32_t(triangles);
                out[j].inner = inner;
                total.triangles += uint64_t(triangles);
                total.vertices += inner;
            }
        }
    }

    // The row's start in the world, less the placement's origin.
    static Vec3d start_of(const SlabContour& slab, int64_t j, int64_t k) {
        return double(j - slab.pad_) * slab.axes_[1] + double(k - slab.pad_) * slab.axes_[2] - double(slab.pad_) * slab.axes_[0];
    }

    // The field's slope at a sample, in index space; zero along axes where it has no finite neighbor.
    static Vec3d slope_at(const SlabContour& slab, const SlabSamples& samples, const std::array<int64_t, 3>& at) {
        const auto value = [&](const std::array<int64_t, 3>& p) {
            return samples.values[((p[2] - samples.first_slice) * slab.samples_[1] + p[1]) * slab.samples_[0] + p[0]];
        };
        const double here = value(at);
        Vec3d slope = Vec3d::Zero();
        for (int axis = 0; axis < 3; ++axis) {
            std::array<int64_t, 3> before = at, after = at;
            --before[size_t(axis)];
            ++after[size_t(axis)];
            const double low = at[size_t(axis)] > 0 ? double(value(before)) : slab::kOutside;
            const double high = at[size_t(axis)] + 1 < slab.samples_[size_t(axis)] ? double(value(after)) : slab::kOutside;
            slope[axis] = slope_between(low, here, high);
        }
        return slope.allFinite() ? slope : Vec3d::Zero();
    }

    static Vec3f normal_of(const SlabContour& slab, const Vec3d& outward) { return unit_normal(slab.normal_from_gradient_ * outward); }

    // The normal at t between two samples of the padded grid.
    static Vec3f edge_normal(const SlabContour& slab, const SlabSamples& samples, std::array<int64_t, 3> at, int axis, double t) {
        for (int64_t& a : at) a -= slab.pad_;
        std::array<int64_t, 3> upper = at;
        ++upper[size_t(axis)];
        Vec3d outward = Vec3d::Zero();
        const auto is_outside = [&](const std::array<int64_t, 3>& p) {
            return p[size_t(axis)] < 0 || p[size_t(axis)] >= slab.samples_[size_t(axis)];
        };
        if (is_outside(at) || is_outside(upper)) {  // a cap
            outward[axis] = is_outside(at) ? -1.0 : 1.0;
        } else {
            outward = (1.0 - t) * slope_at(slab, samples, at) + t * slope_at(slab, samples, upper);
            if (!slab.below_) outward = -outward;
        }
        return normal_of(slab, outward);
    }

    using RowRange = std::array<int64_t, 2>;  // from the first to before the end

    template <bool kNormals>
    static void emit_slice(SlabContour& slab, const SlabSamples& samples, int64_t slice, size_t s, const RowRange& rows,
                           const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        const int64_t k = slab.slab_first_ + slice;
        const size_t cells = cell_words(slab);
        const int64_t pad = slab.pad_;
        const double isovalue = slab.isovalues_[s];
        for (int64_t j = rows[0]; j < rows[1]; ++j) {
            const uint64_t* const row = slab.mask(slice, s, j);
            const uint64_t* const next = slab.mask(slice, s, j + 1 < slab.rows_ ? j + 1 : j);
            const float* const here = samples_of(slab, samples, j, k);
            const float* const there = samples_of(slab, samples, j + 1, k);
            const Vec3d start = start_of(slab, j, k);
            const SlabContour::SliceRow& numbers = slab.slice_rows_[slab.unit(slice, s) * size_t(slab.rows_) + size_t(j)];
            uint64_t at = numbers.x - first_vertex;
            for (size_t w = 0; w < cells; ++w) {
                uint64_t left = (row[w] ^ slab::next_bits(row, w)) & (w + 1 == cells ? last_cells(slab) : ~uint64_t{0});
                for (; left != 0; left &= left - 1) {
                    const int64_t i = int64_t(64 * w) + std::countr_zero(left);
                    double t;
                    if (pad == 1 && (i == 0 || i == slab.columns_ - 2)) t = i == 0 ? 1.0 - kLeastCut : kLeastCut;
                    else t = cut_edge(here[i - pad], here[i + 1 - pad], isovalue, cuts);
                    put(out.positions[at], start + (double(i) + t) * slab.axes_[0]);
                    if constexpr (kNormals) out.normals[at] = edge_normal(slab, samples, {i, j, k}, 0, t);
                    ++at;
                }
            }
            emit_across<kNormals>(slab, samples, {j, k}, 1, {row, next}, {here, there}, isovalue, start, out, numbers.y - first_vertex, cuts);
        }
    }

    // Those on edges along j or k, from a row to another one.
    template <bool kNormals>
    static void emit_across(SlabContour& slab, const SlabSamples& samples, const std::array<int64_t, 2>& place, int axis, const std::array<const uint64_t*, 2>& masks,
                            const std::array<const float*, 2>& values, double isovalue, const Vec3d& start, const ContourTarget& out, uint64_t at, CutStatistics& cuts) {
        const size_t words = slab.stride_ - 1;
        const int64_t pad = slab.pad_;
        const auto [low, high] = masks;
        const auto [here, there] = values;
        for (size_t w = 0; w < words; ++w)
            for (uint64_t left = low[w] ^ high[w]; left != 0; left &= left - 1) {
                const int64_t i = int64_t(64 * w) + std::countr_zero(left);
                const double t = here == nullptr    ? 1.0 - kLeastCut
                                 : there == nullptr ? kLeastCut
                                                    : cut_edge(here[i - pad], there[i - pad], isovalue, cuts);
                put(out.positions[at], start + double(i) * slab.axes_[0] + t * slab.axes_[axis]);
                if constexpr (kNormals) out.normals[at] = edge_normal(slab, samples, {i, place[0], place[1]}, axis, t);
                ++at;
            }
    }

    static void put(Vec3f& out, const Vec3d& position) { out = {float(position.x()), float(position.y()), float(position.z())}; }

    // Those along k.
    template <bool kNormals>
    static void emit_between(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s, const RowRange& rows,
                             const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        const int64_t k = slab.slab_first_ + layer;
        const double isovalue = slab.isovalues_[s];
        const SlabContour::LayerRow* const numbers = slab.layer_rows_.data() + slab.unit(layer, s) * size_t(slab.rows_);
        for (int64_t j = rows[0]; j < rows[1]; ++j) {
            const uint64_t *low = slab.mask(layer, s, j), *high = slab.mask(layer + 1, s, j);
            const float* const here = samples_of(slab, samples, j, k);
            const float* const there = samples_of(slab, samples, j, k + 1);
            emit_across<kNormals>(slab, samples, {j, k}, 2, {low, high}, {here, there}, isovalue, start_of(slab, j, k), out, numbers[j].z - first_vertex, cuts);
        }
    }

    template <bool kNormals>
    static void put_inner(SlabContour& slab, const CellValues& values, const CellPatch& patch, const std::array<int64_t, 3>& cell,
                          const ContourTarget& out, uint64_t at) {
        for (size_t n = 0; n < patch.inner; ++n, ++at) {
            const Vec3d p_cell = place_inner_vertex(values, patch.inner_edges[n]);
            put(out.positions[at], start_of(slab, cell[1], cell[2]) + (double(cell[0]) + p_cell.x()) * slab.axes_[0] +
                                       p_cell.y() * slab.axes_[1] + p_cell.z() * slab.axes_[2]);
            if constexpr (kNormals) out.normals[at] = normal_of(slab, -inside_slope(values, p_cell));
        }
    }

    // Vertices within cells, where triangles are not wanted.
    template <bool kNormals>
    static void emit_inner(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s, const RowRange& rows,
                           const ContourTarget& out, uint64_t first_vertex) {
        const int64_t k = slab.slab_first_ + layer;
        const size_t cells = cell_words(slab);
        const SlabContour::LayerRow* const numbers = slab.layer_rows_.data() + slab.unit(layer, s) * size_t(slab.rows_);
        for (int64_t j = rows[0]; j < std::min(rows[1], slab.rows_ - 1); ++j) {
            const Rows bits = rows_of(slab, layer, s, j);
            uint64_t at = numbers[j].inner - first_vertex;
            if (at + first_vertex == numbers[j + 1].z) continue;
            for (size_t w = 0; w < cells; ++w)
                for (uint64_t left = undecided(bits, w) & (w + 1 == cells ? last_cells(slab) : ~uint64_t{0}); left != 0; left &= left - 1) {
                    const std::array<int64_t, 3> cell = {int64_t(64 * w) + std::countr_zero(left), j, k};
                    const CellValues values = values_of(slab, samples, slab.isovalues_[s], cell[0], j, k);
                    const CellPatch& patch = *CellCases::get().decide(case_of(bits, size_t(cell[0])), values).patch;
                    put_inner<kNormals>(slab, values, patch, cell, out, at);
                    at += patch.inner;
                }
        }
    }

    template <bool kPermute, bool kNormals>
    static void emit_triangles(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s, const RowRange& rows,
                               const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle) {
        const CellCases& cases = CellCases::get();
        const CellCases::Plain& plain = cases.plain(slab.mirrored_);
        const int64_t k = slab.slab_first_ + layer;
        const size_t cells = cell_words(slab);
        const auto rows_per_unit = size_t(slab.rows_);
        std::vector<uint64_t> active(cells);
        const double isovalue = slab.isovalues_[s];
        const SlabContour::Unit& unit = slab.layer_units_[slab.unit(layer, s)];
        const SlabContour::LayerRow* const numbers = slab.layer_rows_.data() + slab.unit(layer, s) * rows_per_unit;
        const SlabContour::SliceRow* const below = slab.slice_rows_.data() + slab.unit(layer, s) * rows_per_unit;
        const SlabContour::SliceRow* const above = slab.slice_rows_.data() + slab.unit(layer + 1, s) * rows_per_unit;
        // Triangles of the unit from its first on, of which those before the rows are not there.
        const auto place_of = [&](int64_t j) {
            const uint64_t before = j + 1 < slab.rows_ ? numbers[j].triangles : unit.triangles;
            return out.triangles[unit.first_triangle + before - first_triangle].data();
        };
        const int64_t end_row = std::min(rows[1], slab.rows_ - 1);
        uint32_t* const end = place_of(end_row);
        alignas(64) std::array<uint32_t, CellPatch::kPlaces> ids = {};
        for (int64_t j = rows[0]; j < end_row; ++j) {
            const Rows bits = rows_of(slab, layer, s, j);
            uint32_t* triangle = place_of(j);
            if (triangle == place_of(j + 1)) continue;
            find_active(slab, bits, active.data());
            uint32_t inner = numbers[j].inner;
            slab::U32x8 next = {below[j].x, below[j + 1].x, above[j].x,   above[j + 1].x,
                          below[j].y, above[j].y,     numbers[j].z, numbers[j + 1].z};
            for (size_t w = 0; w < cells; ++w)
                for (uint64_t left = active[w]; left != 0; left &= left - 1) {
                    const size_t i = 64 * w + size_t(std::countr_zero(left));
                    const unsigned cell_case = case_of(bits, i);
                    slab::U32x8 step;
                    std::memcpy(&step, slab::kSteps[cell_case].data(), sizeof step);
                    std::memcpy(ids.data(), &next, sizeof next);
                    next += step;
                    std::memcpy(ids.data() + 8, &next, sizeof next);
                    const unsigned count = plain.triangles[cell_case];
                    if (count != CellCases::kUndecided) {
                        const std::array<uint8_t, 16>& vertices = plain.vertices[cell_case];
                        if (end - triangle >= 16) {
                            if constexpr (kPermute) {
                                slab::put_permuted(ids, vertices, triangle);
                            } else {
                                for (size_t v = 0; v < 6; ++v) triangle[v] = ids[vertices[v]];
                                if (count > 2)
                                    for (size_t v = 6; v < 15; ++v) triangle[v] = ids[vertices[v]];
                            }
                        } else {
                            for (size_t v = 0; v < 3 * size_t(count); ++v) triangle[v] = ids[vertices[v]];
                        }
                        triangle += 3 * count;
                        continue;
                    }
                    const CellValues values = values_of(slab, samples, isovalue, int64_t(i), j, k);
                    const CellPatch& patch = *cases.decide(cell_case, values).patch;
                    if (out.positions != nullptr)
                        put_inner<kNormals>(slab, values, patch, {int64_t(i), j, k}, out, inner - first_vertex);
                    for (size_t n = 0; n < patch.inner; ++n) ids[CellPatch::place_of_inner(n)] = inner++;
                    for (size_t t = 0; t < patch.triangles; ++t, triangle += 3)
                        for (size_t v = 0; v < 3; ++v) triangle[v] = ids[patch.vertices[3 * t + (slab.mirrored_ ? 2 - v : v)]];
                }
        }
    }

    template <bool kPermute, bool kNormals>
    static void emit_layer(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s, const RowRange& rows,
                           const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle, CutStatistics& cuts) {
        if (out.positions != nullptr) emit_between<kNormals>(slab, samples, layer, s, rows, out, first_vertex, cuts);
        if (out.triangles != nullptr)
            emit_triangles<kPermute, kNormals>(slab, samples, layer, s, rows, out, first_vertex, first_triangle);
        else emit_inner<kNormals>(slab, samples, layer, s, rows, out, first_vertex);
    }

    // Normals are not worth a kernel of their own for each instruction set.
    static void emit_slice_plainly(SlabContour& slab, const SlabSamples& samples, int64_t slice, size_t s, const RowRange& rows,
                                   const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        emit_slice<true>(slab, samples, slice, s, rows, out, first_vertex, cuts);
    }
    static void emit_layer_plainly(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s, const RowRange& rows,
                                   const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle, CutStatistics& cuts) {
        emit_layer<false, true>(slab, samples, layer, s, rows, out, first_vertex, first_triangle, cuts);
    }

    STRATA_KERNEL_BASELINE static void count_slice_baseline(SlabContour& slab, int64_t slice, SlabContour::Findings& findings) {
        count_slice(slab, slice, findings);
    }
    STRATA_KERNEL_AVX2 static void count_slice_avx2(SlabContour& slab, int64_t slice, SlabContour::Findings& findings) {
        count_slice(slab, slice, findings);
    }
    STRATA_KERNEL_AVX512 static void count_slice_avx512(SlabContour& slab, int64_t slice, SlabContour::Findings& findings) {
        count_slice(slab, slice, findings);
    }
    STRATA_KERNEL_BASELINE static void count_layer_baseline(SlabContour& slab, const SlabSamples& samples, int64_t layer,
                                                            SlabContour::Findings& findings) {
        count_layer(slab, samples, layer, findings);
    }
    STRATA_KERNEL_AVX2 static void count_layer_avx2(SlabContour& slab, const SlabSamples& samples, int64_t layer,
                                                    SlabContour::Findings& findings) {
        count_layer(slab, samples, layer, findings);
    }
    STRATA_KERNEL_AVX512 static void count_layer_avx512(SlabContour& slab, const SlabSamples& samples, int64_t layer,
                                                        SlabContour::Findings& findings) {
        count_layer(slab, samples, layer, findings);
    }
    STRATA_KERNEL_BASELINE static void emit_slice_baseline(SlabContour& slab, const SlabSamples& samples, int64_t slice, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        emit_slice<false>(slab, samples, slice, s, rows, out, first_vertex, cuts);
    }
    STRATA_KERNEL_AVX2 static void emit_slice_avx2(SlabContour& slab, const SlabSamples& samples, int64_t slice, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        emit_slice<false>(slab, samples, slice, s, rows, out, first_vertex, cuts);
    }
    STRATA_KERNEL_AVX512 static void emit_slice_avx512(SlabContour& slab, const SlabSamples& samples, int64_t slice, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, CutStatistics& cuts) {
        emit_slice<false>(slab, samples, slice, s, rows, out, first_vertex, cuts);
    }
    STRATA_KERNEL_BASELINE static void emit_layer_baseline(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle, CutStatistics& cuts) {
        emit_layer<false, false>(slab, samples, layer, s, rows, out, first_vertex, first_triangle, cuts);
    }
    STRATA_KERNEL_AVX2 static void emit_layer_avx2(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle, CutStatistics& cuts) {
        emit_layer<false, false>(slab, samples, layer, s, rows, out, first_vertex, first_triangle, cuts);
    }
    STRATA_KERNEL_AVX512 static void emit_layer_avx512(SlabContour& slab, const SlabSamples& samples, int64_t layer, size_t s,
        const RowRange& rows, const ContourTarget& out, uint64_t first_vertex, uint64_t first_triangle, CutStatistics& cuts) {
        emit_layer<true, false>(slab, samples, layer, s, rows, out, first_vertex, first_triangle, cuts);
    }

    // Those that suit, normals or not.
    static auto slice_emitter(const SlabContour& slab) {
        return slab.normals_ ? emit_slice_plainly : slab::kernel_for(slab.level_, emit_slice_baseline, emit_slice_avx2, emit_slice_avx512);
    }
    static auto layer_emitter(const SlabContour& slab) {
        return slab.normals_ ? emit_layer_plainly : slab::kernel_for(slab.level_, emit_layer_baseline, emit_layer_avx2, emit_layer_avx512);
    }
};

}  // namespace strata
