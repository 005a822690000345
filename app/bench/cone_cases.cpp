#include "app/bench/cone_cases.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>

#include "core/voxel/cone_query.h"
#include "core/voxel/point_voxels.h"
#include "core/voxel/ray_cast.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/format.h"

namespace strata {
namespace {

constexpr std::array kTangents = {0.05, 0.2, 0.5};
constexpr int kCones = 400;
constexpr int kTrueRays = 1024;
constexpr double kFrom = 3.0;  // voxels, so that nothing hides itself
constexpr std::array kSceneNames = {"sphere", "village"};

struct Method {
    const char* name;
    int count;  // of cones or rays
    bool rays;
    ConeSettings::Sampling sampling;
};
constexpr Method kMethods[] = {{"nearest", 1, false, ConeSettings::Sampling::nearest},
                               {"nearest", 4, false, ConeSettings::Sampling::nearest},
                               {"nearest", 16, false, ConeSettings::Sampling::nearest},
                               {"linear", 1, false, ConeSettings::Sampling::linear},
                               {"linear", 4, false, ConeSettings::Sampling::linear},
                               {"linear", 16, false, ConeSettings::Sampling::linear},
                               {"rays", 1, true, {}},
                               {"rays", 4, true, {}},
                               {"rays", 16, true, {}},
                               {"rays", 64, true, {}}};

std::string case_name(const char* scene, double tangent, const Method* method) {
    char text[64];
    std::snprintf(text, sizeof text, "cones/%s/%g/%s%d", scene, tangent, method ? method->name : "mean", method ? method->count : 0);
    return text;
}

// The voxels that a sphere's surface goes through, 512 an axis.
VoxelTree sphere_tree(const Vec3d& center, double radius) {
    const VoxelFrame frame = {.levels = 5};
    VoxelTreeInMemory memory(frame, {.opacity = true});
    VoxelTreeBuilder builder(frame, {.opacity = true}, memory);
    VoxelBatch batch;
    for (uint64_t code = 0; code < uint64_t{1} << 6 * (frame.levels - 1); ++code) {
        const std::array<uint32_t, 3> block = coordinates_of_code(code);
        const Vec3d middle = 4.0 * Vec3d(block[0] + 0.5, block[1] + 0.5, block[2] + 0.5);
        if (std::abs((middle - center).norm() - radius) > 4.0) continue;
        uint64_t mask = 0;
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const std::array<uint32_t, 3> cell = coordinates_of_code(bit);
            const Vec3d low = Vec3d(4 * block[0] + cell[0], 4 * block[1] + cell[1], 4 * block[2] + cell[2]) - center,
                        high = low + Vec3d::Ones();
            const double nearest = (low.cwiseMax(0.0) + (-high).cwiseMax(0.0)).norm(),
                         farthest = low.cwiseAbs().cwiseMax(high.cwiseAbs()).norm();
            if (nearest <= radius && radius <= farthest) mask |= uint64_t{1} << bit;
        }
        if (mask != 0) batch.blocks.push_back({code, mask, 0});
    }
    builder.add(batch);
    builder.finish();
    return memory.take();
}

struct ConeScene {
    VoxelTree tree;
    std::vector<Vec3d> origins, directions;  // [kCones]
};

Vec3d random_direction(std::mt19937& random) {
    std::normal_distribution<double> normal;
    const double x = normal(random), y = normal(random), z = normal(random);
    return Vec3d(x, y, z).normalized();
}

// Cones from all around towards the sphere and past it.
ConeScene sphere_scene() {
    const Vec3d center = Vec3d::Constant(512.0);
    constexpr double kRadius = 120.0;
    ConeScene scene{sphere_tree(center, kRadius), {}, {}};
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform;
    for (int i = 0; i < kCones; ++i) {
        scene.origins.push_back(center + kRadius * (1.2 + uniform(random)) * random_direction(random));
        const Vec3d aim = center + 1.5 * kRadius * uniform(random) * random_direction(random);
        scene.directions.push_back((aim - scene.origins.back()).normalized());
    }
    return scene;
}

// Cones from the ground, roofs and trees of the village into the upper half of directions.
ConeScene village_scene(const BenchScene& bench_scene, const BenchSettings& bench) {
    const std::string path = bench_scene.las_path();
    const auto source = open_points({&path, 1});
    const VoxelFrame frame = frame_of_resolution(source->info().bounds, 512);
    VoxelTreeInMemory memory(frame, {.opacity = true});
    VoxelTreeBuilder builder(frame, {.opacity = true}, memory);
    PointVoxelSettings settings;
    settings.threads = bench.threads;
    std::vector<Vec3d> voxels;
    voxelize_points(*source, frame, settings, [&](const VoxelBatch& batch) {
        builder.add(batch);
        for (const VoxelBlock& block : batch.blocks) {
            const std::array<uint32_t, 3> at = coordinates_of_code(block.code << 6 | uint64_t(std::countr_zero(block.mask)));
            voxels.push_back(Vec3d(at[0] + 0.5, at[1] + 0.5, at[2] + 0.5));
        }
    });
    builder.finish();
    ConeScene scene{memory.take(), {}, {}};
    std::mt19937 random(2);
    for (int i = 0; i < kCones; ++i) {
        scene.origins.push_back(voxels[random() % voxels.size()]);
        scene.directions.push_back(random_direction(random));
        scene.directions.back().z() = std::abs(scene.directions.back().z());
    }
    return scene;
}

// The part of so many rays, evenly over the cone, that meets a voxel.
double hidden_rays(const VoxelTree& tree, const VoxelCone& cone, int rays) {
    constexpr double kGoldenAngle = 2.39996322972865332;
    const Vec3d right = cone.direction.unitOrthogonal(), up = cone.direction.cross(right);
    int hidden = 0;
    for (int i = 0; i < rays; ++i) {
        const double radius = rays > 1 ? cone.tangent * std::sqrt((i + 0.5) / rays) : 0.0, angle = kGoldenAngle * i;
        const Vec3d direction = (cone.direction + radius * (std::cos(angle) * right + std::sin(angle) * up)).normalized();
        hidden += is_occluded(tree, {cone.origin, direction}, {.least_t = cone.from});
    }
    return double(hidden) / rays;
}

void add_rows(const char* name, const ConeScene& scene, double tangent, const BenchSettings& bench, BenchTable& table) {
    std::vector<VoxelCone> cones;
    std::vector<double> truth;
    double mean = 0.0;
    for (size_t i = 0; i < scene.origins.size(); ++i) {
        cones.push_back({.origin = scene.origins[i], .direction = scene.directions[i], .tangent = tangent, .from = kFrom});
        truth.push_back(hidden_rays(scene.tree, cones.back(), kTrueRays));
        mean += truth.back() / double(scene.origins.size());
    }
    const auto add = [&](const Method* method, const std::function<double(const VoxelCone&)>& opacity) {
        const std::string row = case_name(name, tangent, method);
        if (!bench.wants(row)) return;
        double square = 0.0, sum = 0.0, worst = 0.0;
        std::vector<double> us;
        for (int run = 0; run < bench.runs; ++run) {
            square = sum = worst = 0.0;
            std::vector<double> found(cones.size());
            const auto start = std::chrono::steady_clock::now();
            std::transform(cones.begin(), cones.end(), found.begin(), opacity);
            us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() /
                         double(cones.size()));
            for (size_t i = 0; i < cones.size(); ++i) {
                const double error = found[i] - truth[i];
                square += error * error;
                sum += error;
                worst = std::max(worst, std::abs(error));
            }
        }
        std::nth_element(us.begin(), us.begin() + std::ptrdiff_t(us.size() / 2), us.end());
        const double n = double(cones.size());
        table.rows.push_back({row, method ? us[us.size() / 2] : 0.0, std::sqrt(square / n), sum / n, worst});
        char text[96];
        std::snprintf(text, sizeof text, "%-32s %8.2f us, error %.3f", row.c_str(), us[us.size() / 2], std::sqrt(square / n));
        bench.log(text);
    };
    add(nullptr, [&](const VoxelCone&) { return mean; });
    for (const Method& method : kMethods) {
        ConeSettings settings;
        settings.sampling = method.sampling;
        settings.cones = method.count;
        ConeQuery query(scene.tree, settings);
        add(&method,
            [&](const VoxelCone& cone) { return method.rays ? hidden_rays(scene.tree, cone, method.count) : query.opacity(cone); });
    }
}

}  // namespace

std::optional<BenchSection> run_cone_cases(BenchScene& bench_scene, const BenchSettings& bench) {
    BenchSection section{.name = "cones", .title = "Cones through voxels against rays", .words = {}, .table = {}, .plots = {}};
    section.words =
        "How much of a cone is hidden, from 0 to 1: 400 cones around a sphere's surface of 240 voxels across, and 400 from the voxels of "
        "the village (512 "
        "an axis) upwards, by the tangent of half their angle. The truth is what 1024 rays say. `nearest` and `linear` walk along the axes "
        "of so many "
        "cones over prefiltered cells (`core/voxel/cone_query.h`); `rays` casts so many rays; `mean0` always says the mean of the truth. "
        "Time is that of "
        "one thread.";
    section.table.columns = {{"case", "case"},
                             {"us", "time, µs", 2},
                             {"rms", "error, root mean square", 3},
                             {"mean", "mean error", 3},
                             {"worst", "worst error", 3}};
    for (const char* name : kSceneNames) {
        const auto wanted = [&](double tangent) {
            return bench.wants(case_name(name, tangent, nullptr)) ||
                   std::any_of(std::begin(kMethods), std::end(kMethods),
                               [&](const Method& method) { return bench.wants(case_name(name, tangent, &method)); });
        };
        if (std::none_of(kTangents.begin(), kTangents.end(), wanted)) continue;
        const ConeScene scene = name == kSceneNames[0] ? sphere_scene() : village_scene(bench_scene, bench);
        for (const double tangent : kTangents)
            if (wanted(tangent)) add_rows(name, scene, tangent, bench, section.table);
    }
    if (section.table.rows.empty()) return std::nullopt;
    return section;
}

}  // namespace strata
