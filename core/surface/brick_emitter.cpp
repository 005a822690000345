#include "core/surface/brick_emitter.h"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <optional>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/simd_target.h"
#include "core/surface/cell_cases.h"
#include "core/surface/field_slope.h"
#include "core/surface/inner_vertex.h"

namespace strata {
namespace {

constexpr int kSide = kFieldBrickSide;

// Whether cells of a plane have a crossed edge that begins in the place of a brick without cells.
bool crosses_unowned(const std::array<const BrickPart*, 8>& around, const std::array<uint64_t, 8>& corner, uint64_t whole, unsigned k) {
    const auto beyond = [](bool is_at_end, uint64_t last, bool upper) { return is_at_end ? last : upper ? ~last : ~uint64_t{0}; };
    for (unsigned n = 1; n < 8; ++n) {
        if (around[n] != nullptr) continue;
        for (const CellEdge& edge : kCellEdge) {
            const unsigned c = edge.lower;
            if ((c & n) != n || ((n & 4) != 0) != ((c & 4) != 0 && k == kSide - 1)) continue;
            const uint64_t there = beyond((n & 1) != 0, brick_word::kLastColumn, (c & 1) != 0) &
                                   beyond((n & 2) != 0, brick_word::kLastRow, (c & 2) != 0);
            if (((corner[edge.lower] ^ corner[edge.upper]) & there & whole) != 0) return true;
        }
    }
    return false;
}

}  // namespace

// The loops over a brick, compiled for each instruction set.
struct BrickKernel {
    static void put(const Vec3d& position, Vec3f& out) { out = {float(position.x()), float(position.y()), float(position.z())}; }

    static void put_vertices(const BrickEmitter& emitter, const NumberedCells& layer, size_t number_of_part, bool early,
                             const BrickTarget& out, CutStatistics& cuts) {
        const BrickCells& cells = layer.cells;
        const BrickPart& part = cells.parts[number_of_part];
        const size_t brick = number_of_part % cells.bricks();
        const double level = emitter.settings_.isovalues[number_of_part / cells.bricks()];
        uint64_t any = 0;
        for (size_t axis = 0; axis < 3; ++axis)
            for (size_t plane = 0; plane < kSide; ++plane) any |= BrickPart::comes_early(axis, plane) == early ? part.crossed[axis][plane] : 0;
        if (any == 0) return;
        const BrickView view(cells, layer.layers, brick);
        const Vec3d start = emitter.start_of(cells, brick);
        const std::array<Vec3d, 3>& axes = emitter.axes_;
        for (size_t plane = 0; plane < kSide; ++plane)
            for (size_t axis = 0; axis < 3; ++axis) {
                if (BrickPart::comes_early(axis, plane) != early) continue;
                uint64_t number = part.first[axis][plane] - out.first_vertex;
                for (uint64_t left = part.crossed[axis][plane]; left != 0; left &= left - 1, ++number) {
                    const auto bit = unsigned(std::countr_zero(left));
                    const unsigned i = bit & 7, j = bit >> 3, k = unsigned(plane);
                    const double t = cut_edge(view.at(i, j, k), view.at(i + (axis == 0), j + (axis == 1), k + (axis == 2)), level, cuts);
                    put(start + double(i) * axes[0] + double(j) * axes[1] + double(k) * axes[2] + t * axes[axis], out.positions[number]);
                    if (out.normals == nullptr) continue;
                    std::array<int, 3> upper = {int(i), int(j), int(k)};
                    ++upper[axis];
                    const Vec3d slope = (1.0 - t) * emitter.slope_at(cells, brick, view, {int(i), int(j), int(k)}) +
                                        t * emitter.slope_at(cells, brick, view, upper);
                    out.normals[number] = emitter.normal_of(emitter.levels_.below ? slope : Vec3d(-slope));
                }
            }
    }

    // Returns how many.
    static uint32_t put_inner_of(const BrickEmitter& emitter, const Vec3d& start, const CellValues& values, const CellPatch& patch,
                                 const std::array<unsigned, 3>& cell, const BrickTarget& out, uint64_t at) {
        const std::array<Vec3d, 3>& axes = emitter.axes_;
        for (size_t n = 0; n < patch.inner; ++n, ++at) {
            const Vec3d p_cell = place_inner_vertex(values, patch.inner_edges[n]);
            put(start + (cell[0] + p_cell.x()) * axes[0] + (cell[1] + p_cell.y()) * axes[1] + (cell[2] + p_cell.z()) * axes[2],
                out.positions[at]);
            if (out.normals != nullptr) out.normals[at] = emitter.normal_of(-inside_slope(values, p_cell));
        }
        return patch.inner;
    }

    static void put_triangles(const BrickEmitter& emitter, const NumberedCells& layer, size_t number_of_part, const BrickTarget& out) {
        const BrickCells& cells = layer.cells;
        const BrickPart& part = cells.parts[number_of_part];
        if (part.triangles == 0) return;
        const size_t isovalue = number_of_part / cells.bricks(), brick = number_of_part % cells.bricks();
        const CellCases& cases = CellCases::get();
        const CellCases::Plain& plain = cases.plain(emitter.mirrored_);
        std::array<const BrickPart*, 8> around;
        for (size_t n = 0; n < 8; ++n) {
            const BrickCells* const there = n < 4 ? &cells : layer.above;
            const int32_t at = (*layer.around)[brick][n];
            around[n] = at < 0 ? nullptr : &there->parts[isovalue * there->bricks() + size_t(at)];
        }
        // Edges without a vertex may have no owner, and get a number that is not used.
        static constexpr BrickPart kNobody = {};
        std::array<const BrickPart*, 8> owners = around;
        bool all_owned = true;
        for (const BrickPart*& owner : owners)
            if (owner == nullptr) {
                owner = &kNobody;
                all_owned = false;
            }
        const auto vertex_on = [&](const CellEdge& edge, unsigned i, unsigned j, unsigned k) {
            i += edge.lower & 1;
            j += edge.lower >> 1 & 1;
            k += edge.lower >> 2;
            const BrickPart& owner = *owners[i >> 3 | j >> 3 << 1 | k >> 3 << 2];
            const uint64_t before = (uint64_t{1} << ((j & 7) * 8 + (i & 7))) - 1;
            return owner.first[edge.axis][k & 7] + uint32_t(std::popcount(owner.crossed[edge.axis][k & 7] & before));
        };

        std::array<uint32_t, CellPatch::kPlaces> ids = {};
        std::array<uint32_t, 3>* triangle = out.triangles + (part.first_triangle - out.first_triangle);
        uint32_t inner = part.first_inner;
        std::optional<BrickView> view;
        Vec3d start = Vec3d::Zero();
        std::array<uint64_t, 4> low = cells.corners_of(layer.layers, emitter.levels_, isovalue, brick, 0);
        for (unsigned k = 0; k < kSide; ++k) {
            const std::array<uint64_t, 4> high = cells.corners_of(layer.layers, emitter.levels_, isovalue, brick, int(k) + 1);
            const std::array<uint64_t, 8> corner = corner_words(low, high);
            low = high;
            const uint64_t whole = cells.whole_cells(brick, k);
            if (!all_owned && crosses_unowned(around, corner, whole, k)) BrickEmitter::refuse_absent(cells);
            for (uint64_t left = active_cells(corner) & whole; left != 0; left &= left - 1) {
                const auto bit = unsigned(std::countr_zero(left));
                const unsigned i = bit & 7, j = bit >> 3;
                const unsigned cell_case = case_of_cell(corner, bit);
#pragma GCC unroll 12
                for (size_t e = 0; e < kCellEdges; ++e) ids[CellPatch::place_of_edge(e)] = vertex_on(kCellEdge[e], i, j, k);
                const uint8_t count = plain.triangles[cell_case];
                if (count != CellCases::kUndecided) {
                    const auto& vertices = plain.vertices[cell_case];
                    for (size_t t = 0; t < count; ++t)
                        *triangle++ = {ids[vertices[3 * t]], ids[vertices[3 * t + 1]], ids[vertices[3 * t + 2]]};
                    continue;
                }
                if (!view) {
                    view.emplace(cells, layer.layers, brick);
                    start = emitter.start_of(cells, brick);
                }
                const CellValues values = view->cell(emitter.settings_.isovalues[isovalue], emitter.levels_.below, i, j, k);
                const CellPatch& patch = *cases.decide(cell_case, values).patch;
                if (out.positions != nullptr) put_inner_of(emitter, start, values, patch, {i, j, k}, out, inner - out.first_vertex);
                for (size_t n = 0; n < patch.inner; ++n) ids[CellPatch::place_of_inner(n)] = inner++;
                for (size_t t = 0; t < patch.triangles; ++t) {
                    *triangle = {ids[patch.vertices[3 * t]], ids[patch.vertices[3 * t + 1]], ids[patch.vertices[3 * t + 2]]};
                    if (emitter.mirrored_) std::swap((*triangle)[0], (*triangle)[2]);
                    ++triangle;
                }
            }
        }
    }

    STRATA_KERNEL_BASELINE static void vertices_baseline(const BrickEmitter& emitter, const NumberedCells& layer, size_t part, bool early,
                                                         const BrickTarget& out, CutStatistics& cuts) {
        put_vertices(emitter, layer, part, early, out, cuts);
    }
    STRATA_KERNEL_AVX2 static void vertices_avx2(const BrickEmitter& emitter, const NumberedCells& layer, size_t part, bool early,
                                                 const BrickTarget& out, CutStatistics& cuts) {
        put_vertices(emitter, layer, part, early, out, cuts);
    }
    STRATA_KERNEL_AVX512 static void vertices_avx512(const BrickEmitter& emitter, const NumberedCells& layer, size_t part, bool early,
                                                     const BrickTarget& out, CutStatistics& cuts) {
        put_vertices(emitter, layer, part, early, out, cuts);
    }
    STRATA_KERNEL_BASELINE static void triangles_baseline(const BrickEmitter& emitter, const NumberedCells& layer, size_t part,
                                                          const BrickTarget& out) {
        put_triangles(emitter, layer, part, out);
    }
    STRATA_KERNEL_AVX2 static void triangles_avx2(const BrickEmitter& emitter, const NumberedCells& layer, size_t part,
                                                  const BrickTarget& out) {
        put_triangles(emitter, layer, part, out);
    }
    STRATA_KERNEL_AVX512 static void triangles_avx512(const BrickEmitter& emitter, const NumberedCells& layer, size_t part,
                                                      const BrickTarget& out) {
        put_triangles(emitter, layer, part, out);
    }

    template <typename Kernel>
    static Kernel* choose(SimdLevel level, Kernel* baseline, Kernel* avx2, Kernel* avx512) {
        return level == SimdLevel::avx512 ? avx512 : level == SimdLevel::avx2 ? avx2 : baseline;
    }
};

BrickEmitter::BrickEmitter(const FieldBrickSource& source, const ContourSettings& settings, const BrickLevels& levels,
                           const BrickLayerWindow& window)
    : source_(source),
      settings_(settings),
      levels_(levels),
      window_(window),
      mirrored_(source.placement().is_mirrored()),
      axes_{source.placement().axes.col(0), source.placement().axes.col(1), source.placement().axes.col(2)},
      normal_from_gradient_(source.placement().axes.inverse().transpose()) {}

void BrickEmitter::put_vertices(const NumberedCells& layer, size_t part, bool early, const BrickTarget& out, CutStatistics& cuts) const {
    BrickKernel::choose(simd_level_, BrickKernel::vertices_baseline, BrickKernel::vertices_avx2, BrickKernel::vertices_avx512)(
        *this, layer, part, early, out, cuts);
}

void BrickEmitter::put_triangles(const NumberedCells& layer, size_t part, const BrickTarget& out) const {
    BrickKernel::choose(simd_level_, BrickKernel::triangles_baseline, BrickKernel::triangles_avx2,
                        BrickKernel::triangles_avx512)(*this, layer, part, out);
}

void BrickEmitter::put_inner(const NumberedCells& layer, size_t number_of_part, const BrickTarget& out) const {
    const BrickCells& cells = layer.cells;
    const BrickPart& part = cells.parts[number_of_part];
    if (part.inner == 0) return;
    const size_t isovalue = number_of_part / cells.bricks(), brick = number_of_part % cells.bricks();
    const BrickView view(cells, layer.layers, brick);
    const Vec3d start = start_of(cells, brick);
    uint64_t at = part.first_inner - out.first_vertex;
    for (unsigned k = 0; k < kSide; ++k) {
        const std::array<uint64_t, 8> corner = corner_words(cells.corners_of(layer.layers, levels_, isovalue, brick, int(k)),
                                                            cells.corners_of(layer.layers, levels_, isovalue, brick, int(k) + 1));
        for (uint64_t left = undecided_cells(corner) & cells.whole_cells(brick, k); left != 0; left &= left - 1) {
            const auto bit = unsigned(std::countr_zero(left));
            const std::array<unsigned, 3> cell = {bit & 7, bit >> 3, k};
            const CellValues values = view.cell(settings_.isovalues[isovalue], levels_.below, cell[0], cell[1], cell[2]);
            const CellPatch& patch = *CellCases::get().decide(case_of_cell(corner, bit), values).patch;
            at += BrickKernel::put_inner_of(*this, start, values, patch, cell, out, at);
        }
    }
}

// Of a brick's least sample, in the world, less the origin.
Vec3d BrickEmitter::start_of(const BrickCells& cells, size_t brick) const {
    return double(int64_t{cells.corners[brick][0]} - start_[0]) * axes_[0] + double(int64_t{cells.corners[brick][1]} - start_[1]) * axes_[1] +
           double(int64_t{cells.k} - start_[2]) * axes_[2];
}

// A sample near a brick's place.
double BrickEmitter::value_at(const BrickCells& cells, size_t brick, const BrickView& view, const std::array<int, 3>& at) const {
    if (std::all_of(at.begin(), at.end(), [](int c) { return c >= 0 && c <= kSide; }))
        return view.at(unsigned(at[0]), unsigned(at[1]), unsigned(at[2]));
    const auto brick_of = [](int64_t c) { return int32_t(c & ~int64_t{kSide - 1}); };
    const std::array<int64_t, 3> p = {int64_t{cells.corners[brick][0]} + at[0], int64_t{cells.corners[brick][1]} + at[1],
                                      int64_t{cells.k} + at[2]};
    const BrickPlace corner = {brick_of(p[0]), brick_of(p[1])};
    const auto absent = [&] {
        const std::lock_guard lock(source_mutex_);
        return double(source_.absent_value({corner[0], corner[1], brick_of(p[2])}));
    };
    const MaskedLayer* const samples = window_.at(brick_of(p[2]));
    if (samples == nullptr) return absent();
    const auto& corners = samples->layer.corners;
    const auto found = std::lower_bound(corners.begin(), corners.end(), corner, comes_before);
    if (found == corners.end() || *found != corner) return absent();
    const auto in_brick = [](int64_t c) { return size_t(c & (kSide - 1)); };
    return double(samples->layer.values[size_t(found - corners.begin()) * kFieldBrickSamples +
                                        (in_brick(p[2]) * kSide + in_brick(p[1])) * kSide + in_brick(p[0])]);
}

Vec3d BrickEmitter::slope_at(const BrickCells& cells, size_t brick, const BrickView& view, const std::array<int, 3>& at) const {
    const double here = value_at(cells, brick, view, at);
    Vec3d slope = Vec3d::Zero();
    for (size_t axis = 0; axis < 3; ++axis) {
        std::array<int, 3> before = at, after = at;
        --before[axis];
        ++after[axis];
        slope[int(axis)] = slope_between(value_at(cells, brick, view, before), here, value_at(cells, brick, view, after));
    }
    return slope.allFinite() ? slope : Vec3d::Zero();
}

Vec3f BrickEmitter::normal_of(const Vec3d& outward) const { return unit_normal(normal_from_gradient_ * outward); }

void BrickEmitter::refuse_absent(const BrickCells& cells) {
    throw Error(ErrorKind::malformed, "bricks near k = " + std::to_string(cells.k) + " touch, have different values and are not given");
}

}  // namespace strata
