#include "core/surface/grid_at_vertices.h"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <limits>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 4096;  // vertices a thread takes at a time

// Places that are half a step beyond a grid but for rounding are still its own: there a closed surface ends.
constexpr double kReach = 0.5 + 0x1p-10;

// Steps by which rounding lets a vertex come after those of the next slice.
constexpr double kLate = 0x1p-10;

// Moves an index onto the grid; false: it is too far away.
bool clamp_to(const std::array<uint32_t, 3>& size, Vec3d& index) {
    for (int axis = 0; axis < 3; ++axis) {
        const double last = double(size[size_t(axis)]) - 1.0;
        if (!(index[axis] >= -kReach && index[axis] <= last + kReach)) return false;
        index[axis] = std::clamp(index[axis], 0.0, last);
    }
    return true;
}

}  // namespace

PlacesInGrid::PlacesInGrid(const GridPlacement& placement) : origin_(placement.origin), from_world_(placement.axes.inverse()), reach_(from_world_.cwiseAbs()) {}

Vec3d PlacesInGrid::index_of(const Vec3d& origin, const Vec3f& position) const {
    const Vec3d place = position.cast<double>();
    Vec3d index = from_world_ * (origin - origin_ + place);
    // A float is rounded by 2^-24 of itself and a few of them make an index; a difference of doubles by 2^-53.
    const Vec3d rounding = reach_ * (0x1p-22 * place.cwiseAbs() + 0x1p-50 * (origin.cwiseAbs() + origin_.cwiseAbs()));
    for (int axis = 0; axis < 3; ++axis)
        if (const double nearest = std::round(index[axis]); std::abs(index[axis] - nearest) <= rounding[axis]) index[axis] = nearest;
    return index;
}

SlicesAtVertices::SlicesAtVertices(SliceSource& source, int threads) : source_(source), places_(source.placement()), threads_(threads) {
    for (std::vector<float>& slice : held_) slice.resize(size_t{source.size()[0]} * source.size()[1]);
}

void SlicesAtVertices::move_to(uint32_t slice) {
    const uint32_t end = std::min(slice + 2, source_.size()[2]);
    while (read_ < end) {
        std::swap(held_[0], held_[1]);
        source_.read(1, 0.0, held_[1]);
        slice_ = read_++;  // of held_[1]
    }
}

void SlicesAtVertices::look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) {
    const std::array<uint32_t, 3> size = source_.size();
    indices_.resize(positions.size());
    parallel_blocks(threads_, positions.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            if (indices_[i] = places_.index_of(origin, positions[i]); !clamp_to(size, indices_[i])) indices_[i].setConstant(-1.0);
    });
    for (size_t first = 0, end; first < positions.size(); first = end) {
        // Those between the same two slices, or before: by rounding some come late.
        const auto slice_of = [&](size_t i) { return indices_[i].z() < 0.0 ? 0.0 : std::floor(indices_[i].z()); };
        const double slice = slice_of(first);
        end = first + 1;
        while (end < positions.size() && slice_of(end) <= slice) ++end;
        move_to(uint32_t(slice));
        // held_[1] is slice_, held_[0] the one before.
        const double least = slice_ == 0 ? 0.0 : double(slice_) - 1.0;
        parallel_blocks(threads_, end - first, kBlock, [&](size_t from, size_t to) {
            for (size_t i = first + from; i < first + to; ++i) {
                Vec3d index = indices_[i];
                if (index.z() < 0.0) {
                    out[i] = std::numeric_limits<float>::quiet_NaN();
                    continue;
                }
                assert(index.z() >= least - kLate);  // its slices have not gone
                index.z() = std::max(index.z(), least);
                out[i] = trilinear_at(index, [&](int64_t x, int64_t y, int64_t z) { return held_[z == int64_t{slice_}][size_t(y) * size[0] + size_t(x)]; });
            }
        });
    }
}

void SlicesAtVertices::finish() {
    while (read_ < source_.size()[2]) {
        source_.read(1, 0.0, held_[1]);
        slice_ = read_++;
    }
}

GridAtVertices::GridAtVertices(SliceSource& source, uint64_t memory_bytes, int threads) : size_(source.size()), places_(source.placement()), threads_(threads) {
    const uint64_t slice = uint64_t{size_[0]} * size_[1], most = memory_bytes / sizeof(float);
    if (slice == 0 || slice > most || size_[2] > most / slice)
        throw Error(ErrorKind::limit, std::to_string(size_[0]) + " x " + std::to_string(size_[1]) + " x " + std::to_string(size_[2]) +
                                          " values that lie otherwise than the volume's must be held in memory, and " + std::to_string(memory_bytes) + " bytes are allowed");
    values_.resize(size_t(slice * size_[2]));
    for (uint32_t k = 0; k < size_[2]; ++k) source.read(1, 0.0, std::span(values_).subspan(size_t(k * slice), size_t(slice)));
}

void GridAtVertices::look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) {
    parallel_blocks(threads_, positions.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            Vec3d index = places_.index_of(origin, positions[i]);
            if (!clamp_to(size_, index)) out[i] = std::numeric_limits<float>::quiet_NaN();
            else out[i] = trilinear_at(index, [&](int64_t x, int64_t y, int64_t z) { return values_[(size_t(z) * size_[1] + size_t(y)) * size_[0] + size_t(x)]; });
        }
    });
}

bool is_same_grid(const SliceSource& a, const SliceSource& b) {
    if (a.size() != b.size()) return false;
    const Mat3d from_world = a.placement().axes.inverse();
    for (int corner = 0; corner < 8; ++corner) {
        Vec3d index;
        for (int axis = 0; axis < 3; ++axis) index[axis] = corner >> axis & 1 ? double(a.size()[size_t(axis)]) : 0.0;
        const Vec3d there = from_world * (b.placement().world_from_index(index) - a.placement().origin);
        if (!((there - index).cwiseAbs().maxCoeff() <= 1e-4)) return false;
    }
    return true;
}

}  // namespace strata
