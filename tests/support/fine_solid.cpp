#include "tests/support/fine_solid.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace strata {
namespace {

class Places {
public:
    Places(const std::array<uint32_t, 3>& size, std::span<const float> values, int refinement) {
        for (size_t axis = 0; axis < 3; ++axis) side_[axis] = int(size[axis] - 1) * refinement + 3;  // what is around counts as outside
        inside_.assign(size_t(side_[0]) * size_t(side_[1]) * size_t(side_[2]), 0);
        const auto value = [&](int i, int j, int k) { return double(values[(size_t(k) * size[1] + size_t(j)) * size[0] + size_t(i)]); };
        for (int z = 0; z < side_[2] - 2; ++z)
            for (int y = 0; y < side_[1] - 2; ++y)
                for (int x = 0; x < side_[0] - 2; ++x) {
                    // Samples are among the places: near one, its sign may hold for less than a place's width.
                    const auto cell = [&](int p, uint32_t samples) { return std::min(p / refinement, int(samples) - 2); };
                    const int i = cell(x, size[0]), j = cell(y, size[1]), k = cell(z, size[2]);
                    const auto part = [&](int p, int c) { return double(p - c * refinement) / refinement; };
                    const double u = part(x, i), v = part(y, j), w = part(z, k);
                    double f = 0.0;
                    for (int c = 0; c < 8; ++c)
                        f += ((c & 1) != 0 ? u : 1 - u) * ((c & 2) != 0 ? v : 1 - v) * ((c & 4) != 0 ? w : 1 - w) *
                             value(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                    inside_[at(x + 1, y + 1, z + 1)] = f >= 0.0;
                }
    }

    // Parts of the places that are inside or not, together where they share a face or, `widely`, a corner.
    uint64_t parts(bool inside, bool widely) const {
        std::vector<uint32_t> parent(inside_.size());
        std::iota(parent.begin(), parent.end(), 0u);
        const auto find = [&](uint32_t p) {
            while (parent[p] != p) p = parent[p] = parent[parent[p]];
            return p;
        };
        uint64_t count = 0;
        for_all([&](int x, int y, int z) {
            const size_t here = at(x, y, z);
            if (bool(inside_[here]) != inside) return;
            ++count;
            for (int n = 0; n < 13; ++n) {  // half of the 26 around
                const int d = n - 13 + 27, dx = d % 3 - 1, dy = d / 3 % 3 - 1, dz = d / 9 - 1;
                if (!widely && dx * dx + dy * dy + dz * dz != 1) continue;
                const int nx = x + dx, ny = y + dy, nz = z + dz;
                if (nx < 0 || ny < 0 || nz < 0 || nx >= side_[0] || ny >= side_[1] || nz >= side_[2]) continue;
                const size_t there = at(nx, ny, nz);
                if (bool(inside_[there]) != inside) continue;
                const uint32_t a = find(uint32_t(here)), b = find(uint32_t(there));
                if (a == b) continue;
                parent[a] = b;
                --count;
            }
        });
        return count;
    }

    // Of the union of closed cubes around the places, and of the complex of places that are neighbors.
    std::array<int64_t, 2> euler() const {
        // Each window of 2^3 places stands for the cells of both complexes that begin at its least place: those of a window of two places
        // along d of the axes are a face of dimension 3 - d between cubes, and a cell of dimension d of neighbors.
        std::array<std::array<int, 2>, 256> of_window{};
        for (unsigned window = 0; window < 256; ++window)
            for (unsigned axes = 0; axes < 8; ++axes) {
                bool any = false, all = true;
                for (unsigned c = 0; c < 8; ++c) {
                    if ((c & ~axes) != 0) continue;
                    any |= (window >> c & 1) != 0;
                    all &= (window >> c & 1) != 0;
                }
                const int dimension = __builtin_popcount(axes);
                of_window[window][0] += ((3 - dimension) % 2 == 0 ? 1 : -1) * any;
                of_window[window][1] += (dimension % 2 == 0 ? 1 : -1) * all;
            }
        std::array<int64_t, 2> sum = {0, 0};
        for (int z = 0; z + 1 < side_[2]; ++z)
            for (int y = 0; y + 1 < side_[1]; ++y)
                for (int x = 0; x + 1 < side_[0]; ++x) {
                    unsigned window = 0;
                    for (int c = 0; c < 8; ++c) window |= unsigned(inside_[at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))]) << c;
                    sum[0] += of_window[window][0];
                    sum[1] += of_window[window][1];
                }
        return sum;
    }

private:
    size_t at(int x, int y, int z) const { return (size_t(z) * size_t(side_[1]) + size_t(y)) * size_t(side_[0]) + size_t(x); }
    template <typename Use>
    void for_all(const Use& use) const {
        for (int z = 0; z < side_[2]; ++z)
            for (int y = 0; y < side_[1]; ++y)
                for (int x = 0; x < side_[0]; ++x) use(x, y, z);
    }

    std::array<int, 3> side_;
    std::vector<uint8_t> inside_;
};

}  // namespace

std::optional<SolidTopology> solid_topology(const std::array<uint32_t, 3>& size, std::span<const float> values, int refinement) {
    const Places places(size, values, refinement);
    const auto [closed, open] = places.euler();
    if (closed != open) return std::nullopt;
    const SolidTopology topology{.euler = closed, .parts = places.parts(true, true), .parts_outside = places.parts(false, true)};
    const bool told = places.parts(true, false) == topology.parts && places.parts(false, false) == topology.parts_outside;
    return told ? std::optional(topology) : std::nullopt;
}

}  // namespace strata
