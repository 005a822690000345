// What VTK and OpenVDB take for the isosurface of a field, beside ours in the same run, on the same threads: medians, triangles, and what
// the process grew by meanwhile. A program of its own that prints tables:  surface_peers [dense|bricks] [SAMPLES...]
// The field is a gyroid within a sphere, in voxels from its surface as far as a gyroid's can be told; OpenVDB gets the level set of its
// samples nearer than three. Memory counts the result and what making it needed at most, not the field.
#include <openvdb/openvdb.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>

#include "core/parallel.h"
#include "core/surface/contour.h"
#include "tests/bench/vtk_contours.h"

namespace strata {
namespace {

constexpr int kTimes = 5;
constexpr float kBand = 3.0f;

// Kilobytes by the name that /proc/self/status gives them.
double megabytes_of(const std::string& name) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(name)) return std::atof(line.c_str() + name.size() + 1) / 1024.0;
    return 0.0;
}

struct Measured {
    double seconds = 0.0, megabytes = 0.0;
    uint64_t triangles = 0;
};

/// act  makes a surface and returns how many triangles it has, its memory is free afterwards
Measured measure(const std::function<uint64_t()>& act) {
    Measured measured;
    std::vector<double> times;
    for (int n = 0; n < kTimes; ++n) {
        std::ofstream("/proc/self/clear_refs") << "5";  // the peak begins anew
        const double before = megabytes_of("VmRSS:");
        const auto start = std::chrono::steady_clock::now();
        measured.triangles = act();
        times.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        measured.megabytes = std::max(measured.megabytes, megabytes_of("VmHWM:") - before);
    }
    std::sort(times.begin(), times.end());
    measured.seconds = times[times.size() / 2];
    return measured;
}

void print(const char* what, int samples, int threads, const Measured& measured, double of_ours) {
    std::printf("| %s, %d^3 | %d | %.3f | %.2f | %.0f | %.2f |\n", what, samples, threads, measured.seconds, measured.seconds / of_ours,
                measured.megabytes, double(measured.triangles) / 1e6);
    std::fflush(stdout);
}

ScalarGrid gyroid_in_sphere(int samples) {
    const auto side = uint32_t(samples);
    ScalarGrid grid{.placement = {}, .size = {side, side, side}, .values = std::vector<float>(size_t(side) * side * side)};
    const double scale = 2.0 * std::numbers::pi * 8.0 / samples, half = 0.5 * (samples - 1);
    parallel_blocks(default_thread_count(), side, 1, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end; ++k)
            for (size_t j = 0; j < side; ++j)
                for (size_t i = 0; i < side; ++i) {
                    const double x = double(i) - half, y = double(j) - half, z = double(k) - half;
                    const double sheet = std::sin(scale * x) * std::cos(scale * y) + std::sin(scale * y) * std::cos(scale * z) +
                                         std::sin(scale * z) * std::cos(scale * x);
                    const double sphere = std::sqrt(x * x + y * y + z * z) - 0.45 * samples;
                    grid.values[(k * side + j) * side + i] = float(std::max(sheet / (1.2 * scale), sphere));
                }
    });
    return grid;
}

uint64_t contour_whole(const ScalarGrid& grid, int threads) {
    ContourMesh mesh;
    return contour_grid(grid.placement, grid.size, grid.values, {.isovalues = {0.0}, .inside = ContourInside::below, .threads = threads},
                        mesh)
        .triangles;
}

openvdb::FloatGrid::Ptr level_set_of(const ScalarGrid& grid) {
    const auto level_set = openvdb::FloatGrid::create(kBand);
    auto accessor = level_set->getAccessor();
    const int side = int(grid.size[0]);
    for (int x = 0; x < side; ++x)  // their nodes have x slowest
        for (int y = 0; y < side; ++y)
            for (int z = 0; z < side; ++z) {
                const float v = grid.values[(size_t(z) * side + y) * side + x];
                if (std::abs(v) < kBand) accessor.setValue({x, y, z}, v);
            }
    level_set->setGridClass(openvdb::GRID_LEVEL_SET);
    openvdb::tools::signedFloodFill(level_set->tree());
    return level_set;
}

// The leaves of a grid as they lie in memory, where z runs fastest: i is z, and k is x.
class LeafSource : public FieldBrickSource {
public:
    explicit LeafSource(const openvdb::FloatGrid& grid) : accessor_(grid.getConstAccessor()), background_(grid.background()) {
        placement_.axes << 0, 0, 1, 0, 1, 0, 1, 0, 0;
        for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) leaves_.push_back(&*leaf);
        std::sort(leaves_.begin(), leaves_.end(), [](const Leaf* a, const Leaf* b) { return a->origin() < b->origin(); });
    }
    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return background_; }
    float absent_value(const std::array<int32_t, 3>& corner) const override {
        return accessor_.getValue({corner[2], corner[1], corner[0]});
    }
    bool next_layer(FieldBrickLayer& out) override {
        if (next_ == leaves_.size()) return false;
        out.k = leaves_[next_]->origin().x();
        out.corners.clear();
        size_t end = next_;
        for (; end < leaves_.size() && leaves_[end]->origin().x() == out.k; ++end)
            out.corners.push_back({leaves_[end]->origin().z(), leaves_[end]->origin().y()});
        out.values.resize(out.corners.size() * kFieldBrickSamples);
        for (size_t n = 0; next_ < end; ++next_, ++n)
            std::memcpy(out.values.data() + n * kFieldBrickSamples, leaves_[next_]->buffer().data(), kFieldBrickSamples * sizeof(float));
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

uint64_t contour_leaves(const openvdb::FloatGrid& grid, int threads) {
    LeafSource source(grid);
    ContourMesh mesh;
    return contour_bricks(source, {.isovalues = {0.0}, .inside = ContourInside::below, .threads = threads}, mesh).triangles;
}

uint64_t contour_by_openvdb(const openvdb::FloatGrid& grid, int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(grid, points, triangles, quads, 0.0, 0.0);
    return triangles.size() + 2 * quads.size();
}

void compare_dense(int samples) {
    const ScalarGrid grid = gyroid_in_sphere(samples);
    for (const int threads : {1, 2}) {
        const Measured ours = measure([&] { return contour_whole(grid, threads); });
        print("strata contour_grid", samples, threads, ours, ours.seconds);
        print("vtkFlyingEdges3D", samples, threads, measure([&] { return flying_edges(grid.values.data(), samples, threads); }),
              ours.seconds);
        if (threads == 1)
            print("vtkMarchingCubes", samples, 1, measure([&] { return vtk_marching_cubes(grid.values.data(), samples); }), ours.seconds);
    }
}

void compare_bricks(int samples) {
    const auto level_set = level_set_of(gyroid_in_sphere(samples));
    for (const int threads : {1, 2}) {
        const Measured ours = measure([&] { return contour_leaves(*level_set, threads); });
        print("strata contour_bricks", samples, threads, ours, ours.seconds);
        print("OpenVDB volumeToMesh", samples, threads, measure([&] { return contour_by_openvdb(*level_set, threads); }), ours.seconds);
    }
}

}  // namespace
}  // namespace strata

int main(int argc, char** argv) {
    openvdb::initialize();
    bool dense = true, bricks = true;
    std::vector<int> samples;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word == "dense" || word == "bricks") (word == "dense" ? bricks : dense) = false;
        else samples.push_back(std::atoi(argv[i]));
    }
    std::printf("| what, samples | threads | seconds | of ours | MB | M triangles |\n|---|---|---|---|---|---|\n");
    for (const int n : samples.empty() ? std::vector<int>{256} : samples) {
        if (dense) strata::compare_dense(n);
        if (bricks) strata::compare_bricks(n);
    }
    return 0;
}
