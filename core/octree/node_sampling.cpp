#include "core/octree/node_sampling.h"

#include <algorithm>
#include <bit>

#include "core/math/random.h"

namespace strata {

NodeSampler::NodeSampler(const OctreeFrame& frame) : frame_(frame), first_in_cell_(size_t(kCells) * kCells * kCells, 0) {}

void NodeSampler::start(const NodeKey& node) {
    for (const Kept& kept : kept_) first_in_cell_[cell_of(kept.p)] = 0;
    kept_.clear();
    spacings_per_quantum_ = frame_.scale / frame_.spacing(node.level);
    corner_ = Vec3d(node.x, node.y, node.z) * kSpacingsPerSide;
}

Vec3f NodeSampler::in_spacings(const Vec3i& p_quanta) const {
    return (p_quanta.cast<double>().cwiseProduct(spacings_per_quantum_) - corner_).cast<float>();
}

size_t NodeSampler::cell_of(const Vec3f& p) {
    const int x = int(p.x() + float(kMargin)), y = int(p.y() + float(kMargin)), z = int(p.z() + float(kMargin));
    return (size_t(z) * kCells + size_t(y)) * kCells + size_t(x);
}

void NodeSampler::insert(const Vec3f& p) {
    uint32_t& first = first_in_cell_[cell_of(p)];
    kept_.push_back({p, first});
    first = uint32_t(kept_.size());
}

void NodeSampler::add_seed(const Vec3i& p_quanta) {
    const Vec3f p = in_spacings(p_quanta);
    if ((p.array() > -1.0f).all() && (p.array() < float(kSpacingsPerSide) + 1.0f).all()) insert(p);
}

bool NodeSampler::near_faces(const Vec3i& p_quanta) const {
    const Vec3f p = in_spacings(p_quanta);
    return (p.array() < 1.0f).any() || (p.array() > float(kSpacingsPerSide) - 1.0f).any();
}

bool NodeSampler::any_within_spacing(const Vec3f& p, uint32_t first) const {
    for (uint32_t at = first; at != 0; at = kept_[at - 1].next)
        if ((kept_[at - 1].p - p).squaredNorm() < 1.0f) return true;
    return false;
}

bool NodeSampler::has_close_neighbour(const Vec3f& p) const {
    const uint32_t* cell = first_in_cell_.data() + cell_of(p);
    if (any_within_spacing(p, *cell)) return true;
    const float y_part = p.y() - std::floor(p.y()), z_part = p.z() - std::floor(p.z());
    const float y_gap[3] = {y_part, 0.0f, 1.0f - y_part}, z_gap[3] = {z_part, 0.0f, 1.0f - z_part};
    for (int dz = -1; dz <= 1; ++dz)
        for (int dy = -1; dy <= 1; ++dy) {
            const float gap_squared = y_gap[dy + 1] * y_gap[dy + 1] + z_gap[dz + 1] * z_gap[dz + 1];
            if (gap_squared >= 1.0f) continue;
            const uint32_t* row = cell + (ptrdiff_t(dz) * kCells + dy) * kCells;
            if (row[-1] && any_within_spacing(p, row[-1])) return true;
            if (row[0] && any_within_spacing(p, row[0])) return true;
            if (row[1] && any_within_spacing(p, row[1])) return true;
        }
    return false;
}

void NodeSampler::sample(std::span<const Vec3i> positions, std::vector<uint32_t>& kept) {
    kept.clear();
    candidates_.resize(positions.size());
    for (size_t i = 0; i < positions.size(); ++i) candidates_[i] = in_spacings(positions[i]);
    // A random permutation without a table: a bijection of the numbers below the next power of two, those beyond n
    // left out. Multiplying by odd numbers and shifting right are both invertible there.
    const uint32_t bits = uint32_t(std::bit_width(std::max<size_t>(positions.size(), 2) - 1));
    const uint32_t mask = uint32_t((uint64_t{1} << bits) - 1);
    const uint32_t half = (bits + 1) / 2;
    for (uint64_t turn = 0; turn <= mask; ++turn) {
        uint32_t i = uint32_t(turn);
        i = (i * 0x9e3779b1u) & mask;
        i ^= i >> half;
        i = (i * 0x85ebca6bu) & mask;
        i ^= i >> half;
        i = (i * 0xc2b2ae35u) & mask;
        if (i >= positions.size() || has_close_neighbour(candidates_[i])) continue;
        insert(candidates_[i]);
        kept.push_back(i);
    }
    std::sort(kept.begin(), kept.end());
}

}  // namespace strata
