#include "core/surface/cube_surface.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "core/error.h"
#include "core/idle_pool.h"
#include "core/math/frustum.h"
#include "core/octree/node_selection.h"
#include "core/parallel.h"
#include "core/surface/cube_faces.h"
#include "core/surface/cube_mesh.h"
#include "core/surface/tree_bricks.h"
#include "core/voxel/voxel_bounds.h"

namespace strata {
namespace {

constexpr size_t kPartsInView = 4096;  // whose depths decide how near voxels are seen
constexpr size_t kBricksAThread = 4;  // that may wait for their turn

template <class T>
uint64_t bytes_of(const std::vector<T>& list) {
    return list.capacity() * sizeof(T);
}

// What finds the faces of a brick, one per thread.
struct Worker {
    CubeBrick brick;
    CubeFaceFinder finder;
    CubeRectangles rectangles;
    std::unique_ptr<CubeMesher> mesher;
};

// A brick's part of the surface. Faces refer to its vertices.
struct Part {
    size_t brick = 0;
    CubeMesh mesh;
    std::vector<Vec3f> positions;                // [vertices]
    std::vector<std::array<uint8_t, 4>> colors;  // [vertices] or empty, as are
    std::vector<Vec3f> normals;
    uint64_t faces = 0, rectangles = 0;
    // closed: vertices on the outside of the brick, ascending by corner and material, and their numbers here.
    std::vector<std::pair<CubeVertex, uint32_t>> shared;
    uint64_t bytes_counted = 0;

    uint64_t bytes() const {
        return bytes_of(mesh.vertices) + bytes_of(mesh.triangles) + bytes_of(mesh.quads) + bytes_of(positions) + bytes_of(colors) + bytes_of(normals) + bytes_of(shared);
    }
};

class CubeSurface {
public:
    CubeSurface(const CubeBrickSource& bricks, const CubeSurfaceSettings& settings, SurfaceSink& out) : settings_(settings), out_(out), bricks_(bricks), placement_(bricks.placement()) {
        materials_.by_color = settings.colors && bricks.has_colors();
        for (const auto& [color, opacity] : settings.transparent)
            if (opacity < 255) materials_.transparent.push_back(color);
        const Mat3d across = placement_.axes.inverse().transpose();
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {0, 1}) normals_[size_t(2 * axis + side)] = ((side == 0 ? 1.0 : -1.0) * across.col(axis).normalized()).cast<float>() + Vec3f::Zero();
    }

    CubeSurfaceCounts run() {
        counts_.solid_voxels = bricks_.cells();
        counts_.faces_uncut = 6 * counts_.solid_voxels;
        hold(bricks_.memory_bytes() + (closed() ? bricks_.size() * (sizeof corners_[0] + sizeof shared_[0]) : 0));
        if (closed()) find_corners();
        put_all();
        return counts_;
    }

private:
    bool closed() const { return settings_.joints == CubeSurfaceSettings::Joints::closed; }

    void hold(uint64_t bytes) {
        const uint64_t held = held_bytes_.fetch_add(bytes) + bytes;
        if (held > settings_.memory_bytes)
            throw Error(ErrorKind::limit, "faces of cubes need " + std::to_string(held * settings_.memory_parts) + " bytes of memory or more, " + std::to_string(settings_.memory_bytes * settings_.memory_parts) + " are allowed; " + std::string(bricks_.advice()));
    }
    template <class T>
    void let_go(std::vector<T>& list) {
        held_bytes_ -= bytes_of(list);
        std::vector<T>().swap(list);
    }

    std::unique_ptr<Worker> take_worker() {
        return workers_.take([] { return std::make_unique<Worker>(); });
    }

    // The corners of each brick's rectangles that others may have on their edges.
    void find_corners() {
        corners_.resize(bricks_.size());
        shared_.resize(bricks_.size());
        parallel_blocks(settings_.threads, bricks_.size(), kBricksAThread, [&](size_t begin, size_t end) {
            std::unique_ptr<Worker> worker = take_worker();
            for (size_t brick = begin; brick < end; ++brick)
                if (bricks_.gather(brick, materials_, worker->brick)) {
                    worker->finder.find(worker->brick, worker->rectangles);
                    corners_[brick] = shared_corners(worker->rectangles);
                    hold(bytes_of(corners_[brick]));
                }
            workers_.give_back(std::move(worker));
            const std::lock_guard lock(progress_mutex_);
            report_progress(end - begin);
        });
    }

    // bricks  more that are done, each twice where corners are found first
    void report_progress(size_t bricks) {
        done_bricks_ += bricks;
        const double share = double(done_bricks_) / double(bricks_.size() * (closed() ? 2 : 1));
        if (settings_.on_progress) settings_.on_progress(std::min(counts_.solid_voxels, uint64_t(share * double(counts_.solid_voxels))), counts_.solid_voxels);
    }

    // Bricks are made side by side and put out in their order, by whoever is done when one's turn has come, for all.
    void put_all() {
        const size_t window = kBricksAThread * size_t(std::max(settings_.threads, 1));
        std::vector<Part> parts(window);
        std::vector<char> made(window);
        std::mutex mutex;
        std::condition_variable moved;
        size_t begun = 0, next = 0;  // of bricks
        bool putting = false, failed = false;
        parallel_workers(settings_.threads, [&](int) {
            std::unique_ptr<Worker> worker = take_worker();
            std::unique_lock lock(mutex);
            try {
                for (;;) {
                    moved.wait(lock, [&] { return failed || begun == bricks_.size() || begun < next + window; });
                    if (failed || begun == bricks_.size()) return;
                    const size_t brick = begun++;
                    lock.unlock();
                    Part& part = parts[brick % window];
                    make(brick, *worker, part);
                    held_bytes_ -= part.bytes_counted;
                    hold(part.bytes_counted = part.bytes());
                    lock.lock();
                    made[brick % window] = 1;
                    while (!putting && !failed && made[next % window] != 0) {
                        putting = true;
                        lock.unlock();
                        put_in_turn(parts[next % window]);
                        lock.lock();
                        putting = false;
                        made[next++ % window] = 0;
                        moved.notify_all();
                    }
                }
            } catch (...) {
                if (!lock.owns_lock()) lock.lock();
                failed = true;
                moved.notify_all();
                throw;
            }
        });
    }

    template <class Visit>  // of each of the 26 neighbors that there are: number, step to it in bricks
    void visit_neighbors(size_t brick, const Visit& visit) const {
        const std::array<uint32_t, 3> place = bricks_.place(brick);
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    if (x == 0 && y == 0 && z == 0) continue;
                    const size_t neighbor = bricks_.find({int64_t{place[0]} + x, int64_t{place[1]} + y, int64_t{place[2]} + z});
                    if (neighbor != TreeBricks::kNone) visit(neighbor, std::array<int, 3>{x, y, z});
                }
    }

    void make(size_t brick, Worker& worker, Part& part) const {
        part.brick = brick;
        part.mesh.vertices.clear();
        part.mesh.triangles.clear();
        part.mesh.quads.clear();
        part.shared.clear();
        part.faces = part.rectangles = 0;
        if (bricks_.gather(brick, materials_, worker.brick)) {
            worker.finder.find(worker.brick, worker.rectangles);
            part.rectangles = worker.rectangles.size();
            for (const CubeRectangle& r : std::span(worker.rectangles.all).first(part.rectangles)) part.faces += r.width() * r.height();
            if (closed()) join(worker, part);
            else separate(worker.rectangles, part);
        }
        place_vertices(part);
    }

    void join(Worker& worker, Part& part) const {
        if (!worker.mesher) worker.mesher = std::make_unique<CubeMesher>();
        worker.mesher->begin(worker.rectangles);
        visit_neighbors(part.brick,
                        [&](size_t neighbor, const std::array<int, 3>& step) { worker.mesher->add_corners(corners_[neighbor], step); });
        worker.mesher->finish(worker.rectangles, settings_.normals, part.mesh);
        for (uint32_t i = 0; i < part.mesh.vertices.size(); ++i)
            if (part.mesh.vertices[i].corner.is_shared()) part.shared.emplace_back(part.mesh.vertices[i], i);
        std::sort(part.shared.begin(), part.shared.end());
    }

    static void separate(const CubeRectangles& rectangles, Part& part) {
        for (uint8_t direction = 0; direction < 6; ++direction)
            for (const CubeRectangle& rectangle : rectangles.of(CubeDirection(direction))) {
                const auto first = uint32_t(part.mesh.vertices.size());
                for (const BrickCorner& corner : corners_of(rectangle, CubeDirection(direction)))
                    part.mesh.vertices.push_back({corner, rectangle.material, direction});
                part.mesh.quads.push_back({first, first + 1, first + 2, first + 3});
            }
    }

    void place_vertices(Part& part) const {
        const std::array<uint32_t, 3> place = bricks_.place(part.brick);
        const size_t vertices = part.mesh.vertices.size();
        part.positions.resize(vertices);
        part.colors.resize(materials_.by_color ? vertices : 0);
        part.normals.assign(settings_.normals ? vertices : 0, Vec3f::Zero());
        for (size_t i = 0; i < vertices; ++i) {
            const CubeVertex& vertex = part.mesh.vertices[i];
            Vec3d corner;
            for (int axis = 0; axis < 3; ++axis) corner[axis] = double(uint64_t{place[size_t(axis)]} * kCubeBrickSide + uint64_t(vertex.corner[axis]));
            part.positions[i] = (placement_.axes * corner).cast<float>();
            if (!part.colors.empty()) part.colors[i] = color_of(vertex.material);
            if (!part.normals.empty()) part.normals[i] = normals_[vertex.direction];
        }
        if (!placement_.is_mirrored()) return;
        for (auto& t : part.mesh.triangles) std::swap(t[1], t[2]);
        for (auto& q : part.mesh.quads) std::swap(q[1], q[3]);
    }

    std::array<uint8_t, 4> color_of(uint32_t material) const {
        const VoxelColor color = {uint8_t(material >> 16), uint8_t(material >> 8), uint8_t(material)};
        for (const auto& [transparent, opacity] : settings_.transparent)
            if (transparent == color) return {color[0], color[1], color[2], opacity};
        return {color[0], color[1], color[2], 255};
    }

    void put_in_turn(Part& part) {
        counts_.faces_culled += part.faces;
        counts_.rectangles += part.rectangles;
        counts_.triangles += part.mesh.triangles.size();
        counts_.quads += part.mesh.quads.size();
        if (part.rectangles != 0) put(part);
        if (closed()) forget(part.brick);
        report_progress(1);
    }

    // Vertices that bricks put out before have are the same; the others get the next numbers.
    void put(Part& part) {
        constexpr uint32_t kNew = std::numeric_limits<uint32_t>::max();
        const size_t vertices = part.mesh.vertices.size();
        numbers_.assign(vertices, kNew);
        if (closed())
            visit_neighbors(part.brick, [&](size_t neighbor, const std::array<int, 3>& step) {
                if (neighbor < part.brick) find_shared(part, shared_[neighbor], step);
            });
        if (counts_.vertices + vertices >= kNew)
            throw Error(ErrorKind::limit, "the surface has more than 4,294,967,294 vertices: take a coarser depth");
        size_t kept = 0;
        for (size_t i = 0; i < vertices; ++i) {
            if (numbers_[i] != kNew) continue;
            numbers_[i] = uint32_t(counts_.vertices++);
            part.positions[kept] = part.positions[i];
            if (!part.colors.empty()) part.colors[kept] = part.colors[i];
            if (!part.normals.empty()) part.normals[kept] = part.normals[i];
            ++kept;
        }
        for (auto& triangle : part.mesh.triangles)
            for (uint32_t& v : triangle) v = numbers_[v];
        for (auto& quad : part.mesh.quads)
            for (uint32_t& v : quad) v = numbers_[v];
        if (closed()) {
            auto& shared = shared_[part.brick];
            shared.reserve(part.shared.size());
            hold(bytes_of(shared));
            for (const auto& [vertex, number] : part.shared) shared.emplace_back(vertex, numbers_[number]);
        }
        out_.add({.origin = placement_.origin,
                  .positions = std::span(part.positions).first(kept),
                  .normals = std::span(part.normals).first(part.normals.empty() ? 0 : kept),
                  .colors = std::span(part.colors).first(part.colors.empty() ? 0 : kept),
                  .triangles = part.mesh.triangles,
                  .quads = part.mesh.quads});
    }

    void find_shared(const Part& part, const std::vector<std::pair<CubeVertex, uint32_t>>& others, const std::array<int, 3>& step) {
        auto from = others.begin();
        for (const auto& [vertex, number] : part.shared) {
            // Of those of a side, the order is the same from the neighbor.
            bool common = true;
            std::array<int, 3> c;
            for (int axis = 0; axis < 3; ++axis) {
                c[size_t(axis)] = vertex.corner[axis] - kCubeBrickSide * step[size_t(axis)];
                common = common && c[size_t(axis)] >= 0 && c[size_t(axis)] <= kCubeBrickSide;
            }
            if (!common) continue;
            const CubeVertex there{BrickCorner::at(c), vertex.material, vertex.direction};
            from = std::lower_bound(from, others.end(), there, [](const auto& a, const CubeVertex& b) { return a.first < b; });
            if (from != others.end() && from->first == there) numbers_[number] = from->second;
        }
    }

    // Lets go of what no brick to come asks for.
    void forget(size_t brick) {
        const auto forget_if_done = [&](size_t candidate) {
            size_t last = candidate;
            visit_neighbors(candidate, [&](size_t neighbor, const std::array<int, 3>&) { last = std::max(last, neighbor); });
            if (last > brick) return;
            let_go(shared_[candidate]);
            let_go(corners_[candidate]);
        };
        forget_if_done(brick);
        visit_neighbors(brick, [&](size_t neighbor, const std::array<int, 3>&) {
            if (neighbor < brick && !(shared_[neighbor].empty() && corners_[neighbor].empty())) forget_if_done(neighbor);
        });
    }

    const CubeSurfaceSettings& settings_;
    SurfaceSink& out_;
    const CubeBrickSource& bricks_;
    GridPlacement placement_;
    std::array<Vec3f, 6> normals_;  // by direction
    CubeMaterials materials_;
    IdlePool<Worker> workers_;
    CubeSurfaceCounts counts_;
    std::atomic<uint64_t> held_bytes_ = 0;  // of memory_bytes
    std::mutex progress_mutex_;             // while corners are found
    size_t done_bricks_ = 0;
    std::vector<std::vector<BrickCorner>> corners_;                     // [bricks], as long as one around is to be made, as are
    std::vector<std::vector<std::pair<CubeVertex, uint32_t>>> shared_;  // [bricks] with their numbers in the surface
    std::vector<uint32_t> numbers_;                                     // of a part's vertices in the surface
};

}  // namespace

CubeSurfaceCounts mesh_cubes(const VoxelTree& tree, const CubeSurfaceSettings& settings, SurfaceSink& out) {
    if (tree.empty()) return {};
    if (settings.depth < 0 || settings.depth > tree.depth())
        throw Error(ErrorKind::usage,
                    "expected a depth of 1 to " + std::to_string(tree.depth()) + ", got " + std::to_string(settings.depth));
    const int depth = settings.depth == 0 ? tree.depth() : settings.depth;
    return mesh_cubes(TreeBricks(tree, depth), settings, out);
}

CubeSurfaceCounts mesh_cubes(const CubeBrickSource& bricks, const CubeSurfaceSettings& settings, SurfaceSink& out) {
    if (!settings.transparent.empty() && !(settings.colors && bricks.has_colors()))
        throw Error(ErrorKind::usage, "colors that can be seen through are given, but the voxels have no colors");
    return CubeSurface(bricks, settings, out).run();
}

int depth_of_error(const VoxelTree& tree, double error_voxels) {
    const int finest = std::max(tree.depth(), 1);
    int depth = finest;
    while (depth > 1 && std::sqrt(3.0) * (std::ldexp(1.0, finest - depth + 1) - 1.0) <= error_voxels) --depth;
    return depth;
}

int depth_of_error_px(const VoxelTree& tree, const Camera& camera, uint32_t width_px, uint32_t height_px, double error_px) {
    const double aspect = double(width_px) / double(height_px);
    const Frustum frustum(camera, aspect);
    double least = std::numeric_limits<double>::infinity();
    const CellList cells = coarse_cells(tree, kPartsInView);
    for (const auto& cell : cells.cells) {
        const Box3d box = cell_box(tree.frame, cells.depth, cell);
        if (frustum.intersects(box)) least = std::min(least, least_depth(camera, aspect, box));
    }
    if (std::isinf(least)) return 1;
    const double units_per_pixel = 1.0 / pixels_per_unit(camera, least, height_px);
    const double cell = tree.frame.voxel_size * std::ldexp(1.0, tree.frame.depth() - tree.depth());
    return depth_of_error(tree, error_px * units_per_pixel / cell);
}

}  // namespace strata
