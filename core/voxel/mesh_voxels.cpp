#include "core/voxel/mesh_voxels.h"

#include <string>

#include "core/error.h"
#include "core/voxel/brick_bins.h"
#include "core/voxel/grid_mesh.h"
#include "core/voxel/hole_caps.h"
#include "core/voxel/ordered_batches.h"
#include "core/voxel/solid_bricks.h"

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

void voxelize_surface(const GridMesh& grid, const BrickBins& bins, const MeshVoxelSettings& settings, const VoxelSink& sink) {
    std::vector<BrickWorker> workers(size_t(std::max(settings.threads, 1)));
    batches_in_order(
        settings.threads, bins.bricks().size(),
        [&](int worker, size_t job, VoxelBatch& batch) {
            auto& [scanner, masks] = workers[size_t(worker)];
            const BrickBins::Brick& brick = bins.bricks()[job];
            const CellRange clip = voxels_of_brick(grid.frame(), brick.code);
            const auto add = [&](int w, int32_t u, int32_t v, int32_t first, int32_t last) { masks.add(w, u, v, first, last); };
            for (const uint32_t i : bins.triangles(brick)) {
                const GridTriangle t = grid[i];
                if (settings.kind == VoxelKind::conservative) scanner.scan_touched(t, grid.bits(), clip, add);
                else
                    for (int w = 0; w < 3; ++w) scanner.scan_centers(t, w, grid.bits(), clip, add);
            }
            masks.take_blocks(brick.code, batch.blocks);
        },
        [&](size_t job, const VoxelBatch& batch) {
            if (!batch.blocks.empty()) sink(batch);
            if (settings.on_progress) settings.on_progress({job + 1, bins.bricks().size()});
        });
}

void voxelize_solid(const GridMesh& grid, const HoleCaps& holes, size_t first_cap, const BrickBins& bins, const MeshVoxelSettings& settings,
                    const VoxelSink& sink) {
    const BrickWindings windings(grid, settings.threads);
    const SolidPlan plan = plan_solid(grid, bins, windings, holes);
    std::vector<SolidBrick> workers(size_t(std::max(settings.threads, 1)), SolidBrick(grid, holes, first_cap));
    batches_in_order(
        settings.threads, plan.jobs.size(),
        [&](int worker, size_t i, VoxelBatch& batch) {
            const SolidJob& job = plan.jobs[i];
            batch.blocks.assign(plan.cubes.begin() + std::ptrdiff_t(job.first_cube), plan.cubes.begin() + std::ptrdiff_t(job.last_cube));
            if (job.has_brick)
                workers[size_t(worker)].fill(job.code, job.triangles, windings.at(coordinates_of_code(job.code)), batch.blocks);
        },
        [&](size_t i, const VoxelBatch& batch) {
            if (!batch.blocks.empty()) sink(batch);
            if (settings.on_progress) settings.on_progress({i + 1, plan.jobs.size()});
        });
}

}  // namespace

void voxelize_mesh(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings, const VoxelSink& sink) {
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
        voxelize_surface(grid, BrickBins(grid, settings.threads, memory_left), settings, sink);
        return;
    }
    check(HoleCaps::memory_needed(mesh), "edges of the mesh");
    const HoleCaps holes(mesh, grid);
    const size_t first_cap = grid.size();
    for (const auto& cap : holes.caps()) grid.add(cap);
    voxelize_solid(grid, holes, first_cap, BrickBins(grid, settings.threads, memory_left), settings, sink);
}

}  // namespace strata
