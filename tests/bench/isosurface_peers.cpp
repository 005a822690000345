// What rays to isosurfaces take here, in NanoVDB and in OpenVDB: the same level sets, the same rays, in the same run, and how far from
// the surface each finds them. A program of its own that prints a table:
//   isosurface_peers sphere|gyroid SAMPLES  or  isosurface_peers VOLUME ISOVALUE
// NanoVDB's ZeroCrossing stops at the first voxel of the other sign; for where the surface is its trilinear samples around are asked, by the
// false position. OpenVDB's LevelSetRayIntersector interpolates between the voxels that it passes. All rays are those of one picture of
// 1024 x 1024 that the surface fills.
#include <nanovdb/util/HDDA.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/Ray.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/RayIntersector.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>

#include "core/parallel.h"
#include "core/surface/field_rays.h"
#include "io/volume/volume_source.h"
#include "tests/bench/peer_view.h"

namespace strata {
namespace {

constexpr int kPicture = 1024, kTile = 32, kTimes = 5;
constexpr float kBand = 3.0f;
constexpr double kMiss = std::numeric_limits<double>::infinity();

// A surface to look at: a value everywhere, below 0 inside, and its samples on a grid of so many an axis.
struct Scene {
    const char* name;
    std::array<int, 3> samples;
    std::function<double(const Vec3d&)> value;  // the truth; index space

    // How far a place is from the surface, as far as the value and its slope tell.
    double distance(const Vec3d& p) const {
        constexpr double kStep = 1e-4;
        Vec3d slope;
        for (int a = 0; a < 3; ++a) slope[a] = (value(p + kStep * Vec3d::Unit(a)) - value(p - kStep * Vec3d::Unit(a))) / (2 * kStep);
        return std::abs(value(p)) / slope.norm();
    }
    Box3d box() const { return {.min = Vec3d::Zero(), .max = Vec3d(samples[0] - 1, samples[1] - 1, samples[2] - 1)}; }
};

openvdb::FloatGrid::Ptr level_set_of(const Scene& scene) {
    const auto level_set = openvdb::FloatGrid::create(kBand);
    auto accessor = level_set->getAccessor();
    const size_t row = size_t(scene.samples[2]), plane = row * size_t(scene.samples[1]);
    std::vector<float> values(plane * size_t(scene.samples[0]));
    parallel_blocks(2, size_t(scene.samples[0]), 1, [&](size_t begin, size_t end) {
        for (size_t n = begin * plane; n < end * plane; ++n) values[n] = float(scene.value(Vec3d(double(n / plane), double(n % plane / row), double(n % row))));
    });
    for (size_t n = 0; n < values.size(); ++n)
        if (std::abs(values[n]) < kBand) accessor.setValue({int(n / plane), int(n % plane / row), int(n % row)}, values[n]);
    level_set->setGridClass(openvdb::GRID_LEVEL_SET);
    openvdb::tools::signedFloodFill(level_set->tree());
    return level_set;
}

// The leaves of a grid, with x fastest.
class LeafSource : public FieldBrickSource {
public:
    explicit LeafSource(const openvdb::FloatGrid& grid) : accessor_(grid.getConstAccessor()), background_(grid.background()) {
        for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) leaves_.push_back(&*leaf);
        std::sort(leaves_.begin(), leaves_.end(), [](const Leaf* a, const Leaf* b) {
            const auto key = [](const Leaf* leaf) { return std::array{leaf->origin().z(), leaf->origin().y(), leaf->origin().x()}; };
            return key(a) < key(b);
        });
    }
    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return background_; }
    float absent_value(const std::array<int32_t, 3>& c) const override { return accessor_.getValue({c[0], c[1], c[2]}); }
    bool next_layer(FieldBrickLayer& out) override {
        if (next_ == leaves_.size()) return false;
        out.k = leaves_[next_]->origin().z();
        out.corners.clear();
        out.values.clear();
        for (; next_ < leaves_.size() && leaves_[next_]->origin().z() == out.k; ++next_) {
            const Leaf& leaf = *leaves_[next_];
            out.corners.push_back({leaf.origin().x(), leaf.origin().y()});
            for (int n = 0; n < kFieldBrickSamples; ++n) out.values.push_back(leaf.buffer().data()[(n & 7) << 6 | (n & 56) | n >> 6]);
        }
        return true;
    }

private:
    using Leaf = openvdb::FloatTree::LeafNodeType;
    openvdb::FloatGrid::ConstAccessor accessor_;
    GridPlacement placement_;
    float background_;
    std::vector<const Leaf*> leaves_;
    size_t next_ = 0;
};

/// Writes for each pixel of a tile how far along its direction the surface is, or kMiss.
using CastTile = std::function<void(int x0, int y0, double* out, size_t stride)>;

void print_rays(const char* what, const Scene& scene, const PeerCamera& camera, const CastTile& cast) {
    std::vector<double> found(size_t(kPicture) * kPicture);
    double rays_per_us[2] = {};
    for (const int threads : {1, 2}) {
        const double seconds = median_seconds(kTimes, [&] {
            parallel_blocks(threads, kPicture / kTile, 1, [&](size_t begin, size_t end) {
                for (size_t row = begin; row < end; ++row)
                    for (int x = 0; x < kPicture; x += kTile)
                        cast(x, int(row) * kTile, found.data() + row * kTile * kPicture + size_t(x), kPicture);
            });
        });
        rays_per_us[threads - 1] = double(found.size()) / seconds / 1e6;
    }
    size_t hits = 0;
    std::vector<double> off;
    for (size_t n = 0; n < found.size(); ++n) {
        if (found[n] == kMiss) continue;
        ++hits;
        if (n % 7 == 0) off.push_back(scene.distance(camera.eye + found[n] * camera.direction(int(n % kPicture), int(n / kPicture))));
    }
    std::sort(off.begin(), off.end());
    std::printf("| %s, %s | %.1f | %.1f | %.3f %% | %.2g | %.2g |\n", scene.name, what, rays_per_us[0], rays_per_us[1],
                100.0 * double(hits) / double(found.size()), off.empty() ? 0.0 : off[off.size() / 2],
                off.empty() ? 0.0 : off[off.size() * 999 / 1000]);
    std::fflush(stdout);
}

nanovdb::Vec3f nano(const Vec3d& v) { return {float(v.x()), float(v.y()), float(v.z())}; }

// Casts rays of unit length one by one, with an accessor a tile; hit(ray, accessor) gives t or kMiss.
template <typename Ray, typename MakeState, typename Hit>
CastTile one_by_one(const PeerCamera& camera, const MakeState& make_state, const Hit& hit) {
    return [&camera, make_state, hit](int x0, int y0, double* out, size_t stride) {
        auto state = make_state();
        for (int y = 0; y < kTile; ++y)
            for (int x = 0; x < kTile; ++x) {
                const Vec3d direction = camera.direction(x0 + x, y0 + y);
                const double length = direction.norm();
                out[size_t(y) * stride + size_t(x)] = hit(state, camera.eye, direction / length) / length;
            }
    };
}

double zero_crossing(auto& accessor, const Vec3d& eye, const Vec3d& direction, bool refine) {
    nanovdb::Ray<float> ray(nano(eye), nano(direction));
    nanovdb::Coord at;
    float value, t;
    if (!nanovdb::ZeroCrossing(ray, accessor, at, value, t)) return kMiss;
    if (!refine) return t;
    const auto sampler = nanovdb::createSampler<1>(accessor);
    const auto sample = [&](float s) { return sampler(nano(eye + double(s) * direction)); };
    float low = t - 1.0f, high = t + 1.0f, at_low = sample(low), at_high = sample(high);
    for (int n = 0; n < 4 && at_low * at_high < 0.0f; ++n) {
        t = low + (high - low) * at_low / (at_low - at_high);
        const float here = sample(t);
        if (here * at_low < 0.0f) {
            high = t;
            at_high = here;
        } else {
            low = t;
            at_low = here;
        }
    }
    return t;
}

void compare(const Scene& scene) {
    const PeerCamera camera(scene.box(), 0.7, kPicture);
    const auto level_set = level_set_of(scene);
    {
        const auto handle = nanovdb::openToNanoVDB(*level_set);
        const auto* const grid = handle.grid<float>();
        for (const bool refine : {false, true})
            print_rays(refine ? "NanoVDB ZeroCrossing and samples" : "NanoVDB ZeroCrossing", scene, camera,
                       one_by_one<float>(camera, [grid] { return grid->getAccessor(); },
                                         [refine](auto& accessor, const Vec3d& eye, const Vec3d& direction) {
                                             return zero_crossing(accessor, eye, direction, refine);
                                         }));
    }
    {
        using Intersector = openvdb::tools::LevelSetRayIntersector<openvdb::FloatGrid>;
        const Intersector whole(*level_set);
        print_rays("OpenVDB LevelSetRayIntersector", scene, camera,
                   one_by_one<double>(camera, [&whole] { return Intersector(whole); },
                                      [](auto& intersector, const Vec3d& eye, const Vec3d& direction) {
                                          const openvdb::math::Ray<double> ray({eye.x(), eye.y(), eye.z()}, {direction.x(), direction.y(), direction.z()});
                                          openvdb::Vec3d at;
                                          if (!intersector.intersectsIS(ray, at)) return kMiss;
                                          return (Vec3d(at.x(), at.y(), at.z()) - eye).dot(direction);
                                      }));
    }
    LeafSource source(*level_set);
    const FieldBricks field = FieldBricks::of_bricks(source, uint64_t{8} << 30, 2);
    const IsoLevel level = {0.0, ContourInside::below};
    const Vec3d eye = camera.eye - field.placement().origin;
    std::printf("| %s, strata: the surface's cells, %.1f ms, %.1f ms | | | | | |\n", scene.name, 1e3 * median_seconds(kTimes, [&] { FieldSurface(field, level, 1); }),
                1e3 * median_seconds(kTimes, [&] { FieldSurface(field, level, 2); }));
    const FieldSurface surface(field, level, 2);
    print_rays("strata, a ray at a time", scene, camera,
               one_by_one<double>(camera, [] { return 0; },
                                  [&surface, eye](int, const Vec3d&, const Vec3d& direction) {
                                      const auto hit = cast_ray(surface, {eye, direction});
                                      return hit ? hit->t : kMiss;
                                  }));
    print_rays("strata, tiles of rays", scene, camera, [&](int x0, int y0, double* out, size_t stride) {
        VoxelTile tile{.first = {eye, camera.direction(x0, y0)}, .width = kTile, .height = kTile};
        tile.direction_per_x = camera.per_x;
        tile.direction_per_y = camera.per_y;
        std::array<FieldHit, size_t(kTile) * kTile> hits;
        cast_tile(surface, tile, 0.0, kMiss, hits);
        for (int y = 0; y < kTile; ++y)
            for (int x = 0; x < kTile; ++x) out[size_t(y) * stride + size_t(x)] = hits[size_t(y) * kTile + size_t(x)].t;
    });
}

Scene sphere(int samples) {
    const double middle = 0.5 * (samples - 1), radius = 0.4 * samples;
    return {"sphere", {samples, samples, samples}, [=](const Vec3d& p) { return (p - Vec3d::Constant(middle)).norm() - radius; }};
}

Scene gyroid(int samples) {
    const double scale = 2.0 * std::numbers::pi * 8.0 / samples, half = 0.5 * (samples - 1);
    return {"gyroid in a sphere", {samples, samples, samples}, [=](const Vec3d& place) {
                const Vec3d p = place - Vec3d::Constant(half), q = scale * p;
                const double sheet = std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) + std::sin(q.z()) * std::cos(q.x());
                return std::max(sheet / (1.2 * scale), p.norm() - 0.45 * samples);
            }};
}

// A volume's surface, in steps that make most of its slopes 1; the truth is the interpolant itself.
Scene scan(const char* path, double isovalue) {
    const auto volume = open_volume(path);
    const auto size = volume->size();
    auto values = std::make_shared<std::vector<float>>(size_t(size[0]) * size[1] * size[2]);
    volume->read(size[2], isovalue, *values);
    const auto at = [values, size](int i, int j, int k) { return double((*values)[(size_t(k) * size[1] + size_t(j)) * size[0] + size_t(i)]); };
    std::vector<double> steps;
    for (uint32_t k = 0; k < size[2]; ++k)
        for (uint32_t j = 0; j < size[1]; ++j)
            for (uint32_t i = 0; i + 1 < size[0]; ++i)
                if (const double a = at(int(i), int(j), int(k)), b = at(int(i) + 1, int(j), int(k)); (a < 0.0) != (b < 0.0)) steps.push_back(std::abs(b - a));
    std::sort(steps.begin(), steps.end());
    const double unit = steps.empty() ? 1.0 : steps[steps.size() / 2];
    const std::array<int, 3> samples = {int(size[0]), int(size[1]), int(size[2])};
    return {"head", samples, [=](const Vec3d& p) {
                std::array<int, 3> low;
                Vec3d part;
                for (int a = 0; a < 3; ++a) {
                    low[size_t(a)] = std::clamp(int(std::floor(p[a])), 0, samples[size_t(a)] - 2);
                    part[a] = std::clamp(p[a] - low[size_t(a)], 0.0, 1.0);
                }
                double sum = 0.0;
                for (int n = 0; n < 8; ++n)
                    sum += (n & 1 ? part[0] : 1 - part[0]) * (n & 2 ? part[1] : 1 - part[1]) * (n & 4 ? part[2] : 1 - part[2]) *
                           at(low[0] + (n & 1), low[1] + (n >> 1 & 1), low[2] + (n >> 2));
                return -sum / unit;
            }};
}

}  // namespace
}  // namespace strata

int main(int argc, char** argv) {
    using namespace strata;
    openvdb::initialize();
    if (argc != 3) {
        std::fprintf(stderr, "usage: isosurface_peers sphere|gyroid SAMPLES, or isosurface_peers VOLUME ISOVALUE\n");
        return 2;
    }
    const std::string what = argv[1];
    std::printf("| M rays/s | 1 thread | 2 threads | hit | off by, voxels: the middle | 1 of 1000 |\n|---|---|---|---|---|---|\n");
    compare(what == "sphere" ? sphere(std::atoi(argv[2])) : what == "gyroid" ? gyroid(std::atoi(argv[2])) : scan(argv[1], std::atof(argv[2])));
    return 0;
}
