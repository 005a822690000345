#include "core/cloud/point_spacing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/cloud/neighbor_search.h"
#include "core/math/random.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr uint32_t kNeighbors = 12;
constexpr double kMostPoints = 1 << 20, kMeasured = 4096;

// Uniform in [0, 1), the same for the same point of a source.
double chance(uint64_t batch, uint64_t point, uint64_t purpose) { return double(mix_bits(mix_bits(batch << 32 ^ point) + purpose) >> 11) * 0x1p-53; }

}  // namespace

std::vector<double> measure_point_spacings(const PointSource& source, const Box3d& bounds, int threads) {
    const CloudInfo& info = source.info();
    const double share = std::min(1.0, kMostPoints / double(std::max<uint64_t>(info.points, 1)));
    std::vector<std::vector<Vec3i>> chosen(size_t(source.batch_count()));
    parallel_blocks(threads, chosen.size(), 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t b = begin; b < end; ++b) {
            source.read_batch(b, {}, batch);
            for (size_t i = 0; i < batch.size; ++i) {
                const Vec3i place(batch.x[i], batch.y[i], batch.z[i]);
                if (chance(b, i, 0) < share && bounds.contains(info.quantization.world_from_quanta(place))) chosen[b].push_back(place);
            }
        }
    });
    std::vector<TreePoint> points;
    for (const std::vector<Vec3i>& some : chosen)
        for (const Vec3i& place : some) points.push_back({place, uint32_t(points.size())});
    if (points.size() < 4) return {};
    const auto neighbors = uint32_t(std::min<size_t>(kNeighbors, points.size() - 1));
    std::vector<Vec3i> measured;
    const double measured_share = kMeasured / double(points.size());
    for (size_t i = 0; i < points.size(); ++i)
        if (chance(i, 0, 1) < measured_share) measured.push_back(points[i].position);
    const NeighborTree tree(std::move(points), info.quantization.scale);
    std::vector<double> spacings(measured.size());
    parallel_blocks(threads, measured.size(), 64, [&](size_t begin, size_t end) {
        NeighborSearch search(tree, neighbors + 1);  // the point itself is one
        for (size_t i = begin; i < end; ++i) spacings[i] = std::sqrt(search.nearest(measured[i]).radius_squared * std::numbers::pi / double(neighbors) * share);
    });
    std::sort(spacings.begin(), spacings.end());
    return spacings;
}

}  // namespace strata
