#include "core/surface/tree_bricks.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace strata {
namespace {

constexpr int kSide = kCubeBrickSide, kBrickDepth = 6;

// Cells with x, y or z of 0 or 1, by directions; of a mask of 4^3 and, in the lowest byte, of one of 2^3.
constexpr uint64_t layer_mask(CubeDirection towards, int digits) {
    const int axis = int(towards) / 2;
    const bool last = int(towards) % 2 == 0;
    uint64_t mask = 0;
    for (int bit = 0; bit < (digits == 1 ? 8 : 64); ++bit) {
        bool in = true;
        for (int digit = 0; digit < digits; ++digit) in = in && (bit >> (3 * digit + 2 - axis) & 1) == int(last);
        if (in) mask |= uint64_t{1} << bit;
    }
    return mask;
}

// Of the indices of a mask's bits: those with bit `high` clear and bit `low` set.
constexpr uint64_t indices_with(int high, int low) {
    uint64_t mask = 0;
    for (int bit = 0; bit < 64; ++bit)
        if ((bit >> high & 1) == 0 && (bit >> low & 1) == 1) mask |= uint64_t{1} << bit;
    return mask;
}

// Exchanges two bits of the indices of a mask's bits.
template <int kHigh, int kLow>
constexpr uint64_t swap_index_bits(uint64_t mask) {
    constexpr int kShift = (1 << kHigh) - (1 << kLow);
    constexpr uint64_t kMoving = indices_with(kHigh, kLow);
    const uint64_t change = (mask ^ mask >> kShift) & kMoving;
    return mask ^ change ^ change << kShift;
}

// Coordinates of the cells of a mask.
constexpr auto kCells = [] {
    std::array<std::array<uint8_t, 3>, 64> cells{};
    for (size_t bit = 0; bit < 64; ++bit)
        for (size_t axis = 0; axis < 3; ++axis) cells[bit][axis] = uint8_t(coordinates_of_code(bit)[axis]);
    return cells;
}();

// A mask of 4^3 cells with y as the highest two bits of indices, then x, then z.
constexpr uint64_t columns_of_mask(uint64_t mask) { return swap_index_bits<4, 3>(swap_index_bits<3, 1>(swap_index_bits<5, 4>(mask))); }

// Likewise of 2^3 cells: the cells (x, y, z) of the 4^3 that have no coordinate above 1.
constexpr uint64_t columns_of_byte(uint64_t byte) {
    uint64_t columns = 0;
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y) columns |= (byte >> (4 * x + 2 * y) & 3) << (16 * y + 4 * x);
    return columns;
}

}  // namespace

// Goes down from a brick's part of the tree and sets what it finds.
class TreeBricks::Filler {
public:
    Filler(const TreeBricks& bricks, const CubeMaterials& materials, CubeBrick& out)
        : bricks_(bricks), tree_(bricks.tree_), materials_(materials), out_(out) {}

    void fill(const Part& part) {
        enter(
            part, kFullMask, 0xFF,
            [&](int level, uint32_t node, uint64_t bits, bool octants, int x, int y, int z) {
                add_cells(level, node, bits, octants, x, y, z);
            },
            [&](int x, int y, int z, int side, uint32_t found) { add_cube(x, y, z, side, found); });
    }

    // The layer of a neighbor that touches the brick. `towards`: from the brick to it.
    void fill_around(const Part& part, CubeDirection towards) {
        const auto facing = CubeDirection(int(towards) ^ 1);
        enter(
            part, layer_mask(facing, 2), layer_mask(facing, 1),
            [&](int level, uint32_t node, uint64_t bits, bool octants, int x, int y, int z) {
                add_layer(level, node, bits, octants, x, y, z, towards);
            },
            [&](int x, int y, int z, int side, uint32_t found) { add_square(x, y, z, side, towards, found); });
    }

private:
    // masks  of the cells that count, of 4^3 and of 2^3
    template <class Cells, class Cube>
    void enter(const Part& part, uint64_t mask, uint64_t byte_mask, const Cells& cells, const Cube& cube) {
        if (part.in_full_cell) return cube(0, 0, 0, kSide, material_of_full(part.level, part.node, part.bit));
        const int level = bricks_.root_level_;
        const int side = bricks_.depth_ - 2 * level;  // log2 of the node's cells an axis
        if (part.byte < 0) descend(level, part.node, mask, byte_mask, side, 0, 0, 0, cells, cube);
        else descend(level, part.node, byte_mask << 8 * part.byte, byte_mask, side, 0, 0, 0, cells, cube);
    }

    // x, y, z    of the node's first cell. Modulo a brick, as a part of eight cells is all of it
    template <class Cells, class Cube>
    void descend(int level, uint32_t node, uint64_t mask, uint64_t byte_mask, int log2_side, int x, int y, int z, const Cells& cells,
                 const Cube& cube) {
        const VoxelLevel& nodes = tree_.levels[size_t(level)];
        if (log2_side == 2) return cells(level, node, nodes.masks[node] & mask, false, x, y, z);
        if (log2_side == 1) return cells(level, node, bytes_present(nodes.masks[node]) & byte_mask, true, x, y, z);
        const uint64_t full = nodes.full_mask(node);
        const uint64_t next_mask = log2_side == 7 ? mask_of_digits(byte_mask) : mask;
        for (uint64_t bits = nodes.masks[node] & mask; bits != 0; bits &= bits - 1) {
            const int bit = std::countr_zero(bits);
            const auto [cx, cy, cz] = kCells[size_t(bit)];
            const int child_side = log2_side - 2;
            const auto first = [&](int from, int coordinate) { return (from + (coordinate << child_side)) & (kSide - 1); };
            if ((full >> bit & 1) != 0) cube(first(x, cx), first(y, cy), first(z, cz), 1 << child_side, material_of_full(level, node, bit));
            else
                descend(level + 1, nodes.child(node, bit), next_mask, byte_mask, child_side, first(x, cx), first(y, cy), first(z, cz),
                        cells, cube);
        }
    }

    // The mask of 4^3 whose cells have both digits in the mask of 2^3.
    static uint64_t mask_of_digits(uint64_t byte_mask) {
        uint64_t mask = 0;
        for (uint64_t bits = byte_mask; bits != 0; bits &= bits - 1) mask |= byte_mask << 8 * std::countr_zero(bits);
        return mask;
    }

    uint32_t material(int level, uint32_t node, int bit, bool octants) const {
        // Of octants cell_index asks for a bit of the mask in the byte.
        return material_of(
            tree_.attributes[size_t(bricks_.depth_)].colors[cell_index(tree_, level, node, octants ? 8 * bit : bit, octants)]);
    }
    // Cells in a full one are what it is.
    uint32_t material_of_full(int level, uint32_t node, int bit) const {
        if (!materials_.by_color) return 0;
        const auto& colors = tree_.attributes[size_t(2 * level + 2)].colors;
        return colors.empty() ? 0 : material_of(colors[cell_index(tree_, level, node, bit, false)]);
    }
    bool is_transparent(uint32_t material) const {
        return std::any_of(materials_.transparent.begin(), materials_.transparent.end(),
                           [&](const VoxelColor& c) { return material == material_of(c); });
    }

    // Of each cell of the bits its place and material.
    template <class Visit>
    void visit_materials(int level, uint32_t node, uint64_t bits, bool octants, const Visit& visit) const {
        for (; bits != 0; bits &= bits - 1) {
            const int bit = std::countr_zero(bits);
            const auto [x, y, z] = kCells[size_t(bit)];
            visit(int(x), int(y), int(z), material(level, node, bit, octants));
        }
    }

    void add_cells(int level, uint32_t node, uint64_t bits, bool octants, int x, int y, int z) {
        const uint64_t columns = octants ? columns_of_byte(bits) : columns_of_mask(bits);
        const int width = octants ? 2 : 4;
        for (int dy = 0; dy < width; ++dy)
            for (int dx = 0; dx < width; ++dx)
                out_.occupied[CubeBrick::column(x + dx, y + dy)] |= (columns >> (16 * dy + 4 * dx) & 15) << z;
        if (!materials_.by_color) return;
        visit_materials(level, node, bits, octants, [&](int dx, int dy, int dz, uint32_t found) {
            out_.materials[CubeBrick::cell(x + dx, y + dy, z + dz)] = found;
            if (materials_.transparent.empty() || !is_transparent(found)) return;
            out_.any_transparent = true;
            out_.transparent[CubeBrick::column(x + dx, y + dy)] |= uint64_t{1} << (z + dz);
        });
    }

    void add_cube(int x, int y, int z, int side, uint32_t found) {
        const uint64_t bits = kFullMask >> (kSide - side) << z;
        const bool transparent = is_transparent(found);
        for (int dy = 0; dy < side; ++dy)
            for (int dx = 0; dx < side; ++dx) {
                out_.occupied[CubeBrick::column(x + dx, y + dy)] |= bits;
                if (transparent) out_.transparent[CubeBrick::column(x + dx, y + dy)] |= bits;
                if (materials_.by_color) std::fill_n(&out_.materials[CubeBrick::cell(x + dx, y + dy, z)], side, found);
            }
        out_.any_transparent = out_.any_transparent || transparent;
    }

    void add_layer(int level, uint32_t node, uint64_t bits, bool octants, int x, int y, int z, CubeDirection towards) {
        uint64_t columns = octants ? columns_of_byte(bits) : columns_of_mask(bits);
        const int width = octants ? 2 : 4;
        const auto nibble = [&](int dx, int dy) { return columns >> (16 * dy + 4 * dx) & 15; };
        switch (towards) {
            case CubeDirection::plus_x:
            case CubeDirection::minus_x: {
                const bool plus = towards == CubeDirection::plus_x;
                for (int dy = 0; dy < width; ++dy)
                    out_.occupied[CubeBrick::column(plus ? kSide : -1, y + dy)] |= nibble(plus ? 0 : width - 1, dy) << z;
                break;
            }
            case CubeDirection::plus_y:
            case CubeDirection::minus_y: {
                const bool plus = towards == CubeDirection::plus_y;
                for (int dx = 0; dx < width; ++dx)
                    out_.occupied[CubeBrick::column(x + dx, plus ? kSide : -1)] |= nibble(dx, plus ? 0 : width - 1) << z;
                break;
            }
            case CubeDirection::plus_z:
            case CubeDirection::minus_z: {
                const bool plus = towards == CubeDirection::plus_z;
                CubeBrick::Plane& plane = plus ? out_.above : out_.below;
                for (int dx = 0; dx < width; ++dx)
                    for (int dy = 0; dy < width; ++dy) plane[size_t(x + dx)] |= uint64_t{nibble(dx, dy) != 0} << (y + dy);
                break;
            }
        }
        if (!materials_.by_color || materials_.transparent.empty()) return;
        const std::array<int, 3> shift = {towards == CubeDirection::plus_x    ? kSide
                                          : towards == CubeDirection::minus_x ? -kSide
                                                                              : 0,
                                          towards == CubeDirection::plus_y    ? kSide
                                          : towards == CubeDirection::minus_y ? -kSide
                                                                              : 0,
                                          towards == CubeDirection::plus_z    ? kSide
                                          : towards == CubeDirection::minus_z ? -kSide
                                                                              : 0};
        visit_materials(level, node, bits, octants, [&](int dx, int dy, int dz, uint32_t found) {
            const int cx = x + dx + shift[0], cy = y + dy + shift[1], cz = z + dz + shift[2];
            out_.materials[CubeBrick::cell(cx, cy, cz)] = found;
            if (!is_transparent(found)) return;
            out_.any_transparent = true;
            if (cz < 0) out_.transparent_below[size_t(cx)] |= uint64_t{1} << cy;
            else if (cz == kSide) out_.transparent_above[size_t(cx)] |= uint64_t{1} << cy;
            else out_.transparent[CubeBrick::column(cx, cy)] |= uint64_t{1} << cz;
        });
    }

    void add_square(int x, int y, int z, int side, CubeDirection towards, uint32_t found) {
        const bool transparent = is_transparent(found);
        out_.any_transparent = out_.any_transparent || transparent;
        const auto add = [&](uint64_t& cells, uint64_t& see_through, int from) {
            const uint64_t bits = kFullMask >> (kSide - side) << from;
            cells |= bits;
            if (transparent) see_through |= bits;
        };
        const auto add_column = [&](int cx, int cy) {
            add(out_.occupied[CubeBrick::column(cx, cy)], out_.transparent[CubeBrick::column(cx, cy)], z);
        };
        for (int i = 0; i < side; ++i) switch (towards) {
                case CubeDirection::plus_x: add_column(kSide, y + i); break;
                case CubeDirection::minus_x: add_column(-1, y + i); break;
                case CubeDirection::plus_y: add_column(x + i, kSide); break;
                case CubeDirection::minus_y: add_column(x + i, -1); break;
                case CubeDirection::plus_z: add(out_.above[size_t(x + i)], out_.transparent_above[size_t(x + i)], y); break;
                case CubeDirection::minus_z: add(out_.below[size_t(x + i)], out_.transparent_below[size_t(x + i)], y); break;
            }
        if (!transparent) return;
        const int axis = int(towards) / 2, beyond = int(towards) % 2 == 0 ? kSide : -1;
        for (int i = 0; i < side; ++i)
            for (int j = 0; j < side; ++j) {
                std::array<int, 3> c;
                if (axis == 0) c = {beyond, y + i, z + j};
                else if (axis == 1) c = {x + i, beyond, z + j};
                else c = {x + i, y + j, beyond};
                out_.materials[CubeBrick::cell(c[0], c[1], c[2])] = found;
            }
    }

    const TreeBricks& bricks_;
    const VoxelTree& tree_;
    const CubeMaterials& materials_;
    CubeBrick& out_;
};

TreeBricks::TreeBricks(const VoxelTree& tree, int depth)
    : tree_(tree),
      depth_(depth),
      side_log2_(std::max(0, depth - kBrickDepth)),
      root_level_(depth <= kBrickDepth ? 0 : (depth - kBrickDepth) / 2) {
    assert(depth >= 1 && depth <= tree.depth());
    placement_ = {.origin = tree.frame.origin, .axes = tree.frame.voxel_size * double(uint64_t{1} << (tree.frame.depth() - depth)) * Mat3d::Identity()};
    if (depth > kBrickDepth && depth % 2 == 1) root_level_ = (depth - kBrickDepth - 1) / 2;
    if (!tree.empty()) collect(0, 0, {0, 0, 0});
}

// place  of the node, in units of its own side
void TreeBricks::collect(int level, uint32_t node, const std::array<uint32_t, 3>& place) {
    const uint64_t node_code = octant_code(place[0], place[1], place[2]);
    const auto add = [&](uint64_t code, const Part& part) {
        codes_.push_back(code);
        parts_.push_back(part);
    };
    const VoxelLevel& nodes = tree_.levels[size_t(level)];
    const bool odd = side_log2_ % 2 == 1;  // bricks are bytes of nodes of the root level
    if (level == root_level_ && !odd) return add(node_code, {.node = node});
    const uint64_t full = nodes.full_mask(node);
    if (level == root_level_) {
        for (int byte = 0; byte < 8; ++byte) {
            if ((nodes.masks[node] >> 8 * byte & 0xFF) == 0) continue;
            add(node_code << 3 | uint64_t(byte), {.node = node, .byte = int8_t(byte), .full = (full >> 8 * byte & 0xFF) == 0xFF});
        }
        return;
    }
    const int log2_side = side_log2_ - 2 * (level + 1);  // of a cell, in bricks
    for (uint64_t bits = nodes.masks[node]; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits);
        const auto [x, y, z] = coordinates_of_code(uint64_t(bit));
        if ((full >> bit & 1) != 0)
            collect_full({.node = node, .full = true, .level = int8_t(level), .bit = int8_t(bit), .in_full_cell = true},
                         node_code << 6 | uint64_t(bit), log2_side, 0x3F);
        else collect(level + 1, nodes.child(node, bit), {4 * place[0] + x, 4 * place[1] + y, 4 * place[2] + z});
    }
}

// outside  by direction: that side of the cell is the full cell's
void TreeBricks::collect_full(const Part& part, uint64_t code, int log2_side, uint32_t outside) {
    if (outside == 0) return;
    if (log2_side == 0) {
        codes_.push_back(code);
        parts_.push_back(part);
        return;
    }
    for (uint32_t octant = 0; octant < 8; ++octant) {
        uint32_t left = 0;
        for (uint32_t axis = 0; axis < 3; ++axis) left |= 1u << (2 * axis + ((octant >> (2 - axis) & 1) != 0 ? 0 : 1));
        collect_full(part, code << 3 | octant, log2_side - 1, outside & left);
    }
}

bool TreeBricks::has_colors() const { return size_t(depth_) < tree_.attributes.size() && !tree_.attributes[size_t(depth_)].colors.empty(); }

uint64_t TreeBricks::cells() const { return count_cells(tree_, depth_); }

size_t TreeBricks::find(const std::array<int64_t, 3>& place) const {
    const int64_t end = int64_t{1} << side_log2_;
    for (const int64_t c : place)
        if (c < 0 || c >= end) return kNone;
    const uint64_t code = octant_code(uint32_t(place[0]), uint32_t(place[1]), uint32_t(place[2]));
    const auto found = std::lower_bound(codes_.begin(), codes_.end(), code);
    return found != codes_.end() && *found == code ? size_t(found - codes_.begin()) : kNone;
}

std::optional<TreeBricks::Part> TreeBricks::locate(const std::array<int64_t, 3>& place) const {
    const int64_t end = int64_t{1} << side_log2_;
    for (const int64_t c : place)
        if (c < 0 || c >= end) return std::nullopt;
    const uint64_t code = octant_code(uint32_t(place[0]), uint32_t(place[1]), uint32_t(place[2]));
    uint32_t node = 0;
    for (int level = 0; level < root_level_; ++level) {
        const VoxelLevel& nodes = tree_.levels[size_t(level)];
        const int bit = int(code >> 3 * (side_log2_ - 2 * (level + 1)) & 63);
        if ((nodes.masks[node] >> bit & 1) == 0) return std::nullopt;
        if ((nodes.full_mask(node) >> bit & 1) != 0)
            return Part{.node = node, .full = true, .level = int8_t(level), .bit = int8_t(bit), .in_full_cell = true};
        node = nodes.child(node, bit);
    }
    if (side_log2_ % 2 == 0) return Part{.node = node};
    const VoxelLevel& nodes = tree_.levels[size_t(root_level_)];
    const int byte = int(code & 7);
    if ((nodes.masks[node] >> 8 * byte & 0xFF) == 0) return std::nullopt;
    return Part{.node = node, .byte = int8_t(byte), .full = (nodes.full_mask(node) >> 8 * byte & 0xFF) == 0xFF};
}

bool TreeBricks::gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const {
    std::array<std::optional<Part>, 6> around;
    const std::array<uint32_t, 3> at = place(brick);
    bool all_full = parts_[brick].full && materials.transparent.empty();  // what can be seen through shows what is within
    for (size_t direction = 0; direction < 6; ++direction) {
        std::array<int64_t, 3> neighbor = {at[0], at[1], at[2]};
        neighbor[direction / 2] += direction % 2 == 0 ? 1 : -1;
        around[direction] = locate(neighbor);
        all_full = all_full && around[direction] && around[direction]->full;
    }
    if (all_full) return false;
    out.occupied.fill(0);
    out.below.fill(0);
    out.above.fill(0);
    out.any_transparent = false;
    out.one_material = !materials.by_color;
    if (materials.by_color) out.allocate_materials();
    if (!materials.transparent.empty()) {
        out.transparent.fill(0);
        out.transparent_below.fill(0);
        out.transparent_above.fill(0);
    }
    Filler filler(*this, materials, out);
    filler.fill(parts_[brick]);
    for (size_t direction = 0; direction < 6; ++direction)
        if (around[direction]) filler.fill_around(*around[direction], CubeDirection(direction));
    return true;
}

uint64_t count_cells(const VoxelTree& tree, int depth) {
    if (tree.empty()) return 0;
    const int last = (depth - 1) / 2;
    uint64_t cells = 0;
    for (int level = 0; level <= last; ++level) {
        const VoxelLevel& nodes = tree.levels[size_t(level)];
        if (level == last) {
            for (const uint64_t mask : nodes.masks) cells += uint64_t(std::popcount(depth % 2 == 1 ? uint64_t{bytes_present(mask)} : mask));
        } else {
            for (const uint64_t full : nodes.full) cells += uint64_t(std::popcount(full)) << 3 * (depth - 2 * level - 2);
        }
    }
    return cells;
}

}  // namespace strata
