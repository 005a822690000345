#include "render/named_view.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "render/point_color.h"

namespace strata {
namespace {

constexpr size_t kSamplePoints = 50'000;
constexpr size_t kSampleNodes = 4096;
constexpr size_t kSampleCells = 20'000;
constexpr size_t kSampleTriangles = 50'000;  // of a mesh, beside its outermost corners
constexpr double kViewMargin = 0.03;  // of the picture, at each side
constexpr double kStrayShare = 1e-3;  // of the points may be strays at each end of an axis

struct View {
    std::string_view name;
    std::array<double, 3> forward, up;
};
// iso looks down by 35 degrees from a corner, which keeps all three axes in sight.
constexpr View kViews[] = {
    {"iso", {-0.58, 0.58, -0.57}, {0, 0, 1}}, {"top", {0, 0, -1}, {0, 1, 0}},  {"front", {0, 1, 0}, {0, 0, 1}},
    {"back", {0, -1, 0}, {0, 0, 1}},          {"left", {1, 0, 0}, {0, 0, 1}}, {"right", {-1, 0, 0}, {0, 0, 1}},
};

// Drops points outside the box of nearly all others grown by half its size, per axis.
void drop_strays(std::vector<Vec3d>& points) {
    const size_t strays = size_t(double(points.size()) * kStrayShare);
    if (strays == 0) return;
    Box3d kept;
    std::vector<double> values(points.size());
    for (int axis = 0; axis < 3; ++axis) {
        std::transform(points.begin(), points.end(), values.begin(), [&](const Vec3d& p) { return p[axis]; });
        std::nth_element(values.begin(), values.begin() + long(strays), values.end());
        const double low = values[strays];
        std::nth_element(values.begin(), values.end() - 1 - long(strays), values.end());
        const double high = values[values.size() - 1 - strays];
        kept.min[axis] = low - 0.5 * (high - low);
        kept.max[axis] = high + 0.5 * (high - low);
    }
    std::erase_if(points, [&](const Vec3d& p) { return !kept.contains(p); });
}

}  // namespace

std::vector<Vec3d> sample_positions(LayeredCloud& cloud) {
    std::vector<Vec3d> points;
    if (cloud.node_count() == 0) return points;
    const Quantization& quantization = cloud.info().quantization;
    std::vector<NodeId> queue = {cloud.root()};  // breadth first
    PointBatch batch;
    for (size_t next = 0; next < std::min(queue.size(), kSampleNodes) && points.size() < kSamplePoints; ++next) {
        if (cloud.node(queue[next]).children_pending) cloud.load_children(queue[next]);
        const LayeredNode& node = cloud.node(queue[next]);
        for (uint32_t child = 0; child < node.child_count; ++child) queue.push_back(node.first_child + child);
        if (node.points == 0) continue;
        cloud.read_node(queue[next], {}, batch);
        for (size_t i = 0; i < batch.size; ++i)
            points.push_back(quantization.world_from_quanta({batch.x[i], batch.y[i], batch.z[i]}));
    }
    drop_strays(points);
    return points;
}

namespace {

// Corners of some triangles of a mesh, and the outermost ones along 26 directions, as a horn may be one vertex.
void add_sample(const TriangleMesh& mesh, std::vector<Vec3d>& points) {
    const size_t step = mesh.triangles.size() / kSampleTriangles + 1;
    for (size_t i = 0; i < mesh.triangles.size(); i += step)
        for (const uint32_t vertex : mesh.triangles[i]) points.push_back(mesh.positions[vertex]);
    if (step == 1) return;
    std::vector<Vec3d> directions;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z)
                if (x != 0 || y != 0 || z != 0) directions.push_back(Vec3d(x, y, z).normalized());
    std::vector<bool> used(mesh.positions.size(), false);
    for (const std::array<uint32_t, 3>& triangle : mesh.triangles)
        for (const uint32_t vertex : triangle) used[vertex] = true;
    const Vec3d origin = mesh.positions[mesh.triangles[0][0]];
    std::vector<size_t> outermost(directions.size(), mesh.triangles[0][0]);
    std::vector<double> farthest(directions.size(), 0.0);
    for (size_t vertex = 0; vertex < used.size(); ++vertex) {
        if (!used[vertex]) continue;
        const Vec3d p = mesh.positions[vertex] - origin;
        for (size_t i = 0; i < directions.size(); ++i) {
            const double reach = directions[i].dot(p);
            if (reach > farthest[i]) farthest[i] = reach, outermost[i] = vertex;
        }
    }
    for (const size_t vertex : outermost) points.push_back(mesh.positions[vertex]);
}

Vec3d corner_of(const Box3d& box, int corner) {
    return {(corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(), (corner & 4 ? box.max : box.min).z()};
}

void add_corners(const Box3d& box, std::vector<Vec3d>& points) {
    for (int corner = 0; corner < 8 && !box.empty(); ++corner) points.push_back(corner_of(box, corner));
}

Box3d shared(const Box3d& a, const Box3d& b) { return {.min = a.min.cwiseMax(b.min), .max = a.max.cwiseMin(b.max)}; }

// Of what is left of a box that may hold something.
void add_left(const Box3d& box, std::span<const ClipBox> clips, std::vector<Vec3d>& points) {
    bool keeping = false;
    for (const ClipBox& clip : clips) {
        if (clip.action == ClipBox::Action::remove && clip.box.contains(box.min) && clip.box.contains(box.max)) return;
        keeping |= clip.action == ClipBox::Action::keep;
    }
    if (!keeping) return add_corners(box, points);
    for (const ClipBox& clip : clips)
        if (clip.action == ClipBox::Action::keep) add_corners(shared(box, clip.box), points);
}

}  // namespace

std::vector<Vec3d> sample_positions(const Scene& scene, std::span<const ClipBox> clips) {
    std::vector<Vec3d> points;
    if (scene.cloud != nullptr) points = sample_positions(*scene.cloud);
    for (const VoxelModel& model : scene.voxels) {
        const CellList sample = coarse_cells(*model.tree, kSampleCells);
        // Coarse cells reach beyond the voxels.
        for (const auto& cell : sample.cells) add_corners(shared(cell_box(model.tree->frame, sample.depth, cell), model.bounds), points);
    }
    for (const MeshModel& model : scene.meshes) add_sample(*model.mesh, points);
    for (const IsosurfaceModel& model : scene.isosurfaces) add_sample(model, clips, points);
    return points;
}

void add_sample(const IsosurfaceModel& model, std::span<const ClipBox> clips, std::vector<Vec3d>& points) {
    const VoxelTree& tree = model.surface.cells;
    const CellList sample = coarse_cells(tree, kSampleCells);
    for (const auto& cell : sample.cells) {
        const Box3d cells = cell_box(tree.frame, sample.depth, cell);
        Box3d box;  // world
        for (int corner = 0; corner < 8; ++corner) box.extend(model.surface.field->placement().world_from_index(corner_of(cells, corner)));
        add_left(shared(box, model.bounds), clips, points);
    }
}

Camera named_view(std::string_view name, Projection projection, double fov_rad, std::span<const Vec3d> points, double aspect, UpAxis up) {
    std::string names;
    for (const View& view : kViews) {
        names += (names.empty() ? "" : ", ") + std::string(view.name);
        if (view.name != name) continue;
        Camera camera;
        camera.projection = projection;
        camera.fov_rad = fov_rad;
        const auto turned = [&](const std::array<double, 3>& v) { return up == UpAxis::z ? Vec3d(v[0], v[1], v[2]) : Vec3d(v[0], v[2], -v[1]); };
        camera.view_from_world = look_along(turned(view.forward), turned(view.up));
        frame_points(camera, points, aspect, kViewMargin);
        return camera;
    }
    throw Error(ErrorKind::usage, "--view: expected one of " + names + ", got '" + std::string(name) + "'");
}

std::string sensible_color(const LayeredCloud& cloud) {
    const CloudInfo& info = cloud.info();
    const int rgb = find_attribute(info.attributes, attribute_name::kRgb);
    if (rgb >= 0 && cloud.node_count() > 0) {
        PointBatch batch;
        const int wanted[] = {rgb};
        // The first node on the way down that has points speaks for the cloud.
        for (NodeId id = cloud.root(); id != kNoNode; id = cloud.node(id).first_child) {
            if (cloud.node(id).points == 0) continue;
            cloud.read_node(id, wanted, batch);
            const std::vector<std::byte>& values = batch.columns[size_t(rgb)];
            if (std::any_of(values.begin(), values.end(), [](std::byte value) { return value != std::byte{0}; })) return "rgb";
            break;
        }
    }
    return "elevation";
}

}  // namespace strata
