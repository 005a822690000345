#include "core/octree/node_sampling.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/math/random.h"

namespace strata {
namespace {

// A bijection of the numbers of `bits` bits that looks random: multiplying by odd numbers and folding high bits into
// low ones are both invertible there.
uint32_t shuffled(uint32_t i, uint32_t bits) {
    const uint32_t mask = (1u << bits) - 1;
    i = (i * 0x9e3779b1u) & mask;
    i ^= i >> (bits + 1) / 2;
    i = (i * 0x85ebca6bu) & mask;
    i ^= i >> (bits + 1) / 2;
    return (i * 0xc2b2ae35u) & mask;
}

}  // namespace

NodeSampler::NodeSampler(const OctreeFrame& frame)
    : frame_(frame),
      occupied_(size_t(kCells) * kCells * kRowBytes, 0),
      first_in_cell_(size_t(kCells) * kCells * kCells) {}

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
    if ((p.array() > -distance).all() && (p.array() < float(kSpacingsPerSide) + distance).all())
        insert(p, distance * distance);
}

bool NodeSampler::near_faces(const Vec3i& p_quanta) const {
    const Vec3f p = in_spacings(p_quanta);
    return (p.array() < 1.0f).any() || (p.array() > float(kSpacingsPerSide) - 1.0f).any();
}

uint32_t NodeSampler::find_close_in(const Vec3f& p, size_t cell) const {
    for (uint32_t at = first_in_cell_[cell]; at != kNone; at = kept_[at].next)
        if (is_close(p, kept_[at])) return at;
    return kNone;
}

uint32_t NodeSampler::find_close(const Vec3f& p) const {
    const Cell cell(p);
    const uint8_t* bytes = occupied_.data() + cell.row() * kRowBytes + size_t(cell.x - 1) / 8;
    const int shift = (cell.x - 1) % 8;
    const auto row_bits = [&](int dy, int dz) {
        uint16_t bits;
        std::memcpy(&bits, bytes + (ptrdiff_t(dz) * kCells + dy) * ptrdiff_t(kRowBytes), sizeof bits);
        return uint32_t(bits >> shift & 7);
    };
    const size_t own = cell.index();
    const uint32_t own_row = row_bits(0, 0);
    if (own_row & 2)
        if (const uint32_t found = find_close_in(p, own); found != kNone) return found;
    // The occupancy of the cells around as one mask, gathered without branches: what is left to guess for the processor
    // is how many cells are occupied and which decides.
    uint32_t mask = (own_row & 5) << 12;
    for (int row = 0; row < 9; ++row)
        if (row != 4) mask |= row_bits(row % 3 - 1, row / 3 - 1) << 3 * row;
    for (; mask != 0; mask &= mask - 1) {
        const int bit = std::countr_zero(mask);
        const ptrdiff_t row = ptrdiff_t(bit / 9 - 1) * kCells + (bit / 3 % 3 - 1);
        if (const uint32_t found = find_close_in(p, own + size_t(row * kCells + bit % 3 - 1)); found != kNone)
            return found;
    }
    return kNone;
}

// The nearest whole quantum to the node's corner is subtracted as an integer, so that floats hold the rest.
void NodeSampler::convert(int axis, std::span<const int32_t> quanta) {
    const double spacings_per_quantum = spacings_per_quantum_[axis];
    const int32_t base = int32_t(std::floor(corner_[axis] / spacings_per_quantum));
    const float factor = float(spacings_per_quantum), rest = float(base * spacings_per_quantum - corner_[axis]);
    std::vector<float>& out = candidates_[size_t(axis)];
    out.resize(quanta.size());
    for (size_t i = 0; i < quanta.size(); ++i) out[i] = std::max(float(quanta[i] - base) * factor + rest, 0.0f);
}

// Refuses whole blocks of candidates from `begin` on that are all close to one kept point. Returns where it stopped.
size_t NodeSampler::refuse_run(size_t begin, const Kept& kept) {
    constexpr size_t kBlock = 16;
    const float *x = candidates_[0].data(), *y = candidates_[1].data(), *z = candidates_[2].data();
    const float kx = kept.p.x(), ky = kept.p.y(), kz = kept.p.z(), limit = kept.distance_squared;
    for (; begin + kBlock <= states_.size(); begin += kBlock) {
        int close = 0;  // counted rather than left early: this becomes a few vector instructions
        for (size_t i = begin; i < begin + kBlock; ++i) {
            const float dx = x[i] - kx, dy = y[i] - ky, dz = z[i] - kz;
            close += dx * dx + dy * dy + dz * dz < limit;
        }
        if (close < int(kBlock)) break;
        for (size_t i = begin; i < begin + kBlock; ++i)  // the kept point itself may be one of them
            states_[i] = states_[i] == State::kept ? State::kept : State::refused;
    }
    return begin;
}

void NodeSampler::sample(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z,
                         std::vector<uint32_t>& kept) {
    kept.clear();
    const size_t n = x.size();
    convert(0, x);
    convert(1, y);
    convert(2, z);
    states_.assign(n, State::open);
    uint32_t last_close = kNone;  // what was too close to the last one is often too close to its neighbour
    int run = 0;                  // how often in a row it was
    const auto visit = [&](size_t i) {
        if (states_[i] != State::open) return;
        const Vec3f p(candidates_[0][i], candidates_[1][i], candidates_[2][i]);
        states_[i] = State::refused;
        if (last_close != kNone && is_close(p, kept_[last_close])) return void(++run);
        run = 0;
        const uint32_t found = find_close(p);
        if (found == kNone) {
            insert(p, 1.0f);
            states_[i] = State::kept;
        } else {
            last_close = found;
        }
    };
    // The order of darts matters only among neighbours, and positions come in an order that keeps neighbours together:
    // so they are shuffled in windows that stay in cache with their part of the grid. Where a node has far more points
    // than room, a regular share of them is thrown first, so that windows are much wider than the spacing.
    constexpr uint32_t kWindowBits = 12, kWindow = 1 << kWindowBits, kFirstDarts = 1 << 15;
    const size_t stride = (n + kFirstDarts - 1) / kFirstDarts;
    for (size_t begin = 0; begin < n; begin += kWindow * stride) {
        const uint32_t salt = uint32_t(mix_bits(begin)) & (kWindow - 1);
        for (uint32_t turn = 0; turn < kWindow; ++turn) {
            const size_t i = begin + shuffled(turn ^ salt, kWindowBits) * stride;
            if (i < n) visit(i);
        }
    }
    if (stride > 1)
        for (size_t i = 0; i < n; ++i) {
            visit(i);
            if (run < 4) continue;
            i = refuse_run(i + 1, kept_[last_close]) - 1;
            run = 0;
        }
    for (uint32_t i = 0; i < n; ++i)
        if (states_[i] == State::kept) kept.push_back(i);
}

}  // namespace strata
