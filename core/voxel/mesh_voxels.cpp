#include "core/voxel/mesh_voxels.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <span>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "core/voxel/brick_bins.h"
#include "core/voxel/grid_mesh.h"
#include "core/voxel/hole_caps.h"
#include "core/voxel/ordered_output.h"
#include "core/voxel/solid_bricks.h"
#include "core/voxel/surface_attributes.h"

namespace strata {
namespace {

constexpr size_t kMasks = size_t{1} << 3 * (kBrickBits - 2);

// The voxels of a brick in Morton order.
class BrickMasks {
public:
    BrickMasks() : masks_(kMasks) {
        for (uint32_t i = 0; i < kBrickSide; ++i) {
            code_[0][i] = uint32_t(octant_code(i, 0, 0));
            code_[1][i] = uint32_t(octant_code(0, i, 0));
            code_[2][i] = uint32_t(octant_code(0, 0, i));
        }
    }

    /// A run along axis w at u along axis w + 1 and v along w + 2 (mod 3), in voxels of the frame.
    void add(int w, int32_t u, int32_t v, int32_t first, int32_t last) {
        const size_t sw = size_t(w), su = sw == 2 ? 0 : sw + 1, sv = 3 - sw - su;
        const uint32_t at = code_[su][size_t(u) % kBrickSide] | code_[sv][size_t(v) % kBrickSide];
        for (int32_t k = first; k <= last; ++k) {
            const uint32_t code = at | code_[sw][size_t(k) % kBrickSide];
            masks_[code >> 6] |= uint64_t{1} << (code & 63);
        }
    }

    std::span<const uint64_t> masks() const { return masks_; }

    /// Of a voxel of the frame, its place in the brick's order.
    uint32_t place(const std::array<int32_t, 3>& voxel) const {
        uint32_t place = 0;
        for (size_t a = 0; a < 3; ++a) place |= code_[a][size_t(voxel[a]) % kBrickSide];
        return place;
    }

    /// Appends the blocks of the brick and forgets them.
    void take_blocks(uint64_t brick, std::vector<VoxelBlock>& blocks) {
        for (size_t i = 0; i < kMasks; ++i) {
            if (masks_[i] == 0) continue;
            blocks.push_back({brick * kMasks + i, masks_[i], 0});
            masks_[i] = 0;
        }
    }

private:
    std::vector<uint64_t> masks_;
    std::array<std::array<uint32_t, kBrickSide>, 3> code_;
};

// What a thread keeps.
struct BrickWorker {
    TriangleScanner scanner;
    BrickMasks masks;
    SurfaceAttributes attributes;
};

CellRange voxels_of_brick(const VoxelFrame& frame, uint64_t code) {
    const std::array<uint32_t, 3> brick = coordinates_of_code(code);
    CellRange range;
    for (size_t a = 0; a < 3; ++a) {
        range.first[a] = int32_t(brick[a] << kBrickBits);
        range.last[a] = range.first[a] + int32_t(std::min(frame.side(), kBrickSide)) - 1;
    }
    return range;
}

// Makes the batches of all jobs side by side.
// make  of worker, job and batch; worker: 0 ... threads - 1
template <class Make>
void make_in_order(size_t jobs, const MeshVoxelSettings& settings, const VoxelSink& sink, const Make& make) {
    const int threads = int(std::clamp<size_t>(jobs, 1, size_t(std::max(settings.threads, 1))));
    OrderedOutput output(sink, 4 * uint64_t(threads));  // so that a long job does not stop the others at once
    std::atomic<size_t> next = 0;
    std::mutex done_mutex;
    uint64_t done = 0;
    parallel_workers(threads, [&](int worker) {
        try {
            for (size_t job; (job = next++) < jobs && output.begin(job);) {
                VoxelBatch batch = output.batch();
                make(size_t(worker), job, batch);
                output.deliver(job, std::move(batch));
                const std::lock_guard lock(done_mutex);
                ++done;
                if (settings.on_progress) settings.on_progress({done, jobs});
            }
        } catch (...) {
            output.fail();
            throw;
        }
    });
}

void voxelize_surface(const TriangleMesh& mesh, const GridMesh& grid, const BrickBins& bins, const MeshVoxelSettings& settings,
                      const VoxelSink& sink) {
    std::vector<BrickWorker> workers(size_t(std::max(settings.threads, 1)), BrickWorker{.attributes = {mesh, grid, settings.attributes}});
    make_in_order(bins.bricks().size(), settings, sink, [&](size_t worker, size_t job, VoxelBatch& batch) {
        auto& [scanner, masks, attributes] = workers[worker];
        const BrickBins::Brick& brick = bins.bricks()[job];
        const CellRange clip = voxels_of_brick(grid.frame(), brick.code);
        const auto scan = [&](size_t i, auto&& visit) {
            const GridTriangle t = grid[i];
            if (settings.kind == VoxelKind::conservative) scanner.scan_touched(t, grid.bits(), clip, visit);
            else
                for (int w = 0; w < 3; ++w) scanner.scan_centers(t, w, grid.bits(), clip, visit);
        };
        for (const uint32_t i : bins.triangles(brick))
            scan(i, [&](int w, int32_t u, int32_t v, int32_t first, int32_t last) { masks.add(w, u, v, first, last); });
        if (settings.attributes.any_of_voxels()) {
            attributes.start(masks.masks());
            for (const uint32_t i : bins.triangles(brick)) {
                attributes.take_triangle(i);
                scan(i, [&](int w, int32_t u, int32_t v, int32_t first, int32_t last) {
                    std::array<int32_t, 3> voxel;
                    voxel[size_t(w + 1) % 3] = u;
                    voxel[size_t(w + 2) % 3] = v;
                    for (int32_t& k = voxel[size_t(w)] = first; k <= last; ++k) attributes.add(masks.place(voxel), voxel);
                });
            }
            attributes.append_columns(batch);
        }
        masks.take_blocks(brick.code, batch.blocks);
    });
}

void voxelize_solid(const GridMesh& grid, const HoleCaps& holes, size_t first_cap, const BrickBins& bins, const MeshVoxelSettings& settings,
                    const VoxelSink& sink) {
    const BrickWindings windings(grid, settings.threads);
    const SolidPlan plan = plan_solid(grid, bins, windings, holes);
    std::vector<SolidBrick> workers(size_t(std::max(settings.threads, 1)), SolidBrick(grid, holes, first_cap));
    make_in_order(plan.jobs.size(), settings, sink, [&](size_t worker, size_t i, VoxelBatch& batch) {
        const SolidJob& job = plan.jobs[i];
        batch.blocks.assign(plan.cubes.begin() + std::ptrdiff_t(job.first_cube), plan.cubes.begin() + std::ptrdiff_t(job.last_cube));
        if (job.has_brick) workers[worker].fill(job.code, job.triangles, windings.at(coordinates_of_code(job.code)), batch.blocks);
    });
}

}  // namespace

void voxelize_mesh(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings, const VoxelSink& sink) {
    if (settings.attributes.count) throw Error(ErrorKind::usage, "voxels of a mesh have no count of points");
    if (settings.attributes.color && mesh.colors.empty()) throw Error(ErrorKind::usage, "the mesh has no colors");
    if (settings.attributes.any_of_voxels() && settings.kind == VoxelKind::solid)
        throw Error(ErrorKind::usage, "voxels of a solid have no attributes");
    uint64_t memory_left = settings.memory_bytes;
    const auto check = [&](uint64_t bytes, const char* what) {
        if (bytes > memory_left)
            throw Error(ErrorKind::limit, std::string(what) + " take " + std::to_string((bytes >> 20) + 1) + " MiB of memory, " +
                                              std::to_string(memory_left >> 20) + " MiB are left");
        return bytes;
    };
    memory_left -= check(mesh.positions.size() * sizeof(std::array<int32_t, 3>), "snapped vertices");
    GridMesh grid(mesh, frame, settings.threads);
    if (settings.kind != VoxelKind::solid) {
        voxelize_surface(mesh, grid, BrickBins(grid, settings.threads, memory_left), settings, sink);
        return;
    }
    check(HoleCaps::memory_needed(mesh), "edges of the mesh");
    const HoleCaps holes(mesh, grid);
    const size_t first_cap = grid.size();
    for (const auto& cap : holes.caps()) grid.add(cap);
    voxelize_solid(grid, holes, first_cap, BrickBins(grid, settings.threads, memory_left), settings, sink);
}

}  // namespace strata
