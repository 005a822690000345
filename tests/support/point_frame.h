#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/math/camera.h"
#include "core/math/quantization.h"
#include "core/math/random.h"
#include "render/pass/points_pass.h"

// Points drawn by the points pass alone, as its tests want them.
namespace strata::test {

inline constexpr uint32_t kFrameWidth = 200, kFrameHeight = 100;
inline const Quantization kMillimeters = {.scale = Vec3d::Constant(0.001), .offset = Vec3d(500000, 5300000, 100)};

/// A node of points at world positions; a color and a spacing of 0.1 each.
inline ResidentNode node_of(const std::vector<Vec3d>& positions, const Quantization& quantization = kMillimeters) {
    ResidentNode node;
    node.shapes.assign(positions.size(), PointShape{.spacing = 0.1f});
    for (const Vec3d& p : positions) {
        const Vec3d quanta = (p - quantization.offset).cwiseQuotient(quantization.scale);
        node.x.push_back(int32_t(std::lround(quanta.x())));
        node.y.push_back(int32_t(std::lround(quanta.y())));
        node.z.push_back(int32_t(std::lround(quanta.z())));
        node.colors.push_back(make_rgba(uint8_t(node.x.size()), 0, 0));
        const Vec3i q(node.x.back(), node.y.back(), node.z.back());
        node.min_quanta = node.x.size() == 1 ? q : Vec3i(node.min_quanta.cwiseMin(q));
        node.max_quanta = node.x.size() == 1 ? q : Vec3i(node.max_quanta.cwiseMax(q));
    }
    return node;
}

/// Nodes of random points before camera_north, half of them in random planes, all with random colors and normals.
inline std::vector<ResidentNode> random_nodes(const Quantization& quantization = kMillimeters) {
    Random random(4);
    std::vector<ResidentNode> nodes;
    for (int n = 0; n < 5; ++n) {
        std::vector<Vec3d> positions;
        for (int i = 0; i < 20000; ++i)
            positions.push_back(quantization.offset + Vec3d(random.uniform(-3, 3), random.uniform(1, 6), random.uniform(-2, 2)));
        nodes.push_back(node_of(positions, quantization));
        for (size_t i = 0; i < positions.size(); i += 2)  // the others lie in no plane
            nodes.back().shapes[i] = {.spacing = float(random.uniform(0.01, 0.1)),
                                      .normal = {int8_t(int(random.bits() % 127) - 63), int8_t(int(random.bits() % 127) - 63), int8_t(random.bits() % 63 + 1)}};
        for (size_t i = 0; i < positions.size(); ++i) {
            nodes.back().colors[i] = Rgba8(random.bits()) | 0xff000000;
            nodes.back().normals.push_back(i % 3 == 0 ? PackedNormal{} : PackedNormal{int8_t(int(random.bits() % 255) - 127), int8_t(int(random.bits() % 255) - 127), 127});
        }
    }
    return nodes;
}

/// At the offset's place, looking north.
inline Camera camera_north(Projection projection) {
    Camera camera;
    camera.projection = projection;
    camera.eye = kMillimeters.offset;
    camera.view_from_world = look_along({0, 1, 0}, {0, 0, 1});
    camera.fov_rad = 2.0 * std::atan(0.5);  // as high as far away, so 100 px a unit at depth 1
    camera.height = 1.0;
    camera.near_depth = 0.01;
    camera.far_depth = 100;
    return camera;
}

/// Draws and resolves with ids and splat sizes, in strips of so many rows.
inline GBuffer draw_points(const std::vector<ResidentNode>& nodes, const Camera& camera, const SplatStyle& style, int threads = 1,
                           const Quantization& quantization = kMillimeters, SimdLevel level = best_simd_level(),
                           uint32_t strip_rows = kFrameHeight) {
    std::vector<PointNode> list;
    uint32_t rank = 0;
    for (const ResidentNode& node : nodes) {
        list.push_back({.points = &node, .first_rank = rank, .top_row = 0, .bottom_row = kFrameHeight});
        rank += uint32_t(node.size());
    }
    const PointProjection projection(camera, quantization, kFrameWidth, kFrameHeight);
    PointsPass pass;
    GBuffer whole{.width = kFrameWidth, .first_row = 0, .rows = kFrameHeight, .colors = {}, .depths = {}, .splat_px = {}, .ids = {}};
    for (uint32_t row = 0; row < kFrameHeight; row += strip_rows) {
        pass.clear(kFrameWidth, row, std::min(strip_rows, kFrameHeight - row), threads);
        pass.draw(list, projection, style, threads, level);
        GBuffer strip;
        pass.resolve(list, projection, style, {.splat_px = true, .ids = true}, threads, strip, level);
        const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
        append(whole.colors, strip.colors);
        append(whole.depths, strip.depths);
        append(whole.splat_px, strip.splat_px);
        append(whole.ids, strip.ids);
    }
    return whole;
}

inline size_t drawn(const GBuffer& gbuffer) {
    return size_t(std::count_if(gbuffer.ids.begin(), gbuffer.ids.end(), [](PixelId id) { return id != kNoPixelId; }));
}

inline bool equal(const GBuffer& a, const GBuffer& b) {
    return a.colors == b.colors && a.depths == b.depths && a.ids == b.ids && a.splat_px == b.splat_px;
}

}  // namespace strata::test
