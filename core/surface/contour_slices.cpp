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
    PieceBuffer(const ContourSettings& settings, const Vec3d& origin) : settings_(settings), origin_(origin) {}

    static uint64_t bytes_of(const SlabContour::Part& part, const ContourSettings& settings) {
        const uint64_t vertex = sizeof(Vec3f) * (settings.normals ? 2 : 1) + (settings.colors.empty() ? 0 : sizeof settings.colors[0]);
        return part.vertices * vertex + part.triangles * sizeof(std::array<uint32_t, 3>);
    }

    void pass_on(SlabContour& slab, const SlabSamples& samples, int64_t first, int64_t end, SurfaceSink& sink) {
        const SlabContour::Part part = slab.part_of(first, end);
        if (part.vertices == 0 && part.triangles == 0) return;
        reserve(positions_, part.vertices);
        reserve(triangles_, part.triangles);
        if (settings_.normals) reserve(normals_, part.vertices);
        slab.emit(samples, first, end, {.positions = positions_.data(), .normals = normals_.data(), .triangles = triangles_.data()});
        colors_.clear();
        if (!settings_.colors.empty())
            slab.for_isovalues(first, end, [&](size_t isovalue, uint64_t vertices) {
                colors_.insert(colors_.end(), size_t(vertices), settings_.colors[isovalue]);
            });
        const auto vertices = size_t(part.vertices);
        sink.add({.origin = origin_,
                  .positions = {positions_.data(), vertices},
                  .normals = {normals_.data(), settings_.normals ? vertices : 0},
                  .colors = colors_,
                  .triangles = {triangles_.data(), size_t(part.triangles)},
                  .quads = {}});
    }

private:
    template <typename T>
    static void reserve(LargeArray<T>& array, uint64_t size) {
        if (array.size() < size) array = LargeArray<T>(size_t(size));
    }

    const ContourSettings& settings_;
    Vec3d origin_;
    LargeArray<Vec3f> positions_, normals_;
    LargeArray<std::array<uint32_t, 3>> triangles_;
    std::vector<std::array<uint8_t, 4>> colors_;
};

[[noreturn]] void refuse(uint64_t needed, uint64_t given) {
    throw Error(ErrorKind::limit, "slices of the field and the surface between them need " + std::to_string(needed) + " bytes of memory, " +
                                      std::to_string(given) + " are allowed");
}

}  // namespace

ContourReport contour_slices(SliceSource& source, const ContourSettings& settings, SurfaceSink& sink) {
    const double reference = settings.isovalues.empty() ? 0.0 : settings.isovalues.front();
    SlabContour slab(source.placement(), source.size(), settings, reference, best_simd_level());
    const int64_t layers = slab.layers();
    SliceWindow window(source, reference);
    PieceBuffer piece(settings, source.placement().origin);
    const auto [columns, rows, slices] = source.size();
    constexpr uint64_t kMostSamples = uint64_t{1} << 48;  // a slice: byte counts of a slab do not overflow
    if (uint64_t{columns} * rows > kMostSamples) refuse(std::numeric_limits<uint64_t>::max(), settings.memory_bytes);
    const uint64_t slice_bytes = uint64_t{columns} * rows * sizeof(float);
    const auto slab_bytes = [&](int64_t first, int64_t end) {
        const auto [first_slice, end_slice] = slab.slices_of(first, end);
        return uint64_t(end_slice - first_slice) * slice_bytes + slab.plan_bytes(end - first);
    };

    for (int64_t first = 0, end; first < layers; first = end) {
        end = first + 1;
        if (slab_bytes(first, end) > settings.memory_bytes) refuse(slab_bytes(first, end), settings.memory_bytes);
        // Half of the memory is for the surface.
        while (end < layers && end - first < kMostLayers && slab_bytes(first, end + 1) <= settings.memory_bytes / 2) ++end;
        const auto [first_slice, end_slice] = slab.slices_of(first, end);
        const SlabSamples samples = window.move_to(first_slice, end_slice);
        slab.plan(samples, first, end);
        const uint64_t left = settings.memory_bytes - slab_bytes(first, end);
        for (int64_t part = first, part_end; part < end; part = part_end) {
            part_end = part + 1;
            const auto bytes = [&] { return PieceBuffer::bytes_of(slab.part_of(part, part_end), settings); };
            if (bytes() > left) refuse(std::max(slab_bytes(first, first + 1) + bytes(), 2 * bytes()), settings.memory_bytes);
            while (part_end < end) {
                ++part_end;
                if (bytes() <= left) continue;
                --part_end;
                break;
            }
            piece.pass_on(slab, samples, part, part_end, sink);
        }
    }
    ContourReport report = slab.report();
    report.least = float(double(report.least) + reference);
    report.greatest = float(double(report.greatest) + reference);
    return report;
}

}  // namespace strata
