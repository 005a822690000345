#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/surface/contour.h"
#include "core/surface/piece_buffer.h"
#include "core/surface/slab_contour.h"

namespace strata {
namespace {

constexpr int64_t kMostLayers = 64;  // of a slab: more gain nothing

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

// Makes pieces of parts of a slab.
class SlabPieces {
public:
    SlabPieces(const ContourSettings& settings, const Vec3d& origin, SurfaceSink& sink) : origin_(origin), sink_(sink), buffer_(settings) {}

    uint64_t bytes_of(const SlabContour::Part& part) const { return buffer_.bytes_of(part.vertices, part.triangles); }

    // Whole layers.
    void pass_on(SlabContour& slab, const SlabSamples& samples, int64_t first, int64_t end, uint64_t most_bytes) {
        const SlabContour::Part part = slab.part_of(first, end);
        if (part.vertices == 0 && part.triangles == 0) return;
        slab.emit(samples, first, end, room_for(part, most_bytes));
        slab.for_isovalues(first, end, [&](size_t isovalue, uint64_t vertices) { buffer_.add_colors(vertices, isovalue); });
        hand_on(part);
    }

    // Rows of a layer that is too large to be one piece: its vertices, then its triangles.
    void pass_on_rows(SlabContour& slab, const SlabSamples& samples, int64_t layer, uint64_t most_bytes) {
        // Others may keep more for a vertex than this: about as many come as with whole layers.
        const uint64_t vertex_bytes = buffer_.bytes_of(1, 2);
        const auto vertices = [&](size_t row) { return slab.vertices_before(layer, row); };
        PieceBuffer::for_pieces(slab.vertex_rows(layer), vertices, vertex_bytes, most_bytes, [&](size_t first, size_t end) {
            const SlabContour::Part part = {.vertices = vertices(end) - vertices(first)};
            slab.emit_vertices(samples, layer, first, end, room_for(part, most_bytes));
            for (size_t row = first; row < end; ++row) buffer_.add_colors(vertices(row + 1) - vertices(row), slab.isovalue_of(row));
            hand_on(part);
        });
        const auto triangles = [&](size_t row) { return slab.triangles_before(layer, row); };
        PieceBuffer::for_pieces(slab.triangle_rows(), triangles, buffer_.bytes_of(0, 1), most_bytes, [&](size_t first, size_t end) {
            const SlabContour::Part part = {.triangles = triangles(end) - triangles(first)};
            slab.emit_triangles(samples, layer, first, end, room_for(part, most_bytes));
            hand_on(part);
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
    ContourTarget room_for(const SlabContour::Part& part, uint64_t most_bytes) {
        buffer_.make_room(part.vertices, part.triangles, most_bytes);
        return {.positions = buffer_.positions(), .normals = buffer_.normals(), .triangles = buffer_.triangles()};
    }
    void hand_on(const SlabContour::Part& part) { buffer_.hand_on(origin_, part.vertices, part.triangles, sink_); }

    Vec3d origin_;
    SurfaceSink& sink_;
    PieceBuffer buffer_;
};

[[noreturn]] void refuse(uint64_t needed, const ContourSettings& settings) {
    throw Error(ErrorKind::limit, "slices of the field and a row of the surface between them need " + std::to_string((needed + settings.memory_beside) * settings.memory_parts) +
                                      " bytes of memory, " + std::to_string((settings.memory_bytes + settings.memory_beside) * settings.memory_parts) + " are allowed");
}

}  // namespace

ContourReport contour_slices(SliceSource& source, const ContourSettings& settings, SurfaceSink& sink) {
    const double reference = settings.isovalues.empty() ? 0.0 : settings.isovalues.front();
    SlabContour slab(source.placement(), source.size(), settings, reference, best_simd_level());
    const int64_t layers = slab.layers();
    SliceWindow window(source, reference);
    SlabPieces pieces(settings, source.placement().origin, sink);
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
        const uint64_t most = PieceBuffer::most_bytes(settings, left);
        for (int64_t part = first, part_end; part < end; part = part_end) {
            part_end = part + 1;
            const auto bytes = [&] { return pieces.bytes_of(slab.part_of(part, part_end)); };
            if (bytes() > most) {
                const uint64_t row = pieces.row_bytes(slab, part);
                if (row > left) refuse(std::max(slab_bytes(first, first + 1) + row, 2 * row), settings);
                pieces.pass_on_rows(slab, samples, part, std::max(most, row));
                continue;
            }
            while (part_end < end) {
                ++part_end;
                if (bytes() <= most) continue;
                --part_end;
                break;
            }
            pieces.pass_on(slab, samples, part, part_end, most);
        }
    }
    ContourReport report = slab.report();
    report.least = float(double(report.least) + reference);
    report.greatest = float(double(report.greatest) + reference);
    return report;
}

}  // namespace strata
