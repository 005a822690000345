#include "core/surface/cell_interior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "core/math/random.h"
#include "core/surface/joined.h"

namespace strata {
namespace {

unsigned case_of(const CellValues& values) {
    unsigned cell_case = 0;
    for (size_t c = 0; c < 8; ++c) cell_case |= unsigned(values[c] >= 0.0) << c;
    return cell_case;
}

// Corners 0 and 7 inside, the others at -1: by symmetry what joins them is the diagonal's middle, where the function is (2 v - 6) / 8.
TEST(CellInterior, OppositeCornersAreJoinedWhereTheMiddleIsInside) {
    for (const double v : {1.0, 2.9, 2.999, 3.001, 3.1, 10.0}) {
        const CellValues values = {v, -1, -1, -1, -1, -1, -1, v};
        const auto joined = join_corners_within(values, case_of(values));
        EXPECT_EQ(joined[7] == joined[0], v > 3.0) << v;
        for (size_t c = 2; c < 7; ++c) EXPECT_EQ(joined[c], joined[1]);  // the six hang together around
        // Turned over, it is the outside that is joined.
        CellValues turned = values;
        for (double& value : turned) value = -value;
        const auto outside = join_corners_within(turned, case_of(turned));
        EXPECT_EQ(outside[7] == outside[0], v > 3.0) << v;
    }
}

// What is joined is told by values along the paths of a fine lattice, of well conditioned cells.
TEST(CellInterior, JoinsWhatALatticeJoins) {
    Random random(12);
    constexpr int kSide = 24;
    const auto at = [](int x, int y, int z) { return (z * (kSide + 1) + y) * (kSide + 1) + x; };
    int compared = 0, joined_within = 0;
    for (int n = 0; n < 400; ++n) {
        CellValues values;
        for (double& v : values) v = random.uniform(-1.0, 1.0);
        if (n % 2 == 0) {  // two inside, apart but for the interior
            for (double& v : values) v = -std::abs(v);
            values[0] = random.uniform(0.5, 4.0);
            values[7] = random.uniform(0.5, 4.0);
        }
        std::array<std::array<int, 8>, 2> least;  // place of the group that each corner is in, by steps along axes, by any
        for (int wide = 0; wide < 2; ++wide) {
            auto groups = std::make_unique<Joined<(kSide + 1) * (kSide + 1) * (kSide + 1)>>();
            std::vector<bool> inside((kSide + 1) * (kSide + 1) * (kSide + 1));
            const auto each = [&](auto&& use) {
                for (int z = 0; z <= kSide; ++z)
                    for (int y = 0; y <= kSide; ++y)
                        for (int x = 0; x <= kSide; ++x) use(x, y, z);
            };
            each([&](int x, int y, int z) {
                double f = 0.0;
                for (int c = 0; c < 8; ++c) {
                    const auto weight = [&](int p, int bit) { return (c >> bit & 1) != 0 ? double(p) / kSide : 1.0 - double(p) / kSide; };
                    f += weight(x, 0) * weight(y, 1) * weight(z, 2) * values[size_t(c)];
                }
                inside[size_t(at(x, y, z))] = f >= 0.0;
            });
            each([&](int x, int y, int z) {
                for (int d = 14; d < 27; ++d) {
                    const int dx = d % 3 - 1, dy = d / 3 % 3 - 1, dz = d / 9 - 1;
                    if (wide == 0 && dx * dx + dy * dy + dz * dz != 1) continue;
                    if (x + dx < 0 || x + dx > kSide || y + dy < 0 || y + dy > kSide || z + dz < 0 || z + dz > kSide) continue;
                    if (inside[size_t(at(x, y, z))] == inside[size_t(at(x + dx, y + dy, z + dz))])
                        groups->join(at(x, y, z), at(x + dx, y + dy, z + dz));
                }
            });
            for (int c = 0; c < 8; ++c)
                least[size_t(wide)][size_t(c)] = groups->find(at((c & 1) * kSide, (c >> 1 & 1) * kSide, (c >> 2) * kSide));
        }
        const auto same = [](const std::array<int, 8>& groups, size_t a, size_t b) { return groups[a] == groups[b]; };
        const auto joined = join_corners_within(values, case_of(values));
        for (size_t a = 0; a < 8; ++a)
            for (size_t b = a + 1; b < 8; ++b) {
                if (same(least[0], a, b) != same(least[1], a, b)) continue;  // the lattice does not tell
                ++compared;
                // Without a saddle in the cell nothing is joined that its boundary does not join: less may be said, never more.
                if (joined[a] == joined[b]) {
                    EXPECT_TRUE(same(least[0], a, b)) << n << ": " << a << ", " << b;
                    ++joined_within;
                }
            }
    }
    EXPECT_GT(compared, 9000);
    EXPECT_GT(joined_within, 200);
}

TEST(CellInterior, NothingIsJoinedByWhatIsNotFinite) {
    for (const double special :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
        CellValues values = {5, -1, -1, -1, -1, -1, -1, 5};
        values[3] = special;
        const auto joined = join_corners_within(values, case_of(values));
        for (size_t c = 0; c < 8; ++c) EXPECT_EQ(joined[c], c);
    }
}

}  // namespace
}  // namespace strata
