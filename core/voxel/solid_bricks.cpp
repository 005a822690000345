#include "core/voxel/solid_bricks.h"

#include <algorithm>
#include <mutex>

#include "core/math/morton.h"
#include "core/parallel.h"

namespace strata {

BrickWindings::BrickWindings(const GridMesh& mesh, int threads) {
    const int32_t bricks = std::max(int32_t(mesh.frame().side() >> kBrickBits), 1);
    const CellRange all = {{0, 0, 0}, {bricks - 1, bricks - 1, bricks - 1}};
    const int32_t half = int32_t{1} << (mesh.bits() - 1);
    std::mutex mutex;
    parallel_blocks(threads, mesh.size(), size_t{1} << 14, [&](size_t begin, size_t end) {
        TriangleScanner scanner;
        std::vector<Crossing> found;
        for (size_t i = begin; i < end; ++i) {
            if (!mesh.is_near(i)) continue;
            scanner.scan_crossings(mesh[i], 2, mesh.bits() + kBrickBits, half, all, [&](int32_t x, int32_t y, int32_t first, int sign) {
                if (first > 0) found.push_back({column_of(uint32_t(x), uint32_t(y)), uint32_t(std::min(first, bricks)), sign});
            });
        }
        const std::lock_guard lock(mutex);
        crossings_.insert(crossings_.end(), found.begin(), found.end());
    });
    std::sort(crossings_.begin(), crossings_.end(),
              [](const Crossing& a, const Crossing& b) { return a.column != b.column ? a.column < b.column : a.first < b.first; });
    // Out through the surface the winding number falls by 1.
    for (size_t i = crossings_.size(); i-- > 1;)
        if (crossings_[i - 1].column == crossings_[i].column) crossings_[i - 1].winding += crossings_[i].winding;
}

int BrickWindings::at(const std::array<uint32_t, 3>& brick) const {
    const uint64_t column = column_of(brick[0], brick[1]);
    const auto above = std::partition_point(crossings_.begin(), crossings_.end(), [&](const Crossing& c) {
        return c.column != column ? c.column < column : c.first <= brick[2];
    });
    return above == crossings_.end() || above->column != column ? 0 : above->winding;
}

SolidPlan plan_solid(const GridMesh& mesh, const BrickBins& bins, const BrickWindings& windings, const HoleCaps& holes) {
    SolidPlan plan;
    HolesNearby nearby(holes);
    size_t cubes_handed_out = 0;
    const auto add_brick = [&](uint64_t code, std::span<const uint32_t> triangles) {
        plan.jobs.push_back({cubes_handed_out, plan.cubes.size(), code, triangles, true});
        cubes_handed_out = plan.cubes.size();
    };
    const std::vector<BrickBins::Brick>& bricks = bins.bricks();
    // The cube of 4^(height + 1) voxels a side and the bricks [begin, end) in it.
    const auto visit = [&](const auto& self, uint64_t code, int height, size_t begin, size_t end) -> void {
        if (begin == end) {
            const uint64_t first_brick = code << 6 * (height - 2);
            const std::array<uint32_t, 3> brick = coordinates_of_code(first_brick);
            std::array<uint32_t, 3> first;
            for (size_t a = 0; a < 3; ++a) first[a] = brick[a] << kBrickBits;
            const uint32_t size = uint32_t{4} << 2 * height;
            nearby.look_from(first, size);
            if (const auto least = nearby.least_inside(first, size, false)) {
                if (windings.at(brick) >= *least) plan.cubes.push_back({code, kFullMask, height});
                return;
            }
        }
        if (height == 2) {
            add_brick(code, begin == end ? std::span<const uint32_t>() : bins.triangles(bricks[begin]));
            return;
        }
        for (uint64_t child = code << 6; child < (code + 1) << 6; ++child) {
            const size_t next = size_t(std::partition_point(bricks.begin() + std::ptrdiff_t(begin), bricks.begin() + std::ptrdiff_t(end),
                                                            [&](const auto& b) { return b.code >> 6 * (height - 3) <= child; }) -
                                       bricks.begin());
            self(self, child, height - 1, begin, next);
            begin = next;
        }
    };
    if (mesh.frame().levels < 3) add_brick(0, bricks.empty() ? std::span<const uint32_t>() : bins.triangles(bricks[0]));
    else visit(visit, 0, mesh.frame().levels - 1, 0, bricks.size());
    if (cubes_handed_out < plan.cubes.size()) plan.jobs.push_back({.first_cube = cubes_handed_out, .last_cube = plan.cubes.size()});
    return plan;
}

SolidBrick::SolidBrick(const GridMesh& mesh, const HoleCaps& holes, size_t caps)
    : mesh_(mesh),
      holes_(holes),
      has_holes_(!holes.empty()),
      caps_(caps),
      start_(kBrickSide * kBrickSide),
      places_(kMasks + 1),
      least_(kMasks),
      capped_(kMasks),
      masks_(kMasks) {}

void SolidBrick::fill(uint64_t code, std::span<const uint32_t> triangles, int winding, std::vector<VoxelBlock>& blocks) {
    const std::array<uint32_t, 3> brick = coordinates_of_code(code);
    CellRange voxels;
    for (size_t a = 0; a < 3; ++a) {
        voxels.first[a] = int32_t(brick[a] << kBrickBits);
        voxels.last[a] = voxels.first[a] + int32_t(std::min(mesh_.frame().side(), kBrickSide)) - 1;
    }
    start_columns(voxels, triangles, winding);
    cross_columns(voxels, triangles);
    if (has_holes_) {
        mark_capped(voxels, triangles);
        std::array<uint32_t, 3> first;
        for (size_t a = 0; a < 3; ++a) first[a] = uint32_t(voxels.first[a]);
        const uint32_t size = uint32_t(voxels.last[0] - voxels.first[0] + 1);
        holes_.look_from(first, size);
        find_least(first, size, first);
    } else {
        std::fill(least_.begin(), least_.end(), 1);
    }
    fill_masks(voxels);
    append_blocks(code, blocks);
}

// From the first center along y, and from each center there along x.
void SolidBrick::start_columns(const CellRange& voxels, std::span<const uint32_t> triangles, int winding) {
    std::fill(start_.begin(), start_.end(), 0);
    start_[0] = winding;
    CellRange layer = voxels, line = voxels;
    layer.last[2] = line.last[2] = voxels.first[2];
    line.last[0] = voxels.first[0];
    const int32_t half = int32_t{1} << (mesh_.bits() - 1), side = voxels.last[0] - voxels.first[0] + 1;
    for (const uint32_t i : triangles) {
        const GridTriangle t = mesh_[i];
        scanner_.scan_crossings(t, 1, mesh_.bits(), half, line, [&](int32_t, int32_t, int32_t first, int sign) {
            const int32_t y = first - voxels.first[1];
            if (y > 0 && y < side) start_[size_t(y)] -= sign;
        });
        scanner_.scan_crossings(t, 0, mesh_.bits(), half, layer, [&](int32_t, int32_t y, int32_t first, int sign) {
            const int32_t x = first - voxels.first[0];
            if (x > 0 && x < side) start_[size_t(x) * kBrickSide + size_t(y - voxels.first[1])] -= sign;
        });
    }
    for (int32_t y = 1; y < side; ++y) start_[size_t(y)] += start_[size_t(y - 1)];
    for (int32_t x = 1; x < side; ++x)
        for (int32_t y = 0; y < side; ++y) start_[size_t(x) * kBrickSide + size_t(y)] += start_[size_t(x - 1) * kBrickSide + size_t(y)];
}

void SolidBrick::cross_columns(const CellRange& voxels, std::span<const uint32_t> triangles) {
    const int32_t half = int32_t{1} << (mesh_.bits() - 1), side = voxels.last[0] - voxels.first[0] + 1;
    crossings_.clear();
    for (const uint32_t i : triangles)
        scanner_.scan_crossings(mesh_[i], 2, mesh_.bits(), half, voxels, [&](int32_t fx, int32_t fy, int32_t first, int sign) {
            if (first <= voxels.first[2] || first >= voxels.first[2] + side) return;
            const uint32_t x = uint32_t(fx - voxels.first[0]), y = uint32_t(fy - voxels.first[1]), z = uint32_t(first - voxels.first[2]);
            const uint32_t mask = (x / 4 * kTiles + y / 4) * kTiles + z / 4;
            crossings_.push_back({mask << 6 | (x & 3) << 4 | (y & 3) << 2 | (z & 3), sign});
        });
    std::fill(places_.begin(), places_.end(), 0);
    for (const Crossing& c : crossings_) ++places_[(c.place >> 6) + 1];
    for (size_t i = 1; i <= kMasks; ++i) places_[i] += places_[i - 1];
    sorted_.resize(crossings_.size());
    for (const Crossing& c : crossings_) sorted_[places_[c.place >> 6]++] = c;
    for (size_t i = kMasks; i > 0; --i) places_[i] = places_[i - 1];
    places_[0] = 0;
}

// In which masks a cap lies: there g jumps.
void SolidBrick::mark_capped(const CellRange& voxels, std::span<const uint32_t> triangles) {
    std::fill(capped_.begin(), capped_.end(), 0);
    CellRange masks = voxels;
    for (size_t a = 0; a < 3; ++a) {
        masks.first[a] >>= 2;
        masks.last[a] >>= 2;
    }
    for (const uint32_t i : triangles) {
        if (i < caps_) continue;
        scanner_.scan_touched(mesh_[i], mesh_.bits() + 2, masks, [&](int w, int32_t u, int32_t v, int32_t first, int32_t last) {
            std::array<int32_t, 3> p;
            p[size_t(w + 1) % 3] = u;
            p[size_t(w + 2) % 3] = v;
            for (p[size_t(w)] = first; p[size_t(w)] <= last; ++p[size_t(w)])
                capped_[((uint32_t(p[0]) % kTiles) * kTiles + uint32_t(p[1]) % kTiles) * kTiles + uint32_t(p[2]) % kTiles] = 1;
        });
    }
}

void SolidBrick::find_least(const std::array<uint32_t, 3>& first, uint32_t size, const std::array<uint32_t, 3>& brick_first) {
    std::array<uint32_t, 3> from, to;
    for (size_t a = 0; a < 3; ++a) {
        from[a] = (first[a] - brick_first[a]) / 4;
        to[a] = from[a] + size / 4;
    }
    bool capped = false;
    const auto each_mask = [&](auto&& visit) {
        for (uint32_t x = from[0]; x < to[0]; ++x)
            for (uint32_t y = from[1]; y < to[1]; ++y)
                for (uint32_t z = from[2]; z < to[2]; ++z) visit((x * kTiles + y) * kTiles + z);
    };
    each_mask([&](uint32_t mask) { capped = capped || capped_[mask]; });
    std::optional<int> least = holes_.least_inside(first, size, capped);
    if (least || size == 4) {
        each_mask([&](uint32_t mask) { least_[mask] = least.value_or(kEach); });
        return;
    }
    for (uint32_t k = 0; k < 8; ++k)
        find_least({first[0] + (k >> 2 & 1) * size / 2, first[1] + (k >> 1 & 1) * size / 2, first[2] + (k & 1) * size / 2}, size / 2,
                   brick_first);
}

void SolidBrick::fill_masks(const CellRange& voxels) {
    const uint32_t tiles = uint32_t(voxels.last[0] - voxels.first[0] + 1) / 4;
    for (uint32_t tx = 0; tx < tiles; ++tx)
        for (uint32_t ty = 0; ty < tiles; ++ty) {
            std::array<int32_t, 16> winding;  // of each column, at the voxel below
            for (uint32_t column = 0; column < 16; ++column)
                winding[column] = start_[size_t(4 * tx + column / 4) * kBrickSide + 4 * ty + column % 4];
            int32_t least_before = kEach;  // for which `mask` was made
            uint64_t mask = 0;
            for (uint32_t tz = 0; tz < tiles; ++tz) {
                const uint32_t at = (tx * kTiles + ty) * kTiles + tz;
                const int32_t least = least_[at];
                uint64_t& out = masks_[octant_code(tx, ty, tz)];
                if (places_[at] == places_[at + 1] && least != kEach) {
                    if (least != least_before) {
                        mask = 0;
                        for (uint32_t column = 0; column < 16; ++column)  // z has the lowest bit of each triple
                            mask |= uint64_t{winding[column] >= least} * (uint64_t{0x303} << mask_bit(column / 4, column % 4, 0));
                        least_before = least;
                    }
                    out = mask;
                    continue;
                }
                std::array<std::array<int32_t, 16>, 4> change = {};
                for (uint32_t i = places_[at]; i < places_[at + 1]; ++i)
                    change[sorted_[i].place & 3][sorted_[i].place >> 2 & 15] -= sorted_[i].sign;
                out = 0;
                for (uint32_t z = 0; z < 4; ++z)
                    for (uint32_t column = 0; column < 16; ++column) {
                        winding[column] += change[z][column];
                        const uint32_t x = column / 4, y = column % 4;
                        const int32_t inside =
                            least != kEach
                                ? least
                                : holes_.least_inside({uint32_t(voxels.first[0]) + 4 * tx + x, uint32_t(voxels.first[1]) + 4 * ty + y,
                                                       uint32_t(voxels.first[2]) + 4 * tz + z});
                        out |= uint64_t{winding[column] >= inside} << mask_bit(x, y, z);
                    }
                least_before = kEach;
            }
        }
}

// Cubes of 16 and of 64 voxels a side in which no mask is partly filled are one block.
void SolidBrick::append_blocks(uint64_t code, std::vector<VoxelBlock>& blocks) const {
    const int levels = mesh_.frame().levels;
    if (levels == 1) {
        if (masks_[0] != 0) blocks.push_back({0, masks_[0], 0});
        return;
    }
    const size_t groups = levels == 2 ? 1 : 64;
    const auto whole_masks = [&](size_t group) -> std::optional<uint64_t> {
        uint64_t full = 0;
        for (size_t i = 0; i < 64; ++i) {
            const uint64_t mask = masks_[group * 64 + i];
            if (mask != 0 && mask != kFullMask) return {};
            full |= (mask & 1) << i;
        }
        return full;
    };
    std::array<std::optional<uint64_t>, 64> whole;
    bool all_whole = levels > 2;
    uint64_t full = 0;
    for (size_t g = 0; g < groups; ++g) {
        whole[g] = whole_masks(g);
        all_whole = all_whole && whole[g] && (*whole[g] == 0 || *whole[g] == kFullMask);
        if (whole[g]) full |= (*whole[g] & 1) << g;
    }
    if (all_whole) {
        if (full != 0) blocks.push_back({code, full, 2});
        return;
    }
    for (size_t g = 0; g < groups; ++g) {
        if (whole[g]) {
            if (*whole[g] != 0) blocks.push_back({code * 64 + g, *whole[g], 1});
            continue;
        }
        for (size_t i = 64 * g; i < 64 * (g + 1); ++i)
            if (masks_[i] != 0) blocks.push_back({code * kMasks + i, masks_[i], 0});
    }
}

}  // namespace strata
