#include "core/surface/cube_faces.h"

#include <bit>
#include <cstring>

#include "core/simd_target.h"

namespace strata {
namespace {

constexpr int kSide = kCubeBrickSide, kWords = kSide * kSide;

// Columns of cells that lie side by side: word a * kSide + b, and beside each the faces that one of its directions shows.
struct Faces {
    alignas(64) std::array<uint64_t, kWords> words;
    alignas(64) std::array<uint8_t, kWords> present;  // not 0: the word is not 0
};

// Where a cell's material is: first + i / 64 * outer + i % 64 * inner + bit * along, with i the number of its word.
struct MaterialSteps {
    const uint32_t* first;
    ptrdiff_t outer, inner, along;

    const uint32_t* at(int word) const { return first + (word >> 6) * outer + (word & 63) * inner; }
};

// Cells along z become cells along y: out[z * kSide + x] has bit y.
template <int kStep>
inline void exchange(uint64_t (*rows)[8], uint64_t mask) {
    for (int block = 0; block < kSide; block += 2 * kStep)
        for (int i = block; i < block + kStep; ++i)
            for (int lane = 0; lane < 8; ++lane) {
                const uint64_t change = (rows[i][lane] >> kStep ^ rows[i + kStep][lane]) & mask;
                rows[i][lane] ^= change << kStep;
                rows[i + kStep][lane] ^= change;
            }
}

inline void transpose(const CubeBrick::Columns& columns, uint64_t* out) {
    for (int x = 0; x < kSide; x += 8) {
        alignas(64) uint64_t rows[kSide][8];
        for (int y = 0; y < kSide; ++y)
            for (int lane = 0; lane < 8; ++lane) rows[y][lane] = columns[CubeBrick::column(x, y) + size_t(lane)];
        exchange<32>(rows, 0x00000000FFFFFFFF);
        exchange<16>(rows, 0x0000FFFF0000FFFF);
        exchange<8>(rows, 0x00FF00FF00FF00FF);
        exchange<4>(rows, 0x0F0F0F0F0F0F0F0F);
        exchange<2>(rows, 0x3333333333333333);
        exchange<1>(rows, 0x5555555555555555);
        for (int z = 0; z < kSide; ++z)
            for (int lane = 0; lane < 8; ++lane) out[z * kSide + x + lane] = rows[z][lane];
    }
}

// cells, hiding  rows of 64 words, `cell_stride` and `hiding_stride` apart
inline void find_faces(const uint64_t* cells, const uint64_t* hiding, ptrdiff_t stride, Faces& out) {
    for (int a = 0; a < kSide; ++a, cells += stride, hiding += stride)
        for (int b = 0; b < kSide; ++b) {
            const uint64_t faces = cells[b] & ~hiding[b];
            out.words[size_t(a * kSide + b)] = faces;
            out.present[size_t(a * kSide + b)] = faces != 0;
        }
}

// kRowStep   words from a row to the next one of its plane: 64 or 1
// kMerged    materials count
template <int kRowStep, bool kMaterials, class PlaceOf>
inline void merge(Faces& faces, const MaterialSteps& materials, const PlaceOf& place_of, std::vector<CubeRectangle>& out, size_t& used) {
    uint64_t* const words = faces.words.data();
    for (int group = 0; group < kWords; group += 8) {
        uint64_t present;
        std::memcpy(&present, faces.present.data() + group, sizeof present);
        if (present == 0) continue;
        if (used + 512 > out.size()) out.resize(2 * out.size() + 4096);
        CubeRectangle* target = out.data() + used;
        for (; present != 0; present &= present - 1) {
            const int i = group + (std::countr_zero(present) >> 3);
            const int rows_left = kRowStep == 1 ? kSide - (i & 63) : kSide - (i >> 6);
            for (uint64_t bits = words[i]; bits != 0;) {
                const int first = std::countr_zero(bits);
                uint64_t span;
                uint32_t material = 0;
                const uint32_t* row = nullptr;
                int width;
                if constexpr (kMaterials) {
                    row = materials.at(i) + first * materials.along;
                    material = *row;
                    // Both at once, as either alone is hard to foretell: the material behind the last cell may be read.
                    width = 1;
                    for (uint64_t rest = bits >> first; (rest >> 1 & uint64_t{row[width * materials.along] == material}) != 0; rest >>= 1)
                        ++width;
                    span = (~uint64_t{0} >> (kSide - width)) << first;
                    bits ^= span;
                } else {
                    const uint64_t beyond = bits + (bits & -bits);  // the carry runs through the first run and ends behind it
                    span = bits & ~beyond;
                    bits &= beyond;
                    width = std::popcount(span);
                }
                int height = 1;
                for (uint64_t* next = words + i + kRowStep; height < rows_left && (*next & span) == span; next += kRowStep, ++height) {
                    if constexpr (kMaterials) {
                        row += kRowStep == 1 ? materials.inner : materials.outer;
                        int same = 0;
                        while (same < width && row[same * materials.along] == material) ++same;
                        if (same < width) break;
                    }
                    *next ^= span;
                }
                *target++ = {place_of(i, first) | uint32_t(width - 1) << 18 | uint32_t(height - 1) << 24, material};
            }
        }
        used = size_t(target - out.data());
    }
}

// Removes faces between cells that can be seen through and are of one material.
// towards  from a cell's material to its neighbor's
inline void remove_within(const uint64_t* cells, const uint64_t* neighbors, ptrdiff_t stride, const MaterialSteps& materials,
                          ptrdiff_t towards, Faces& faces) {
    for (int a = 0; a < kSide; ++a, cells += stride, neighbors += stride)
        for (int b = 0; b < kSide; ++b) {
            const int i = a * kSide + b;
            for (uint64_t both = cells[b] & neighbors[b]; both != 0; both &= both - 1) {
                const int bit = std::countr_zero(both);
                const uint32_t* const material = materials.at(i) + bit * materials.along;
                if (material[0] == material[towards]) faces.words[size_t(i)] &= ~(uint64_t{1} << bit);
            }
        }
}

}  // namespace

struct CubeFaceFinder::Work {
    Faces faces;
    // [z + 1][x], bit y: of cells along y; from z = -1 to 64
    alignas(64) std::array<uint64_t, kWords + 2 * kSide> turned, turned_hiding, turned_transparent;
    CubeBrick::Columns hiding;
};

namespace {

using Work = CubeFaceFinder::Work;

inline void turn(const CubeBrick::Columns& columns, const CubeBrick::Plane& below, const CubeBrick::Plane& above, uint64_t* out) {
    std::copy(below.begin(), below.end(), out);
    transpose(columns, out + kSide);
    std::copy(above.begin(), above.end(), out + kSide + kWords);
}

template <bool kMaterials>
inline void find_rectangles(const CubeBrick& brick, Work& work, CubeRectangles& out) {
    const bool any_transparent = kMaterials && brick.any_transparent;  // of one material, all hide each other
    size_t used = 0;
    if (out.all.size() < 4096) out.all.resize(4096);
    const uint64_t* const cells = brick.occupied.data() + CubeBrick::column(0, 0);
    const uint64_t* hiding = cells;
    if (any_transparent) {
        for (size_t i = 0; i < work.hiding.size(); ++i) work.hiding[i] = brick.occupied[i] & ~brick.transparent[i];
        hiding = work.hiding.data() + CubeBrick::column(0, 0);
    }
    turn(brick.occupied, brick.below, brick.above, work.turned.data());
    const uint64_t* const turned = work.turned.data() + kSide;
    const uint64_t* turned_hiding = turned;
    if (any_transparent) {
        turn(brick.transparent, brick.transparent_below, brick.transparent_above, work.turned_transparent.data());
        for (size_t i = 0; i < work.turned.size(); ++i) work.turned_hiding[i] = work.turned[i] & ~work.turned_transparent[i];
        turned_hiding = work.turned_hiding.data() + kSide;
    }
    constexpr ptrdiff_t kX = CubeBrick::kMaterialSide, kY = kX * kX;
    const uint32_t* const first = kMaterials ? brick.materials.get() + CubeBrick::cell(0, 0, 0) : nullptr;
    const MaterialSteps upright{first, kY, kX, 1}, level{first, 1, kX, kY};

    for (int direction = 0; direction < 6; ++direction) {
        out.begin[size_t(direction)] = used;
        const int axis = direction / 2;
        const ptrdiff_t sign = direction % 2 == 0 ? 1 : -1;
        const ptrdiff_t stride = axis == 2 ? kSide : CubeBrick::kStride;
        const ptrdiff_t neighbor = sign * (axis == 0 ? 1 : stride);
        const MaterialSteps& materials = axis == 2 ? level : upright;
        find_faces(axis == 2 ? turned : cells, (axis == 2 ? turned_hiding : hiding) + neighbor, stride, work.faces);
        if (any_transparent) {
            const uint64_t* const transparent =
                axis == 2 ? work.turned_transparent.data() + kSide : brick.transparent.data() + CubeBrick::column(0, 0);
            remove_within(transparent, transparent + neighbor, stride, materials, sign * (axis == 0 ? kX : axis == 1 ? kY : 1), work.faces);
        }
        const auto upright_place = [](int word, int bit) { return uint32_t(word) | uint32_t(bit) << 12; };
        const auto level_place = [](int word, int bit) { return uint32_t(word & 63) | uint32_t(bit) << 6 | uint32_t(word >> 6) << 12; };
        if (axis == 0) merge<kSide, kMaterials>(work.faces, materials, upright_place, out.all, used);
        else if (axis == 1) merge<1, kMaterials>(work.faces, materials, upright_place, out.all, used);
        else merge<1, kMaterials>(work.faces, materials, level_place, out.all, used);
    }
    out.begin[6] = used;
}

inline void find_any(const CubeBrick& brick, Work& work, CubeRectangles& out) {
    if (brick.one_material) find_rectangles<false>(brick, work, out);
    else find_rectangles<true>(brick, work, out);
}

STRATA_KERNEL_BASELINE void find_baseline(const CubeBrick& brick, Work& work, CubeRectangles& out) { find_any(brick, work, out); }
STRATA_KERNEL_AVX2 void find_avx2(const CubeBrick& brick, Work& work, CubeRectangles& out) { find_any(brick, work, out); }
STRATA_KERNEL_AVX512 void find_avx512(const CubeBrick& brick, Work& work, CubeRectangles& out) { find_any(brick, work, out); }

}  // namespace

void CubeBrick::allocate_materials() {
    if (!materials) materials = std::make_unique<uint32_t[]>(size_t(kMaterialSide) * kMaterialSide * kMaterialSide);
}

CubeFaceFinder::CubeFaceFinder(SimdLevel level) : level_(level), work_(std::make_unique<Work>()) {}
CubeFaceFinder::~CubeFaceFinder() = default;

void CubeFaceFinder::find(const CubeBrick& brick, CubeRectangles& out) {
    switch (level_) {
        case SimdLevel::avx512: return find_avx512(brick, *work_, out);
        case SimdLevel::avx2: return find_avx2(brick, *work_, out);
        case SimdLevel::baseline: return find_baseline(brick, *work_, out);
    }
}

}  // namespace strata
