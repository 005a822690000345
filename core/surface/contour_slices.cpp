#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/surface/contour.h"
#include "core/surface/slab_contour.h"

namespace strata {
namespace {

constexpr int64_t kMostLayers = 64;  // of a slab: more gain nothing
constexpr uint64_t kPieces = 8;      // a part of the memory is for a piece, since what takes it keeps some of it; at most:
constexpr uint64_t kMostPieceBytes = uint64_t{64} << 20;

// Slices of a grid in memory, read from the source as they are wanted.
class SliceWindow {
public:
    SliceWindow(SliceSource& source, double reference) : source_(source), reference_(reference) {
        const auto [columns, rows, slices] = source.size();
        slice_samples_ = uint64_t{columns} * rows;
    }

    // Slices [first, end), of which those before the last window's end are kept.
    SlabSamples move_to(int64_t first, int64_t end) {
        const auto kept_from = size_t(uint64_t(first - first_) * slice_samples_), kept = size_t(uint64_t(end_ - first) * slice_samples_);
        const auto wanted = size_t(uint64_t(end - first) * slice_samples_);
        if (values_.size() < wanted) {
            LargeArray<float> larger(wanted);
            std::copy_n(values_.data() + kept_from, kept, larger.data());
            values_ = std::move(larger);
        } else {
            std::copy_n(values_.data() + kept_from, kept, values_.data());
        }
        if (end > end_) source_.read(uint32_t(end - end_), reference_, {values_.data() + kept, wanted - kept});
        first_ = first;
        end_ = std::max(end, end_);
        return {.values = values_.data(), .first_slice = first};
    }

private:
    SliceSource& source_;
    double reference_;
    uint64_t slice_samples_ = 0;
    int64_t first_ = 0, end_ = 0;
    LargeArray<float> values_;
};

// One piece of the surface on its way to the sink.
class PieceBuffer {
public:
    PieceBuffer(const ContourSettings& settings, const Vec3d& origin, SurfaceSink& sink) : settings_(settings), origin_(origin), sink_(sink) {}

    uint64_t bytes_of(const SlabContour::Part& part) const {
        const uint64_t vertex = sizeof(Vec3f) * (settings_.normals ? 2 : 1) + (settings_.colors.empty() ? 0 : sizeof settings_.colors[0]);
        return part.vertices * vertex + part.triangles * sizeof(std::array<uint32_t, 3>);
    }

    // Whole layers.
    void pass_on(SlabContour& slab, const SlabSamples& samples, int64_t first, int64_t end, uint64_t most_bytes) {
        const SlabContour::Part part = slab.part_of(first, end);
        if (part.vertices == 0 && part.triangles == 0) return;
        const ContourTarget target = room_for(part, most_bytes);
        slab.emit(samples, first, end, target);
        colors_.clear();
        if (!settings_.colors.empty())
            slab.for_isovalues(first, end, [&](size_t isovalue, uint64_t vertices) {
                colors_.insert(colors_.end(), size_t(vertices), settings_.colors[isovalue]);
            });
        hand_on(part);
    }

    // Rows of a layer that is too large to be one piece: its vertices, then its triangles.
    void pass_on_rows(SlabContour& slab, const SlabSamples& samples, int64_t layer, uint64_t most_bytes) {
        // Others may keep more for a vertex than this: about as many come as with whole layers.
        const uint64_t with_triangles = 2 * sizeof(std::array<uint32_t, 3>), vertex_bytes = bytes_of({.vertices = 1}) + with_triangles;
        const auto vertices = [&](size_t row) { return slab.vertices_before(layer, row); };
        for_pieces(slab.vertex_rows(layer), vertices, vertex_bytes, most_bytes, [&](size_t first, size_t end, uint64_t count) {
            slab.emit_vertices(samples, layer, first, end, room_for({.vertices = count}, most_bytes));
            colors_.clear();
            if (!settings_.colors.empty())
                for (size_t row = first; row < end; ++row)
                    colors_.resize(size_t(vertices(row + 1) - vertices(first)), settings_.colors[slab.isovalue_of(row)]);
            hand_on({.vertices = count});
        });
        colors_.clear();
        const auto triangles = [&](size_t row) { return slab.triangles_before(layer, row); };
        for_pieces(slab.triangle_rows(), triangles, bytes_of({.triangles = 1}), most_bytes, [&](size_t first, size_t end, uint64_t count) {
            slab.emit_triangles(samples, layer, first, end, room_for({.triangles = count}, most_bytes));
            hand_on({.triangles = count});
        });
    }

    // The most that a row of a layer needs.
    uint64_t row_bytes(const SlabContour& slab, int64_t layer) const {
        uint64_t vertices = 0, triangles = 0;
        for (size_t row = 0; row < slab.vertex_rows(layer); ++row)
            vertices = std::max(vertices, slab.vertices_before(layer, row + 1) - slab.vertices_before(layer, row));
        for (size_t row = 0; row < slab.triangle_rows(); ++row)
            triangles = std::max(triangles, slab.triangles_before(layer, row + 1) - slab.triangles_before(layer, row));
        return std::max(bytes_of({.vertices = vertices}), bytes_of({.triangles = triangles}));
    }

private:
    // Calls with as many rows as fit, at least one.
    template <typename Before, typename Use>
    static void for_pieces(size_t rows, const Before& before, uint64_t each, uint64_t most_bytes, const Use& use) {
        for (size_t first = 0, end; first < rows; first = end) {
            end = first + 1;
            while (end < rows && (before(end + 1) - before(first)) * each <= most_bytes) ++end;
            if (const uint64_t count = before(end) - before(first); count > 0) use(first, end, count);
        }
    }

    // In the memory of pieces before, if both together do not take more than one may.
    ContourTarget room_for(const SlabContour::Part& part, uint64_t most_bytes) {
        if (bytes_of({std::max<uint64_t>(part.vertices, positions_.size()), std::max<uint64_t>(part.triangles, triangles_.size())}) > most_bytes) {
            positions_ = {};
            normals_ = {};
            triangles_ = {};
        }
        reserve(positions_, part.vertices);
        reserve(triangles_, part.triangles);
        if (settings_.normals) reserve(normals_, part.vertices);
        return {.positions = positions_.data(), .normals = normals_.data(), .triangles = triangles_.data()};
    }

    void hand_on(const SlabContour::Part& part) {
        const auto vertices = size_t(part.vertices);
        sink_.add({.origin = origin_,
                   .positions = {positions_.data(), vertices},
                   .normals = {normals_.data(), settings_.normals ? vertices : 0},
                   .colors = colors_,
                   .triangles = {triangles_.data(), size_t(part.triangles)},
                   .quads = {}});
    }

    template <typename T>
    static void reserve(LargeArray<T>& array, uint64_t size) {
        if (array.size() < size) array = LargeArray<T>(size_t(size));
    }

    const ContourSettings& settings_;
    Vec3d origin_;
    SurfaceSink& sink_;
    LargeArray<Vec3f> positions_, normals_;
    LargeArray<std::array<uint32_t, 3>> triangles_;
    std::vector<std::array<uint8_t, 4>> colors_;
};

[[noreturn]] void refuse(uint64_t needed, const ContourSettings& settings) {
    throw Error(ErrorKind::limit, "slices of the field and a row of the surface between them need " + std::to_string(needed * settings.memory_parts) +
                                      " bytes of memory, " + std::to_string(settings.memory_bytes * settings.memory_parts) + " are allowed");
}

}  // namespace

ContourReport contour_slices(SliceSource& source, const ContourSettings& settings, SurfaceSink& sink) {
    const double reference = settings.isovalues.empty() ? 0.0 : settings.isovalues.front();
    SlabContour slab(source.placement(), source.size(), settings, reference, best_simd_level());
    const int64_t layers = slab.layers();
    SliceWindow window(source, reference);
    PieceBuffer piece(settings, source.placement().origin, sink);
    const auto [columns, rows, slices] = source.size();
    constexpr uint64_t kMostSamples = uint64_t{1} << 48;  // a slice: byte counts of a slab do not overflow
    if (uint64_t{columns} * rows > kMostSamples) refuse(kMostSamples * sizeof(float), settings);
    const uint64_t slice_bytes = uint64_t{columns} * rows * sizeof(float);
    const auto slab_bytes = [&](int64_t first, int64_t end) {
        const auto [first_slice, end_slice] = slab.slices_of(first, end);
        return uint64_t(end_slice - first_slice) * slice_bytes + slab.plan_bytes(end - first);
    };

    for (int64_t first = 0, end; first < layers; first = end) {
        end = first + 1;
        if (slab_bytes(first, end) > settings.memory_bytes) refuse(slab_bytes(first, end), settings);
        // Half of the memory is for the surface.
        while (end < layers && end - first < kMostLayers && slab_bytes(first, end + 1) <= settings.memory_bytes / 2) ++end;
        const auto [first_slice, end_slice] = slab.slices_of(first, end);
        const SlabSamples samples = window.move_to(first_slice, end_slice);
        slab.plan(samples, first, end);
        const uint64_t left = settings.memory_bytes - slab_bytes(first, end);
        const uint64_t most = std::min({left, settings.memory_bytes / kPieces, kMostPieceBytes});
        for (int64_t part = first, part_end; part < end; part = part_end) {
            part_end = part + 1;
            const auto bytes = [&] { return piece.bytes_of(slab.part_of(part, part_end)); };
            if (bytes() > most) {
                const uint64_t row = piece.row_bytes(slab, part);
                if (row > left) refuse(std::max(slab_bytes(first, first + 1) + row, 2 * row), settings);
                piece.pass_on_rows(slab, samples, part, std::max(most, row));
                continue;
            }
            while (part_end < end) {
                ++part_end;
                if (bytes() <= most) continue;
                --part_end;
                break;
            }
            piece.pass_on(slab, samples, part, part_end, most);
        }
    }
    ContourReport report = slab.report();
    report.least = float(double(report.least) + reference);
    report.greatest = float(double(report.greatest) + reference);
    return report;
}

}  // namespace strata
