#include "core/octree/node_sampling.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/math/random.h"

namespace strata {

NodeSampler::NodeSampler(const OctreeFrame& frame)
    : frame_(frame), occupied_(size_t(kCells) * kCells * kRowBytes, 0), first_in_cell_(size_t(kCells) * kCells * kCells) {}

void NodeSampler::start(const NodeKey& node) {
    for (const Kept& kept : kept_) {
        const Cell cell(kept.p);
        occupied_[cell.row() * kRowBytes + size_t(cell.x) / 8] = 0;
    }
    kept_.clear();
    level_ = node.level;
    spacings_per_quantum_ = frame_.scale / frame_.spacing(node.level);
    corner_ = Vec3d(node.x, node.y, node.z) * kSpacingsPerSide;
}

Vec3f NodeSampler::in_spacings(const Vec3i& p_quanta) const {
    return (p_quanta.cast<double>().cwiseProduct(spacings_per_quantum_) - corner_).cast<float>();
}

void NodeSampler::insert(const Vec3f& p, float distance_squared) {
    const Cell cell(p);
    uint8_t& bits = occupied_[cell.row() * kRowBytes + size_t(cell.x) / 8];
    const uint8_t bit = uint8_t(1u << cell.x % 8);
    uint32_t& first = first_in_cell_[cell.index()];
    kept_.push_back({p, distance_squared, bits & bit ? first : kNone});
    first = uint32_t(kept_.size()) - 1;
    bits |= bit;
}

void NodeSampler::add_seed(const Vec3i& p_quanta, uint32_t kept_level) {
    const Vec3f p = in_spacings(p_quanta);
    const float distance = kept_level <= level_ ? 1.0f : std::ldexp(1.0f, int(level_) - int(kept_level));
    if ((p.array() > -distance).all() && (p.array() < float(kSpacingsPerSide) + distance).all()) insert(p, distance * distance);
}

bool NodeSampler::near_faces(const Vec3i& p_quanta) const {
    const Vec3f p = in_spacings(p_quanta);
    return (p.array() < 1.0f).any() || (p.array() > float(kSpacingsPerSide) - 1.0f).any();
}

bool NodeSampler::any_within_spacing(const Vec3f& p, size_t cell) const {
    for (uint32_t at = first_in_cell_[cell]; at != kNone; at = kept_[at].next)
        if ((kept_[at].p - p).squaredNorm() < kept_[at].distance_squared) return true;
    return false;
}

bool NodeSampler::has_close_neighbour(const Vec3f& p) const {
    // The occupancy of the 27 cells around as one mask, gathered without branches: what is left to guess for the
    // processor is how many cells are occupied and which decides.
    const Cell cell(p);
    const uint8_t* bytes = occupied_.data() + cell.row() * kRowBytes + size_t(cell.x - 1) / 8;
    const int shift = (cell.x - 1) % 8;
    uint32_t mask = 0;
    for (int row = 0; row < 9; ++row) {
        uint16_t bits;
        std::memcpy(&bits, bytes + (ptrdiff_t(row / 3 - 1) * kCells + (row % 3 - 1)) * ptrdiff_t(kRowBytes), sizeof bits);
        mask |= uint32_t(bits >> shift & 7) << 3 * row;
    }
    constexpr uint32_t kOwnCell = 1u << 13;
    const size_t own = cell.index();
    if (mask & kOwnCell && any_within_spacing(p, own)) return true;
    for (mask &= ~kOwnCell; mask != 0; mask &= mask - 1) {
        const int bit = std::countr_zero(mask);
        const ptrdiff_t row = ptrdiff_t(bit / 9 - 1) * kCells + (bit / 3 % 3 - 1);
        if (any_within_spacing(p, own + size_t(row * kCells + bit % 3 - 1))) return true;
    }
    return false;
}

void NodeSampler::sample(std::span<const Vec3i> positions, std::vector<uint32_t>& kept) {
    kept.clear();
    candidates_.resize(positions.size());
    is_kept_.assign(positions.size(), false);
    for (size_t i = 0; i < positions.size(); ++i) candidates_[i] = in_spacings(positions[i]);
    const auto visit = [&](uint32_t i) {
        if (is_kept_[i] || has_close_neighbour(candidates_[i])) return;
        insert(candidates_[i], 1.0f);
        is_kept_[i] = true;
    };
    // A random permutation without a table: a bijection of the numbers below the next power of two, those beyond n
    // left out. Multiplying by odd numbers and shifting right are both invertible there.
    const uint32_t bits = uint32_t(std::bit_width(std::max<size_t>(positions.size(), 2) - 1));
    const uint32_t mask = uint32_t((uint64_t{1} << bits) - 1);
    const uint32_t half = (bits + 1) / 2;
    // So many random darts fill a surface; the rest, in the order of memory, finds the gaps that are left.
    constexpr uint64_t kRandomDarts = 1 << 16;
    for (uint64_t turn = 0; turn <= mask && turn < kRandomDarts; ++turn) {
        uint32_t i = uint32_t(turn);
        i = (i * 0x9e3779b1u) & mask;
        i ^= i >> half;
        i = (i * 0x85ebca6bu) & mask;
        i ^= i >> half;
        i = (i * 0xc2b2ae35u) & mask;
        if (i < positions.size()) visit(i);
    }
    if (mask >= kRandomDarts)
        for (uint32_t i = 0; i < positions.size(); ++i) visit(i);
    for (uint32_t i = 0; i < positions.size(); ++i)
        if (is_kept_[i]) kept.push_back(i);
}

}  // namespace strata
