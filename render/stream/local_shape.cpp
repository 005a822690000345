#include "render/stream/local_shape.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>

#include <Eigen/Eigenvalues>

#include "core/math/morton.h"

namespace strata {
namespace {

constexpr int kSide = ShapeGrid::kSide;
constexpr size_t kCells = size_t(kSide) * kSide * kSide;
constexpr int kFineBits = 7;  // 128 cells an axis: an inner node's points lie one such cell apart
constexpr int kFine = 1 << kFineBits;
constexpr int kScales = 5;    // cell sides 1, 2, 4, 8, 16 fine cells; the last is that of the answer's cells

// Where the number of occupied cells grows by this factor from one scale to the next finer one, random points have one a
// cell: 4 (1 - e^-1) / (1 - e^-4). Lines reach 2 at most, surfaces 4.
constexpr float kFilledSurface = 2.575f;
constexpr float kFilledLine = 1.46f;  // the same for a line: 2 (1 - e^-1) / (1 - e^-2)

// Points at random, one a cell of the spacing, leave e^-(pi f^2) of a surface open when drawn as discs of radius f spacings:
// 0.1 % at one and a half. Where they lie in a plane such discs hide nothing, since each pixel shows the nearest
// center; in foliage they would, and there it is the gaps that look right.
constexpr float kPlaneOverlap = 1.5f;
constexpr float kBushOverlap = 1.0f;
constexpr float kRegular = 1.35f;  // measured below this times the sampling rule's spacing, points are as even as the rule makes them

// Which fine cells hold points, in Morton order: a coarser cell is a run of 8^n bits.
class Occupancy {
public:
    Occupancy() : words_(size_t(kFine) * kFine * kFine / 64, 0) {}

    void mark(const std::array<int, 3>& cell) {
        const uint64_t code = octant_code(uint32_t(cell[0]), uint32_t(cell[1]), uint32_t(cell[2]));
        words_[code / 64] |= uint64_t{1} << code % 64;
    }

    /// Occupied cells of each scale in one cell of the answer.
    std::array<float, kScales> count(int x, int y, int z) const {
        constexpr uint32_t kWords = 64;  // 16^3 fine cells
        const uint64_t code = octant_code(uint32_t(x), uint32_t(y), uint32_t(z));
        const uint64_t* fine = words_.data() + size_t(code) * kWords;
        uint32_t counts[kScales] = {};
        uint64_t second[kWords / 8] = {};
        for (uint32_t i = 0; i < kWords; ++i) {
            if (fine[i] == 0) continue;
            counts[0] += uint32_t(std::popcount(fine[i]));
            second[i / 8] |= uint64_t{bytes_with_bits(fine[i])} << i % 8 * 8;
        }
        uint64_t third = 0;
        for (uint32_t i = 0; i < kWords / 8; ++i) {
            if (second[i] == 0) continue;
            counts[1] += uint32_t(std::popcount(second[i]));
            third |= uint64_t{bytes_with_bits(second[i])} << i * 8;
        }
        const uint8_t fourth = bytes_with_bits(third);
        counts[2] = uint32_t(std::popcount(third));
        counts[3] = uint32_t(std::popcount(fourth));
        counts[4] = fourth != 0;
        std::array<float, kScales> result;
        std::copy(std::begin(counts), std::end(counts), result.begin());
        return result;
    }

private:
    // Bit i of the result: byte i is not zero.
    static uint8_t bytes_with_bits(uint64_t word) {
        word |= word >> 4;
        word |= word >> 2;
        word |= word >> 1;
        return uint8_t((word & 0x0101010101010101u) * 0x0102040810204080u >> 56);
    }

    std::vector<uint64_t> words_;
};

using Counts = std::array<std::array<float, kScales>, kCells>;

// Sums over the 3 x 3 x 3 cells around each, an axis at a time.
void sum_neighbors(Counts& counts) {
    constexpr int kStride[3] = {kSide * kSide, kSide, 1};
    for (const int stride : kStride) {
        const Counts before = counts;
        for (int i = 0; i < int(kCells); ++i) {
            const int at = i / stride % kSide;
            for (size_t scale = 0; scale < kScales; ++scale) {
                if (at > 0) counts[size_t(i)][scale] += before[size_t(i - stride)][scale];
                if (at < kSide - 1) counts[size_t(i)][scale] += before[size_t(i + stride)][scale];
            }
        }
    }
}

// The side, in fine cells, from which on the ratio of occupied cells stays at `filled`; 0 where it never does. One scale
// is not enough where there is a next one: a few lines side by side look like a surface at one.
float filled_side(const std::array<float, kScales>& occupied, float points, float filled) {
    constexpr float kSlack = 0.7f;  // edges of surfaces let the ratio fall a little
    std::array<float, kScales - 1> ratios;
    for (size_t scale = 0; scale + 1 < kScales; ++scale) ratios[scale] = occupied[scale] / occupied[scale + 1];
    for (size_t scale = 0; scale < ratios.size(); ++scale) {
        if (ratios[scale] < filled || (scale + 1 < ratios.size() && ratios[scale + 1] < kSlack * filled)) continue;
        const float side = float(1 << scale);
        // Finer than the cells: points a cell tell how much. Else between this scale and the one before.
        if (scale == 0) return side / std::sqrt(std::max(points / occupied[0], 1.0f));
        const float before = std::min(ratios[scale - 1], filled);
        return 0.5f * side * std::exp2((filled - before) / (ratios[scale] - before));
    }
    return 0.0f;
}

// Sums over points, for the plane they lie in. Positions count from the grid's corner in cells, so doubles hold them exactly enough.
struct Moments {
    double n = 0.0;
    Vec3d sum = Vec3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();

    void add(const Vec3d& p) {
        n += 1.0;
        sum += p;
        squares += p * p.transpose();
    }
    void add(const Moments& other) {
        n += other.n;
        sum += other.sum;
        squares += other.squares;
    }
};

// The normal of the plane that the points lie in, zero where they lie in none.
std::array<int8_t, 3> normal_of(const Moments& moments) {
    constexpr double kLeastPoints = 8.0;
    constexpr double kFlat = 0.06;    // variance across over the lesser one along: a sixteenth
    constexpr double kBroad = 0.02;   // lesser variance along over the greater one: below, it is a line
    if (moments.n < kLeastPoints) return {};
    const Vec3d mean = moments.sum / moments.n;
    const Eigen::Matrix3d covariance = moments.squares / moments.n - mean * mean.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance);
    const Vec3d& variance = solver.eigenvalues();
    if (!(variance[0] <= kFlat * variance[1] && variance[1] >= kBroad * variance[2] && variance[1] > 0.0)) return {};
    const Vec3d normal = 127.0 * solver.eigenvectors().col(0);
    return {int8_t(std::lround(normal.x())), int8_t(std::lround(normal.y())), int8_t(std::lround(normal.z()))};
}

Moments sum_around(const std::vector<Moments>& moments, int x, int y, int z) {
    Moments sum;
    for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, kSide - 1); ++nx)
        for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, kSide - 1); ++ny)
            for (int nz = std::max(z - 1, 0); nz <= std::min(z + 1, kSide - 1); ++nz) sum.add(moments[ShapeGrid::index(nx, ny, nz)]);
    return sum;
}

}  // namespace

ShapeGrid measure_local_shape(const ResidentNode& node, std::span<const ResidentNode* const> ancestors,
                              const Vec3d& scale, const SpacingLimits& limits) {
    if (node.size() == 0) return {};
    std::array<double, 3> extent;
    for (int axis = 0; axis < 3; ++axis)
        extent[size_t(axis)] = double(int64_t{node.max_quanta[axis]} - node.min_quanta[axis]) * scale[axis];
    const double side = *std::max_element(extent.begin(), extent.end()) * (1.0 + 1e-6);
    if (!(side > 0.0)) return {};

    ShapeGrid grid;
    grid.cells.resize(kCells);
    Vec3d fine_per_quantum;
    for (int axis = 0; axis < 3; ++axis) {
        grid.origin[size_t(axis)] = node.min_quanta[axis];
        grid.cells_per_quantum[size_t(axis)] = float(kSide * scale[axis] / side);
        fine_per_quantum[axis] = kFine * scale[axis] / side;
    }

    auto occupancy = std::make_unique<Occupancy>();
    std::vector<Moments> moments(kCells);
    const auto mark = [&](const ResidentNode& from) {
        for (size_t i = 0; i < from.size(); ++i) {
            const Vec3i p_quanta(from.x[i], from.y[i], from.z[i]);
            if ((p_quanta.array() < node.min_quanta.array()).any() || (p_quanta.array() > node.max_quanta.array()).any()) continue;
            Vec3d p;
            std::array<int, 3> cell;
            for (int axis = 0; axis < 3; ++axis) {
                p[axis] = double(int64_t{p_quanta[axis]} - node.min_quanta[axis]) * fine_per_quantum[axis];
                cell[size_t(axis)] = std::min(int(p[axis]), kFine - 1);
            }
            occupancy->mark(cell);
            constexpr int kShift = kFineBits - 3;
            moments[ShapeGrid::index(cell[0] >> kShift, cell[1] >> kShift, cell[2] >> kShift)].add(p);
        }
    };
    mark(node);
    for (const ResidentNode* ancestor : ancestors) mark(*ancestor);

    auto own = std::make_unique<Counts>(Counts{});
    for (int x = 0; x < kSide; ++x)
        for (int y = 0; y < kSide; ++y)
            for (int z = 0; z < kSide; ++z)
                if (const size_t i = ShapeGrid::index(x, y, z); moments[i].n > 0.0) (*own)[i] = occupancy->count(x, y, z);
    auto counts = std::make_unique<Counts>(*own);
    sum_neighbors(*counts);
    const float fine_side = float(side / kFine);
    for (int x = 0; x < kSide; ++x)
        for (int y = 0; y < kSide; ++y)
            for (int z = 0; z < kSide; ++z) {
                const size_t i = ShapeGrid::index(x, y, z);
                const std::array<float, kScales>& around = (*counts)[i];
                if (moments[i].n == 0.0) continue;
                const float points = float(moments[i].n) / (*own)[i][0] * around[0];  // at the density of the cell itself
                float filled = filled_side(around, points, kFilledSurface);
                if (filled == 0.0f) filled = filled_side(around, points, kFilledLine);
                PointShape& shape = grid.cells[i];
                shape.normal = normal_of(moments[i]);
                if (!shape.flat()) shape.normal = normal_of(sum_around(moments, x, y, z));
                const float spacing = filled > 0.0f ? filled * fine_side : limits.alone;
                const float overlap = shape.flat() ? kPlaneOverlap : kBushOverlap;
                shape.spacing = spacing < kRegular * limits.least ? limits.least : std::clamp(overlap * spacing, limits.least, limits.most);
            }
    return grid;
}

}  // namespace strata
