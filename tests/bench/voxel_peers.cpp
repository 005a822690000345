// What OpenVDB and NanoVDB take for a mesh's level set, for rays on it and for its voxels on disk, beside ours in the same run.
// A program of its own that prints tables:  voxel_peers MESH [RESOLUTION...]
// NanoVDB's rays stop at the zero of a level set, and in the second table at the first active voxel of the same conservative voxels that ours
// stop at. All rays are those of one picture of 1024 x 1024 that the mesh fills.
#include <nanovdb/util/HDDA.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/Ray.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "core/parallel.h"
#include "core/voxel/mesh_voxels.h"
#include "core/voxel/ray_cast.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/mesh/mesh_reader.h"
#include "io/svo/svo_writer.h"
#include "io/vdb/vdb_writer.h"
#include "tests/bench/peer_view.h"

namespace strata {
namespace {

constexpr int kPicture = 1024, kTile = 32, kTimes = 5;

struct Counted {
    double seconds = 0.0;
    uint64_t hits = 0;
};

// Rows of tiles of the picture, each by one thread; cast gives the hits of one tile.
Counted cast_picture(int threads, const std::function<uint64_t(int x, int y)>& cast) {
    Counted counted;
    counted.seconds = median_seconds(kTimes, [&] {
        std::atomic<uint64_t> hits = 0;
        parallel_blocks(threads, kPicture / kTile, 1, [&](size_t begin, size_t end) {
            uint64_t found = 0;
            for (size_t row = begin; row < end; ++row)
                for (int x = 0; x < kPicture; x += kTile) found += cast(x, int(row) * kTile);
            hits += found;
        });
        counted.hits = hits;
    });
    return counted;
}

using NanoRay = nanovdb::Ray<float>;
nanovdb::Vec3f nano(const Vec3d& v) { return {float(v.x()), float(v.y()), float(v.z())}; }

// Casts the tile's rays in index space; hit(ray) with an accessor of its own.
template <typename Grid, typename Hit>
Counted cast_nano(const Grid& grid, const PeerCamera& camera, int threads, const Hit& hit) {
    return cast_picture(threads, [&](int x0, int y0) {
        auto accessor = grid.getAccessor();
        uint64_t hits = 0;
        for (int y = y0; y < y0 + kTile; ++y)
            for (int x = x0; x < x0 + kTile; ++x) {
                const Vec3d direction = (camera.first + x * camera.per_x + y * camera.per_y).normalized();
                NanoRay ray(nano(camera.eye), nano(direction));
                hits += hit(ray, accessor);
            }
        return hits;
    });
}

// The first active voxel, by the same hierarchical walk that NanoVDB's ZeroCrossing makes.
template <typename Accessor>
bool first_active(NanoRay& ray, Accessor& accessor) {
    if (!ray.clip(accessor.root().bbox()) || ray.t1() > 1e20f) return false;
    nanovdb::Coord at = nanovdb::RoundDown<nanovdb::Coord>(ray.start());
    nanovdb::HDDA<NanoRay, nanovdb::Coord> walk(ray, int(accessor.getDim(at, ray)));
    do {
        at = nanovdb::RoundDown<nanovdb::Coord>(ray(walk.time() + 1.0001f));
        walk.update(ray, int(accessor.getDim(at, ray)));
        if (walk.dim() > 1) continue;
        do
            if (accessor.isActive(walk.voxel())) return true;
        while (walk.step() && accessor.getDim(walk.voxel(), ray) == 1);
    } while (walk.step());
    return false;
}

void print_rays(const char* what, int resolution, const std::function<Counted(int threads)>& cast) {
    const Counted one = cast(1), two = cast(2);
    const double rays = double(kPicture) * kPicture;
    std::printf("| %s, %d | %.1f | %.1f | %.3f %% |\n", what, resolution, rays / one.seconds / 1e6, rays / two.seconds / 1e6, 100.0 * double(two.hits) / rays);
}

openvdb::FloatGrid::Ptr openvdb_level_set(const TriangleMesh& mesh, double voxel_size, int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    for (const Vec3d& p : mesh.positions) points.emplace_back(p.x(), p.y(), p.z());
    for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
    return openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*openvdb::math::Transform::createLinearTransform(voxel_size), points, triangles);
}

VoxelTree conservative_tree(const TriangleMesh& mesh, const VoxelFrame& frame, int threads) {
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    voxelize_mesh(mesh, frame, {.threads = threads}, [&](const VoxelBatch& batch) { builder.add(batch); });
    builder.finish();
    return memory.take();
}

void compare_times(const TriangleMesh& mesh, int resolution) {
    const VoxelFrame frame = frame_of_resolution(mesh.bounds(), uint32_t(resolution));
    for (const int threads : {1, 2}) {
        const double level_set = median_seconds(3, [&] { openvdb_level_set(mesh, frame.voxel_size, threads); });
        uint64_t voxels = 0;
        const double conservative = median_seconds(3, [&] { voxels = count_voxels(conservative_tree(mesh, frame, threads)); });
        std::printf("| %d, %d | %.2f | %.3f | %.1f |\n", resolution, threads, level_set, conservative, double(voxels) / conservative / 1e6);
    }
}

void compare_rays(const TriangleMesh& mesh, int resolution) {
    const VoxelFrame frame = frame_of_resolution(mesh.bounds(), uint32_t(resolution));
    {
        const auto handle = nanovdb::openToNanoVDB(*openvdb_level_set(mesh, frame.voxel_size, 2));
        Box3d box;  // index space
        for (const Vec3d& p : mesh.positions) box.extend(p / frame.voxel_size);
        const PeerCamera camera(box, 1.0, kPicture);
        print_rays("NanoVDB HDDA, level set", resolution, [&](int threads) {
            return cast_nano(*handle.grid<float>(), camera, threads, [](NanoRay& ray, auto& accessor) {
                nanovdb::Coord at;
                float value, t;
                return nanovdb::ZeroCrossing(ray, accessor, at, value, t);
            });
        });
    }
    const VoxelTree tree = conservative_tree(mesh, frame, 2);
    Box3d box;
    for (const Vec3d& p : mesh.positions) box.extend(frame.voxel_from_world(p));
    const PeerCamera camera(box, 1.0, kPicture);
    {
        const auto mask = openvdb::MaskGrid::create();
        auto accessor = mask->getAccessor();
        voxelize_mesh(mesh, frame, {.threads = 2}, [&](const VoxelBatch& batch) {
            for (const VoxelBlock& block : batch.blocks)
                for (uint64_t left = block.mask; left != 0; left &= left - 1) {
                    const auto [x, y, z] = coordinates_of_code(block.code * 64 + uint64_t(std::countr_zero(left)));
                    accessor.setValueOn({int(x), int(y), int(z)});
                }
        });
        const auto handle = nanovdb::openToNanoVDB<nanovdb::HostBuffer, openvdb::MaskTree>(*mask);
        const auto* const grid = handle.grid<nanovdb::ValueMask>();
        print_rays("NanoVDB HDDA, the same voxels as a mask", resolution, [&](int threads) {
            return cast_nano(*grid, camera, threads, [](NanoRay& ray, auto& nano_accessor) { return first_active(ray, nano_accessor); });
        });
    }
    print_rays("strata, one ray at a time", resolution, [&](int threads) {
        return cast_picture(threads, [&](int x0, int y0) {
            uint64_t hits = 0;
            for (int y = y0; y < y0 + kTile; ++y)
                for (int x = x0; x < x0 + kTile; ++x)
                    hits += cast_ray(tree, {camera.eye, camera.first + x * camera.per_x + y * camera.per_y}).has_value();
            return hits;
        });
    });
    print_rays("strata, tiles of rays", resolution, [&](int threads) {
        return cast_picture(threads, [&](int x0, int y0) {
            std::array<VoxelHit, size_t(kTile) * kTile> found;
            VoxelTile tile{.first = {camera.eye, camera.first + x0 * camera.per_x + y0 * camera.per_y}, .width = kTile, .height = kTile};
            tile.direction_per_x = camera.per_x;
            tile.direction_per_y = camera.per_y;
            cast_tile(tree, tile, {}, found);
            return uint64_t(std::count_if(found.begin(), found.end(), [](const VoxelHit& hit) { return hit.depth > 0; }));
        });
    });
}

void compare_sizes(const TriangleMesh& mesh, int resolution, const std::string& folder) {
    const VoxelFrame frame = frame_of_resolution(mesh.bounds(), uint32_t(resolution));
    uint64_t voxels = 0;
    const auto row = [&](const std::string& what, uint64_t bytes) {
        std::printf("| %s | %.2f MB | %.3f |\n", what.c_str(), double(bytes) / 1e6, double(bytes) / double(voxels));
    };
    std::printf("\n| %d | size | bytes a voxel |\n|---|---|---|\n", resolution);
    {
        SvoWriter writer(folder + "/a.svo", true, frame, {.kind = "conservative"});
        VoxelTreeBuilder builder(frame, {}, writer);
        voxelize_mesh(mesh, frame, {.threads = 2}, [&](const VoxelBatch& batch) { builder.add(batch); });
        voxels = builder.finish().voxels;
        row(".svo", writer.commit(voxels, Durability::unsynced));
    }
    for (const bool as_mask : {true, false})
        for (const auto& [name, compression] : {std::pair("none", VdbCompression::none), std::pair("blosc", VdbCompression::blosc), std::pair("zip", VdbCompression::zip)}) {
            if (as_mask && compression != VdbCompression::none) continue;  // nothing of a mask is compressed
            VdbWriter writer(folder + "/a.vdb", true, frame, {.as_mask = as_mask, .half = !as_mask, .compression = compression});
            voxelize_mesh(mesh, frame, {.threads = 2}, [&](const VoxelBatch& batch) { writer.add(batch); });
            row(std::string(".vdb, ") + (as_mask ? "mask" : std::string("fog of 16 bits, ") + name), writer.commit(Durability::unsynced));
        }
    openvdb::io::File file(folder + "/a.vdb");
    const auto mask = openvdb::MaskGrid::create();
    {
        VdbWriter writer(folder + "/a.vdb", true, frame, {.as_mask = true});
        voxelize_mesh(mesh, frame, {.threads = 2}, [&](const VoxelBatch& batch) { writer.add(batch); });
        writer.commit(Durability::unsynced);
        file.open(false);
        mask->setTree(openvdb::gridPtrCast<openvdb::MaskGrid>(file.readGrid("occupancy"))->treePtr());
    }
    auto handle = nanovdb::openToNanoVDB<nanovdb::HostBuffer, openvdb::MaskTree>(*mask);
    row("NanoVDB mask, in memory", handle.size());
    for (const auto& [name, codec] : {std::pair("blosc", nanovdb::io::Codec::BLOSC), std::pair("zip", nanovdb::io::Codec::ZIP)}) {
        nanovdb::io::writeGrid(folder + "/a.nvdb", handle, codec);
        row(std::string("NanoVDB mask, .nvdb, ") + name, std::filesystem::file_size(folder + "/a.nvdb"));
    }
}

}  // namespace
}  // namespace strata

int main(int argc, char** argv) {
    using namespace strata;
    if (argc < 2) {
        std::fprintf(stderr, "usage: voxel_peers MESH [RESOLUTION...]\n");
        return 2;
    }
    openvdb::initialize();
    const TriangleMesh mesh = read_mesh(argv[1], {.triangles_needed = true});
    std::vector<int> resolutions;
    for (int i = 2; i < argc; ++i) resolutions.push_back(std::atoi(argv[i]));
    if (resolutions.empty()) resolutions = {512, 1024};
    const std::string folder = std::filesystem::temp_directory_path() / "strata-voxel-peers";
    std::filesystem::create_directories(folder);
    std::printf("%zu triangles\n\n| resolution, threads | OpenVDB meshToLevelSet, s | strata conservative and tree, s | M voxels/s |\n|---|---|---|---|\n", mesh.triangles.size());
    for (const int resolution : resolutions) compare_times(mesh, resolution);
    std::printf("\n| M rays/s | 1 thread | 2 threads | hit |\n|---|---|---|---|\n");
    for (const int resolution : resolutions) compare_rays(mesh, resolution);
    for (const int resolution : resolutions) compare_sizes(mesh, resolution, folder);
    std::filesystem::remove_all(folder);
    return 0;
}
