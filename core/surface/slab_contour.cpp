#include "core/surface/slab_contour.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"
#include "core/surface/slab_kernel.h"

namespace strata {

SlabContour::SlabContour(const GridPlacement& placement, const std::array<uint32_t, 3>& size, const ContourSettings& settings,
                         double reference, SimdLevel level)
    : samples_{size[0], size[1], size[2]},
      pad_(settings.close ? 1 : 0),
      columns_(samples_[0] + 2 * pad_),
      rows_(samples_[1] + 2 * pad_),
      slices_(samples_[2] + 2 * pad_),
      stride_(size_t(columns_ + 63) / 64 + 1),
      below_(settings.inside == ContourInside::below),
      normals_(settings.normals),
      mirrored_(placement.is_mirrored()),
      threads_(settings.threads),
      level_(level),
      axes_{placement.axes.col(0), placement.axes.col(1), placement.axes.col(2)},
      normal_from_gradient_(placement.axes.inverse().transpose()) {
    if (!settings.colors.empty() && settings.colors.size() != settings.isovalues.size())
        throw Error(ErrorKind::usage,
                    std::to_string(settings.isovalues.size()) + " isovalues have " + std::to_string(settings.colors.size()) + " colors");
    for (const double isovalue : settings.isovalues) {
        if (!std::isfinite(isovalue)) throw Error(ErrorKind::usage, "an isovalue is not finite");
        isovalues_.push_back(isovalue - reference);
        levels_.push_back(level_of(isovalue - reference, below_));
    }
}

int64_t SlabContour::layers() const {
    const bool none = samples_[0] == 0 || samples_[1] == 0 || samples_[2] == 0 || columns_ < 2 || rows_ < 2 || slices_ < 2;
    return none || isovalues_.empty() ? 0 : slices_ - 1;
}

std::array<int64_t, 2> SlabContour::slices_of(int64_t first, int64_t end) const {
    const int64_t around = normals_ ? 1 : 0;
    return {std::clamp<int64_t>(first - pad_ - around, 0, samples_[2]), std::clamp<int64_t>(end + 1 - pad_ + around, 0, samples_[2])};
}

uint64_t SlabContour::plan_bytes(int64_t layers) const {
    const uint64_t row_bytes = stride_ * sizeof(uint64_t) + sizeof(SliceRow) + sizeof(LayerRow);
    return uint64_t(layers + 1) * isovalues_.size() * (uint64_t(rows_) * row_bytes + 2 * sizeof(Unit));
}

void SlabContour::find_masks(const SlabSamples& samples, int64_t slab_slice, SampleStatistics& statistics) {
    const size_t written = size_t(samples_[0] + 63) / 64;
    std::vector<uint64_t*> rows(isovalues_.size());
    for (int64_t j = 0; j < rows_; ++j) {
        for (size_t s = 0; s < rows.size(); ++s) rows[s] = mask(slab_slice, s, j);
        const float* const values = SlabKernel::samples_of(*this, samples, j, slab_first_ + slab_slice);
        if (values == nullptr) {
            for (uint64_t* row : rows) std::fill_n(row, stride_, 0);
            continue;
        }
        find_inside({values, size_t(samples_[0])}, levels_, below_, rows.data(), statistics, level_);
        for (uint64_t* row : rows) {
            std::fill(row + written, row + stride_, 0);
            if (pad_ == 0) continue;
            for (size_t w = stride_ - 1; w > 0; --w) row[w] = row[w] << 1 | row[w - 1] >> 63;
            row[0] <<= 1;
        }
    }
}

void SlabContour::plan(const SlabSamples& samples, int64_t first, int64_t end) {
    const auto slices = size_t(end - first) + 1, isovalues = isovalues_.size(), unit_rows = size_t(rows_);
    // The first slice is the last of the layers before, whose vertices are numbered.
    const size_t shared_rows = first == 0 ? 0 : isovalues * unit_rows;
    const std::vector<SliceRow> shared(slice_rows_.end() - std::ptrdiff_t(shared_rows), slice_rows_.end());
    slab_first_ = first;
    slab_end_ = end;
    if (const size_t words = slices * isovalues * unit_rows * stride_; masks_.size() < words) masks_ = LargeArray<uint64_t>(words);
    slice_units_.resize(slices * isovalues);
    layer_units_.resize((slices - 1) * isovalues);
    slice_rows_.resize(slice_units_.size() * unit_rows);
    layer_rows_.resize(layer_units_.size() * unit_rows);

    std::mutex mutex;
    Findings findings;
    const auto keep = [&](const Findings& found) {
        const std::lock_guard lock(mutex);
        findings.samples.add(found.samples);
        findings.ambiguous += found.ambiguous;
        findings.tunnels += found.tunnels;
        findings.meets_boundary |= found.meets_boundary;
    };
    const auto count_slice =
        slab::kernel_for(level_, SlabKernel::count_slice_baseline, SlabKernel::count_slice_avx2, SlabKernel::count_slice_avx512);
    const auto count_layer =
        slab::kernel_for(level_, SlabKernel::count_layer_baseline, SlabKernel::count_layer_avx2, SlabKernel::count_layer_avx512);
    parallel_blocks(threads_, slices, 1, [&](size_t begin, size_t stop) {
        Findings found;
        for (size_t slice = begin; slice < stop; ++slice) {
            SampleStatistics known;  // of the slice shared with the layers before
            find_masks(samples, int64_t(slice), first > 0 && slice == 0 ? known : found.samples);
            count_slice(*this, int64_t(slice), found);
        }
        keep(found);
    });
    parallel_blocks(threads_, slices - 1, 1, [&](size_t begin, size_t stop) {
        Findings found;
        for (size_t layer = begin; layer < stop; ++layer) count_layer(*this, samples, int64_t(layer), found);
        keep(found);
    });

    number_units(int64_t(slices));
    parallel_blocks(threads_, slices, 4, [&](size_t begin, size_t stop) {
        for (size_t u = begin * isovalues; u < stop * isovalues; ++u) {
            uint64_t vertex = slice_units_[u].first_vertex;
            for (size_t j = 0; j < unit_rows; ++j) {
                SliceRow& row = slice_rows_[u * unit_rows + j];
                const SliceRow count = row;
                row = {uint32_t(vertex), uint32_t(vertex + count.x)};
                vertex += count.x + count.y;
            }
            if (u >= layer_units_.size()) continue;
            vertex = layer_units_[u].first_vertex;
            uint64_t triangle = 0;
            for (size_t j = 0; j < unit_rows; ++j) {
                LayerRow& row = layer_rows_[u * unit_rows + j];
                const LayerRow count = row;
                row = {uint32_t(vertex), uint32_t(vertex + count.z), uint32_t(triangle)};
                vertex += count.z + count.inner;
                triangle += count.triangles;
            }
        }
    });
    std::copy(shared.begin(), shared.end(), slice_rows_.begin());

    report_.vertices = next_vertex_;
    if (!layer_units_.empty()) report_.triangles += layer_units_.back().first_triangle + layer_units_.back().triangles;
    report_.nan_samples += findings.samples.nan;
    report_.least = std::min(report_.least, findings.samples.least);
    report_.greatest = std::max(report_.greatest, findings.samples.greatest);
    report_.meets_boundary |= findings.meets_boundary;
    report_.ambiguous_cells += findings.ambiguous;
    report_.tunnel_cells += findings.tunnels;
}

void SlabContour::number_units(int64_t slices) {
    const size_t isovalues = isovalues_.size();
    uint64_t triangle = 0;
    for (size_t u = 0; u < size_t(slices) * isovalues; u += isovalues) {
        for (size_t s = u; s < u + isovalues; ++s) {
            if (u == 0 && slab_first_ > 0) slice_units_[s].vertices = 0;  // they came with the layer before
            slice_units_[s].first_vertex = next_vertex_;
            next_vertex_ += slice_units_[s].vertices;
        }
        if (u == layer_units_.size()) break;
        for (size_t s = u; s < u + isovalues; ++s) {
            layer_units_[s].first_vertex = next_vertex_;
            next_vertex_ += layer_units_[s].vertices;
            layer_units_[s].first_triangle = triangle;
            triangle += layer_units_[s].triangles;
            if (layer_units_[s].triangles > std::numeric_limits<uint32_t>::max())
                throw Error(ErrorKind::limit, "the surface has more than 4294967295 triangles between two slices");
        }
    }
    if (next_vertex_ > std::numeric_limits<uint32_t>::max())
        throw Error(ErrorKind::limit, "the surface has more than 4294967295 vertices: take a coarser field, or a part of it");
}

SlabContour::Part SlabContour::part_of(int64_t first, int64_t end) const {
    Part part;
    for (size_t u = unit(first - slab_first_, 0); u < unit(end - slab_first_, 0); ++u) {
        part.vertices += layer_units_[u].vertices + slice_units_[u + isovalues_.size()].vertices;
        part.triangles += layer_units_[u].triangles;
    }
    if (first == 0)
        for (size_t s = 0; s < isovalues_.size(); ++s) part.vertices += slice_units_[s].vertices;
    return part;
}

void SlabContour::keep(const CutStatistics& cuts) {
    report_.clamped_vertices += cuts.clamped;
    report_.largest_shift_cells = std::max(report_.largest_shift_cells, cuts.largest_shift);
}

uint64_t SlabContour::first_vertex_of(int64_t layer) const { return layer == 0 ? 0 : layer_units_[unit(layer - slab_first_, 0)].first_vertex; }

void SlabContour::emit(const SlabSamples& samples, int64_t first, int64_t end, const ContourTarget& out) {
    if (part_of(first, end).triangles == 0) return;  // nor vertices, and no place for them
    const auto emit_slice = SlabKernel::slice_emitter(*this);
    const auto emit_layer = SlabKernel::layer_emitter(*this);
    const uint64_t first_vertex = first_vertex_of(first), first_triangle = layer_units_[unit(first - slab_first_, 0)].first_triangle;
    const SlabKernel::RowRange rows = {0, rows_};
    std::mutex mutex;
    parallel_blocks(threads_, size_t(end - first), 1, [&](size_t begin, size_t stop) {
        CutStatistics cuts;
        for (size_t n = begin; n < stop; ++n) {
            const int64_t layer = first + int64_t(n) - slab_first_;
            for (size_t s = 0; s < isovalues_.size(); ++s) {
                if (first + int64_t(n) == 0) emit_slice(*this, samples, 0, s, rows, out, first_vertex, cuts);
                emit_layer(*this, samples, layer, s, rows, out, first_vertex, first_triangle, cuts);
                emit_slice(*this, samples, layer + 1, s, rows, out, first_vertex, cuts);
            }
        }
        const std::lock_guard lock(mutex);
        keep(cuts);
    });
}

uint64_t SlabContour::vertices_before(int64_t layer, size_t row) const {
    const size_t slice_rows = triangle_rows(), here = unit(layer - slab_first_, 0);
    if (row == vertex_rows(layer)) {
        const Unit& last = slice_units_[here + 2 * isovalues_.size() - 1];
        return last.first_vertex + last.vertices - first_vertex_of(layer);
    }
    if (layer == 0) {
        if (row < slice_rows) return slice_rows_[row].x;
        row -= slice_rows;
    }
    const uint32_t number = row < slice_rows ? layer_rows_[here * size_t(rows_) + row].z : slice_rows_[here * size_t(rows_) + row].x;
    return number - first_vertex_of(layer);
}

uint64_t SlabContour::triangles_before(int64_t layer, size_t row) const {
    const size_t here = unit(layer - slab_first_, 0);
    const uint64_t first = layer_units_[here].first_triangle;
    if (row == triangle_rows()) {
        const Unit& last = layer_units_[here + isovalues_.size() - 1];
        return last.first_triangle + last.triangles - first;
    }
    return layer_units_[here + row / size_t(rows_)].first_triangle + layer_rows_[here * size_t(rows_) + row].triangles - first;
}

namespace {

constexpr size_t kRowsAThread = 16;

// The rows of each isovalue among some of all.
template <typename Use>
void for_units(size_t first_row, size_t end_row, size_t unit_rows, const Use& use) {
    for (size_t row = first_row; row < end_row;) {
        const size_t unit = row / unit_rows, end = std::min(end_row, (unit + 1) * unit_rows);
        use(unit, std::array<int64_t, 2>{int64_t(row - unit * unit_rows), int64_t(end - unit * unit_rows)});
        row = end;
    }
}

}  // namespace

void SlabContour::emit_vertices(const SlabSamples& samples, int64_t layer, size_t first_row, size_t end_row, const ContourTarget& out) {
    const auto emit_slice = SlabKernel::slice_emitter(*this);
    const auto emit_layer = SlabKernel::layer_emitter(*this);
    const uint64_t first_vertex = first_vertex_of(layer) + vertices_before(layer, first_row);
    const ContourTarget vertices = {.positions = out.positions, .normals = out.normals};
    const size_t below = layer == 0 ? isovalues_.size() : 0;  // units of a slice before those of the layer
    std::mutex mutex;
    parallel_blocks(threads_, end_row - first_row, kRowsAThread, [&](size_t begin, size_t stop) {
        CutStatistics cuts;
        for_units(first_row + begin, first_row + stop, size_t(rows_), [&](size_t u, const SlabKernel::RowRange& rows) {
            const size_t s = u % isovalues_.size();
            if (u < below) emit_slice(*this, samples, 0, s, rows, vertices, first_vertex, cuts);
            else if (u < below + isovalues_.size()) emit_layer(*this, samples, layer - slab_first_, s, rows, vertices, first_vertex, 0, cuts);
            else emit_slice(*this, samples, layer - slab_first_ + 1, s, rows, vertices, first_vertex, cuts);
        });
        const std::lock_guard lock(mutex);
        keep(cuts);
    });
}

void SlabContour::emit_triangles(const SlabSamples& samples, int64_t layer, size_t first_row, size_t end_row, const ContourTarget& out) {
    const auto emit_layer = SlabKernel::layer_emitter(*this);
    const uint64_t first = layer_units_[unit(layer - slab_first_, 0)].first_triangle + triangles_before(layer, first_row);
    const ContourTarget triangles = {.triangles = out.triangles};
    parallel_blocks(threads_, end_row - first_row, kRowsAThread, [&](size_t begin, size_t stop) {
        CutStatistics none;
        for_units(first_row + begin, first_row + stop, size_t(rows_), [&](size_t s, const SlabKernel::RowRange& rows) {
            emit_layer(*this, samples, layer - slab_first_, s, rows, triangles, 0, first, none);
        });
    });
}

void SlabContour::for_isovalues(int64_t first, int64_t end, const std::function<void(size_t isovalue, uint64_t vertices)>& use) const {
    const size_t isovalues = isovalues_.size();
    if (first == 0)
        for (size_t s = 0; s < isovalues; ++s) use(s, slice_units_[s].vertices);
    for (int64_t layer = first; layer < end; ++layer) {
        const size_t u = unit(layer - slab_first_, 0);
        for (size_t s = 0; s < isovalues; ++s) use(s, layer_units_[u + s].vertices);
        for (size_t s = 0; s < isovalues; ++s) use(s, slice_units_[u + isovalues + s].vertices);
    }
}

}  // namespace strata
