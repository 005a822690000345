// Whether the surface has the topology of the trilinear interpolant, judged by the interpolant's values at many places (fine_solid.h).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>

#include "core/math/random.h"
#include "core/surface/cell_cases.h"
#include "core/surface/contour.h"
#include "tests/support/fine_solid.h"
#include "tests/support/run_program.h"
#include "tests/support/surface_shape.h"

namespace strata {
namespace {

struct Field {
    std::array<uint32_t, 3> size;
    std::vector<float> values;
};

Field field_of(const std::array<uint32_t, 3>& size, const std::function<float()>& draw) {
    Field field{size, std::vector<float>(size_t(size[0]) * size[1] * size[2])};
    for (float& v : field.values) v = draw();
    return field;
}

SurfaceShape closed_shape(const Field& field, ContourReport* report = nullptr) {
    ContourMesh mesh;
    const ContourReport found = contour_grid({}, field.size, field.values, {.isovalues = {0.0}, .close = true}, mesh);
    if (report != nullptr) *report = found;
    EXPECT_EQ(found.vertices, mesh.positions.size());
    EXPECT_EQ(found.triangles, mesh.triangles.size());
    return shape_of({mesh.positions.data(), mesh.positions.size()}, {mesh.triangles.data(), mesh.triangles.size()});
}

// The surface around a solid has twice its Euler characteristic, and each of its parts has one part of the solid on one side and one of
// the rest on the other: together they are a tree.
enum class Verdict { right, wrong, not_told };
Verdict judge(const Field& field, const SurfaceShape& shape, int most_places) {
    std::optional<SolidTopology> before;
    for (int places = 8; places <= most_places; places *= 2) {
        const auto solid = solid_topology(field.size, field.values, places);
        // Told by twice as many places, too: a neck may be narrower than a place.
        if (solid && before && *solid == *before) {
            const uint64_t parts = solid->parts == 0 ? 0 : solid->parts + solid->parts_outside - 1;
            return shape.euler == 2 * solid->euler && shape.components == parts ? Verdict::right : Verdict::wrong;
        }
        before = solid;
    }
    return Verdict::not_told;
}

// STRATA_FIELDS=10000 for the long run.
int fields_wanted() {
    const int usual = test::built_with_sanitizer() ? 64 : 256;
    const char* const wanted = std::getenv("STRATA_FIELDS");
    return wanted != nullptr ? std::atoi(wanted) : usual;
}

TEST(ContourTopology, EverySignsOfACellWithRandomValues) {
    Random random(1);
    int not_told = 0, judged = 0, tunnels = 0;
    const int rounds = std::max(1, fields_wanted() / 256);
    for (int round = 0; round < rounds; ++round)
        for (unsigned cell_case = 0; cell_case < 256; ++cell_case) {
            Field cell{{2, 2, 2}, std::vector<float>(8)};
            // Small and large magnitudes lead to all ways in which faces and interior are decided.
            for (size_t c = 0; c < 8; ++c) {
                const double magnitude = round % 2 == 0 ? random.uniform(0.05, 1.0) : std::exp(random.uniform(-3.0, 0.0));
                cell.values[c] = float((cell_case >> c & 1) != 0 ? magnitude : -magnitude);
            }
            ContourReport report;
            const SurfaceShape shape = closed_shape(cell, &report);
            ASSERT_EQ(shape.fault, "") << "case " << cell_case << ", round " << round;
            ASSERT_EQ(shape.boundary_edges, 0u);
            const Verdict verdict = judge(cell, shape, 32);
            EXPECT_NE(verdict, Verdict::wrong) << "case " << cell_case << ", round " << round;
            not_told += verdict == Verdict::not_told;
            tunnels += int(report.tunnel_cells);
            ++judged;
        }
    std::printf("%d cells, %d of them with tunnels, %d not told\n", judged, tunnels, not_told);
    EXPECT_LT(not_told, judged / 20);
}

TEST(ContourTopology, RandomFields) {
    Random random(2);
    int not_told = 0, judged = 0;
    uint64_t ambiguous = 0, tunnels = 0;
    for (int n = 0; n < fields_wanted(); ++n) {
        const Field field = field_of({3, 3, 3}, [&] { return float(n % 2 == 0 ? random.uniform(-1.0, 1.0) : random.normal()); });
        ContourReport report;
        const SurfaceShape shape = closed_shape(field, &report);
        ASSERT_EQ(shape.fault, "") << "field " << n;
        ASSERT_EQ(shape.boundary_edges, 0u) << "field " << n;
        const Verdict verdict = judge(field, shape, 32);
        EXPECT_NE(verdict, Verdict::wrong) << "field " << n;
        not_told += verdict == Verdict::not_told;
        ambiguous += report.ambiguous_cells;
        tunnels += report.tunnel_cells;
        ++judged;
    }
    std::printf("%d fields, %llu ambiguous cells, %llu tunnels, %d not told\n", judged, (unsigned long long)ambiguous,
                (unsigned long long)tunnels, not_told);
    EXPECT_LT(not_told, judged / 20);
}

}  // namespace
}  // namespace strata
