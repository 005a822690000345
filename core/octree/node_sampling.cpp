#include "core/octree/node_sampling.h"

#include <algorithm>
#include <array>
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

// The 4^3 cells around a brick as bits of one word: first the brick's two rows in y and z, then the outer ones in y, in
// z, in both. Each bit has the number of its cell, from that of the brick.
struct NodeSampler::Neighborhood {
    std::array<int32_t, 64> cell;
    std::array<uint64_t, 64> near;  // [lowest bits that cells have: zero, one at x, y, z] those beside such cells

    constexpr Neighborhood() : cell(), near() {
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const auto offset = [](uint32_t odd, bool outer) { return outer ? (odd ? -1 : 2) : int(odd); };
            const int offsets[3] = {int(bit / 4 % 4) - 1, offset(bit & 1, bit & 16), offset(bit >> 1 & 1, bit & 32)};
            const int row = (offsets[1] + 2) / 2 - 1, slice = (offsets[2] + 2) / 2 - 1;
            cell[bit] = slice * int(kSlice) + row * int(kRow) + 4 * offsets[0] + int(bit & 3);
            for (uint32_t present = 0; present < 64; ++present) {
                bool all = true;
                for (int axis = 0; axis < 3; ++axis) {
                    const bool zeros = present >> axis & 1, ones = present >> (3 + axis) & 1;
                    all = all && offsets[axis] >= (zeros ? -1 : 0) && offsets[axis] <= (ones ? 2 : 1);
                }
                if (all) near[present] |= uint64_t{1} << bit;
            }
        }
    }
};

NodeSampler::NodeSampler(const OctreeFrame& frame)
    : frame_(frame), occupied_(kCells / 2 * kSlice / 8, 0), first_in_cell_(kCells / 2 * kSlice) {}

uint32_t NodeSampler::cell_index(const Vec3f& p) {
    const auto cell = [&](int axis) { return uint32_t(p[axis] + float(kMargin)); };
    return cell_index(cell(0), cell(1), cell(2));
}

void NodeSampler::start(const NodeKey& node) {
    for (const Kept& kept : kept_) occupied_[cell_index(kept.p) / 8] = 0;
    kept_.clear();
    level_ = node.level;
    spacings_per_quantum_ = frame_.scale / frame_.spacing(node.level);
    corner_ = Vec3d(node.x, node.y, node.z) * kSpacingsPerSide;
    for (int axis = 0; axis < 3; ++axis) {  // two quanta more for rounding
        const auto quanta = [&](double spacings) {
            return std::floor((corner_[axis] + spacings) / spacings_per_quantum_[axis]);
        };
        inner_low_[axis] = int32_t(std::min(quanta(1.0) + 2.0, double(INT32_MAX)));
        inner_high_[axis] = int32_t(std::min(quanta(kSpacingsPerSide - 1.0) - 2.0, double(INT32_MAX)));
    }
}

Vec3f NodeSampler::in_spacings(const Vec3i& p_quanta) const {
    return (p_quanta.cast<double>().cwiseProduct(spacings_per_quantum_) - corner_).cast<float>();
}

void NodeSampler::insert(const Vec3f& p, float distance_squared) {
    const uint32_t cell = cell_index(p);
    uint8_t& bits = occupied_[cell / 8];
    const uint8_t bit = uint8_t(1u << cell % 8);
    uint32_t& first = first_in_cell_[cell];
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

// The nearest whole quantum to the node's corner is subtracted as an integer, so that floats hold the rest. Rounding
// must not carry points out of the node: the bricks around theirs would not all be there.
void NodeSampler::convert(int axis, std::span<const int32_t> quanta) {
    const double spacings_per_quantum = spacings_per_quantum_[axis];
    const int32_t base = int32_t(std::floor(corner_[axis] / spacings_per_quantum));
    const float factor = float(spacings_per_quantum), rest = float(base * spacings_per_quantum - corner_[axis]);
    std::vector<float>& out = candidates_[size_t(axis)];
    if (out.size() < quanta.size() + kBlock) out.resize(quanta.size() + kBlock);
    const float last = std::nextafter(float(kSpacingsPerSide), 0.0f);
    for (size_t i = 0; i < quanta.size(); ++i)
        out[i] = std::min(std::max(float(quanta[i] - base) * factor + rest, 0.0f), last);
}

// Block::cells: the brick's lowest cell as x | y << 8 | z << 16, all even; a lowest bit is set where a candidate has it
// set, and bits 24 to 26 where one does not.
void NodeSampler::make_blocks(size_t n) {
    if (cells_.size() < n) cells_.resize(n);
    const float *x = candidates_[0].data(), *y = candidates_[1].data(), *z = candidates_[2].data();
    for (size_t i = 0; i < n; ++i)
        cells_[i] = uint32_t(int(x[i]) | int(y[i]) << 8 | int(z[i]) << 16) + uint32_t(kMargin * 0x010101);
    if (blocks_.size() < n + 1) blocks_.resize(n + 1);
    size_t count = 0;
    constexpr uint32_t kLowest = 0x010101;
    for (uint32_t i = 0; i < n; ++count) {
        const uint32_t first = cells_[i], begin = i, end = uint32_t(std::min<size_t>(n, begin + kBlock));
        uint32_t ones = first, all_ones = first;
        for (++i; i < end && ((cells_[i] ^ first) & ~kLowest) == 0; ++i) ones |= cells_[i], all_ones &= cells_[i];
        const uint32_t zeros = ~all_ones & kLowest;
        blocks_[count] = {begin, ones | (zeros | zeros >> 7 | zeros >> 14) << 24};
    }
    blocks_[count] = {uint32_t(n), 0};
    block_count_ = count;
}

// The candidates of a block, to be compared with one kept point after the other.
class NodeSampler::Tested {
public:
    Tested(const float* x, const float* y, const float* z)
        : x_{load(x), load(x + 4)}, y_{load(y), load(y + 4)}, z_{load(z), load(z + 4)} {}

    void compare(const Kept& kept) {
        for (int half = 0; half < 2; ++half) {
            const Floats dx = x_[half] - kept.p.x(), dy = y_[half] - kept.p.y(), dz = z_[half] - kept.p.z();
            close_[half] |= dx * dx + dy * dy + dz * dz < kept.distance_squared;
        }
    }
    /// A bit for each candidate that was close to one of them.
    uint32_t close() const {
        const Masks bits = (close_[0] & Masks{1, 2, 4, 8}) | (close_[1] & Masks{16, 32, 64, 128});
        uint64_t halves[2];
        std::memcpy(halves, &bits, sizeof halves);
        const uint64_t both = halves[0] | halves[1];
        return uint32_t(both | both >> 32);
    }

private:
    // Vectors of four, which all processors of the baseline have.
    using Floats [[gnu::vector_size(16)]] = float;
    using Masks [[gnu::vector_size(16)]] = int32_t;
    static Floats load(const float* from) {
        Floats loaded;
        std::memcpy(&loaded, from, sizeof loaded);
        return loaded;
    }

    Floats x_[2], y_[2], z_[2];
    Masks close_[2] = {};
};

uint64_t NodeSampler::occupied_around(uint32_t brick) const {
    const uint8_t* bytes = occupied_.data() + brick / 8;
    const auto row = [&](int dy, int dz) {  // from bit 4 on: x - 1 to x + 2
        uint32_t bits;
        std::memcpy(&bits, bytes + ptrdiff_t(dz) * ptrdiff_t(kSlice / 8) + ptrdiff_t(dy) * ptrdiff_t(kRow / 8) - 1,
                    sizeof bits);
        return bits;
    };
    constexpr uint32_t kOddY = 0xaaaaa, kEvenY = 0x55555, kOddZ = 0xccccc, kEvenZ = 0x33333;
    const uint32_t inner = row(0, 0), outer_y = (row(-1, 0) & kOddY) | (row(1, 0) & kEvenY),
                   outer_z = (row(0, -1) & kOddZ) | (row(0, 1) & kEvenZ),
                   outer = (((row(-1, -1) & kOddY) | (row(1, -1) & kEvenY)) & kOddZ) |
                           (((row(-1, 1) & kOddY) | (row(1, 1) & kEvenY)) & kEvenZ);
    const auto word = [](uint32_t bits) { return uint64_t(bits >> 4 & 0xffff); };
    return word(inner) | word(outer_y) << 16 | word(outer_z) << 32 | word(outer) << 48;
}

// Throws one dart at a block, or as many as it takes until none of its candidates is open.
void NodeSampler::visit(uint32_t index, Round round) {
    static constexpr Neighborhood kAround;
    const Block& block = blocks_[index];
    Tested tested(candidates_[0].data() + block.begin, candidates_[1].data() + block.begin,
                  candidates_[2].data() + block.begin);
    const uint32_t brick = cell_index(block.cells & 0xfe, block.cells >> 8 & 0xfe, block.cells >> 16 & 0xfe);
    const uint32_t ones = (block.cells & 1) | (block.cells >> 7 & 2) | (block.cells >> 14 & 4),
                   zeros = block.cells >> 24;
    for (uint64_t mask = occupied_around(brick) & kAround.near[zeros | ones << 3]; mask != 0; mask &= mask - 1) {
        uint32_t at = first_in_cell_[brick + uint32_t(kAround.cell[size_t(std::countr_zero(mask))])];
        do {
            tested.compare(kept_[at]);
            at = kept_[at].next;
        } while (at != kNone);
    }
    const uint32_t size = blocks_[index + 1].begin - block.begin;
    uint32_t open = ((1u << size) - 1) & ~tested.close();
    if (open == 0) return;
    const uint32_t random = uint32_t(mix_bits(block.begin) >> 32);
    const auto keep = [&](uint32_t pick) {
        const uint32_t i = block.begin + pick;
        picked_[index] |= uint8_t(1u << pick);
        insert({candidates_[0][i], candidates_[1][i], candidates_[2][i]}, 1.0f);
        tested.compare(kept_.back());
        open &= ~(tested.close() | 1u << pick);
    };
    if (round == Round::one_dart) {
        const uint32_t dart = uint32_t(uint64_t{random} * size >> 32);
        if (open >> dart & 1) keep(dart);
        if (open != 0) open_blocks_.push_back(index);
        return;
    }
    const uint32_t first = random % kBlock;
    while (open != 0) keep((first + uint32_t(std::countr_zero((open | open << kBlock) >> first))) % kBlock);
}

void NodeSampler::sample(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z,
                         std::vector<uint32_t>& kept) {
    kept.clear();
    convert(0, x);
    convert(1, y);
    convert(2, z);
    make_blocks(x.size());
    const size_t n = block_count_;
    picked_.assign(n, 0);
    // The order of darts matters only among neighbours, and positions come in an order that keeps neighbours together:
    // so blocks are shuffled in windows that stay in cache with their part of the grid. Each gets one dart at first,
    // which may miss: if what is open of a block were kept at once, small gaps would be filled sooner than by darts at
    // single points, and packings be tighter. Where a node has far more points than room, a regular share of the blocks
    // comes first, so that windows are much wider than the spacing.
    constexpr uint32_t kWindowBits = 12, kWindow = 1 << kWindowBits, kFirstBlocks = 1 << 15;
    const size_t stride = std::max<size_t>((n + kFirstBlocks - 1) / kFirstBlocks, 1);
    for (size_t begin = 0; begin < n; begin += kWindow * stride) {
        const uint32_t salt = uint32_t(mix_bits(begin)) & (kWindow - 1);
        open_blocks_.clear();
        for (uint32_t turn = 0; turn < kWindow; ++turn) {
            const size_t i = begin + shuffled(turn ^ salt, kWindowBits) * stride;
            if (i < n) visit(uint32_t(i), Round::one_dart);
        }
        for (const uint32_t block : open_blocks_) visit(block, Round::rest);
    }
    for (size_t begin = 0; stride > 1 && begin < n; begin += stride)
        for (size_t i = begin + 1; i < std::min(begin + stride, n); ++i) visit(uint32_t(i), Round::rest);
    for (size_t i = 0; i < n; ++i)
        for (uint32_t picked = picked_[i]; picked != 0; picked &= picked - 1)
            kept.push_back(blocks_[i].begin + uint32_t(std::countr_zero(picked)));
}

}  // namespace strata
