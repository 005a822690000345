#include "render/reference/point_reference.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

#include "core/parallel.h"
#include "render/gbuffer.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr uint32_t kBandRows = 8;  // of pixels, drawn by one thread
constexpr uint32_t kSide = PointReference::kSamplesSide;
constexpr uint32_t kBandSamples = kBandRows * kSide;  // rows of samples in a band
constexpr size_t kFarNeighbors = 96;  // looked at where a quarter holds none of the nearest
constexpr size_t kLooseNeighbor = 2;   // that a splat reaches where there is no plane
constexpr double kReach = 0.8;         // radius over the distance to the neighbor in the emptiest quarter
constexpr double kNearWide = 0.01;     // two scan lines are a plane,
constexpr double kFarWide = 0.05;      // two wires are none
constexpr double kNone = std::numeric_limits<double>::infinity();

// The plane of a point's neighbors.
struct Plane {
    Vec3d normal, across, along;  // along is where the neighbors spread most
};

// around  relative to the point. Nothing where they do not lie in a plane, or lie in a line
// wide    least variance across their line over that along it
std::optional<Plane> fit_plane(std::span<const Vec3d> around, double wide) {
    constexpr double kFlat = 0.1;  // variance across the plane over the lesser one along it
    const Vec3d mean = std::accumulate(around.begin(), around.end(), Vec3d(Vec3d::Zero())) / double(around.size());
    Mat3d covariance = Mat3d::Zero();
    for (const Vec3d& p : around) covariance += (p - mean) * (p - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Mat3d> solver(covariance);
    const Vec3d& variance = solver.eigenvalues();  // ascending
    if (!(variance[0] <= kFlat * variance[1] && variance[1] >= wide * variance[2] && variance[1] > 0.0)) return std::nullopt;
    return Plane{solver.eigenvectors().col(0), solver.eigenvectors().col(1), solver.eigenvectors().col(2)};
}

// Distances to the nearest points of the plane in the four quarters around its axes; 0: none there.
std::array<double, 4> nearest_quarters(std::span<const Vec3d> around, const Plane& plane) {
    constexpr double kSteep = 0.25;  // what rises more does not belong to the plane
    std::array<double, 4> nearest{};
    for (const Vec3d& p : around) {
        const double x = p.dot(plane.across), y = p.dot(plane.along), distance = std::hypot(x, y);
        if (distance == 0.0 || std::abs(p.dot(plane.normal)) > kSteep * distance) continue;
        double& quarter = nearest[std::abs(x) > std::abs(y) ? (x > 0.0 ? 0 : 1) : (y > 0.0 ? 2 : 3)];
        if (quarter == 0.0) quarter = distance;
    }
    return nearest;
}

// Rays of a picture's samples in view space with z forwards: origin + t * direction has the eye depth t.
struct Lens {
    Lens(const Camera& camera, uint32_t width_px, uint32_t height_px)
        : perspective(camera.projection == Projection::perspective), columns(width_px * kSide), rows(height_px * kSide) {
        const double full = perspective ? 2.0 * std::tan(0.5 * camera.fov_rad) : camera.height;
        step = full / rows;
        right = 0.5 * step * columns;
        top = 0.5 * full;
    }
    double x_of(uint32_t column) const { return (column + 0.5) * step - right; }
    double y_of(uint32_t row) const { return top - (row + 0.5) * step; }

    bool perspective;
    uint32_t columns, rows;   // of samples
    double step, right, top;  // at depth 1 in perspective
};

// A disc as a camera sees it.
struct SeenDisc {
    Vec3d center, normal;  // view space, z forwards
    double radius;
    Rgba8 color;
    uint32_t first_column, first_row, end_column, end_row;  // samples that it may cover
};

// Finds the samples that the box around the disc covers; false: none.
bool find_range(SeenDisc& disc, const Lens& lens, double near_depth) {
    const auto beside = [&](double across, double rim) {  // of a side of the picture, with the ball around the disc
        if (!lens.perspective) return across - rim > disc.radius;
        return across - rim * disc.center.z() > disc.radius * std::hypot(1.0, rim);
    };
    if (beside(std::abs(disc.center.x()), lens.right) || beside(std::abs(disc.center.y()), lens.top)) return false;
    const Vec3d half = disc.radius * (1.0 - disc.normal.array().square()).max(0.0).sqrt().matrix();
    double left = kNone, right = -kNone, top = kNone, bottom = -kNone;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p = disc.center + half.cwiseProduct(Vec3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1));
        if (lens.perspective && p.z() < near_depth) {  // then it may be anywhere
            left = top = -kNone;
            right = bottom = kNone;
            break;
        }
        const double scale = lens.perspective ? 1.0 / p.z() : 1.0;
        left = std::min(left, p.x() * scale);
        right = std::max(right, p.x() * scale);
        top = std::min(top, -p.y() * scale);
        bottom = std::max(bottom, -p.y() * scale);
    }
    const auto sample = [&](double place, double half_side, uint32_t end) {
        return uint32_t(std::clamp((place + half_side) / lens.step, 0.0, double(end)));
    };
    disc.first_column = sample(left, lens.right, lens.columns);
    disc.end_column = std::min(sample(right, lens.right, lens.columns) + 1, lens.columns);
    disc.first_row = sample(top, lens.top, lens.rows);
    disc.end_row = std::min(sample(bottom, lens.top, lens.rows) + 1, lens.rows);
    return disc.first_column < disc.end_column && disc.first_row < disc.end_row;
}

// What a sample sees so far.
struct Sample {
    double front = kNone;       // depth up to which discs are front ones
    double off_center = kNone;  // squared distance from the center of the disc shown
    double depth = kNone;
    Rgba8 color;
};

// Calls hit(index of the sample in its band, depth, squared distance from the center) for each sample on the disc.
template <typename Hit>
void for_each_sample(const SeenDisc& disc, const Lens& lens, double near_depth, uint32_t first_row, Hit&& hit) {
    const double square = disc.radius * disc.radius;
    const uint32_t end_row = std::min(first_row + kBandSamples, disc.end_row);
    for (uint32_t row = std::max(first_row, disc.first_row); row < end_row; ++row) {
        const double y = lens.y_of(row);
        for (uint32_t column = disc.first_column; column < disc.end_column; ++column) {
            const double x = lens.x_of(column);
            const Vec3d origin = lens.perspective ? Vec3d(0, 0, 0) : Vec3d(x, y, 0);
            const Vec3d direction = lens.perspective ? Vec3d(x, y, 1) : Vec3d(0, 0, 1);
            const double depth = disc.normal.dot(disc.center - origin) / disc.normal.dot(direction);
            const double off_center = (origin + depth * direction - disc.center).squaredNorm();
            if (!(off_center <= square && depth >= near_depth)) continue;  // also where the disc is seen edge on
            hit(size_t(row - first_row) * lens.columns + column, depth, off_center);
        }
    }
}

// The samples of kBandSamples rows, from which on pixels are averaged.
void draw_band(std::span<const SeenDisc> discs, std::span<const uint32_t> chosen, const Lens& lens, double near_depth, uint32_t first_row,
               Rgba8 background, std::vector<Sample>& samples) {
    samples.assign(size_t(lens.columns) * kBandSamples, Sample{.color = background});
    for (const uint32_t i : chosen)
        for_each_sample(discs[i], lens, near_depth, first_row,
                        [&](size_t at, double depth, double) { samples[at].front = std::min(samples[at].front, depth + discs[i].radius); });
    for (const uint32_t i : chosen)
        for_each_sample(discs[i], lens, near_depth, first_row, [&](size_t at, double depth, double off_center) {
            Sample& sample = samples[at];
            if (depth > sample.front || !(off_center < sample.off_center)) return;  // ties stay with the lower index
            sample.off_center = off_center;
            sample.depth = depth;
            sample.color = discs[i].color;
        });
}

void resolve_band(std::span<const Sample> samples, uint32_t first_row, ReferencePicture& picture) {
    const std::array<float, 256>& linear = linear_from_srgb8();
    const auto code = [](double light) { return uint8_t(std::lround(255.0 * srgb_from_linear(light))); };
    const uint32_t width = picture.image.width;
    for (uint32_t row = first_row; row < std::min(first_row + kBandRows, picture.image.height); ++row)
        for (uint32_t column = 0; column < width; ++column) {
            constexpr size_t kSamples = size_t(kSide) * kSide;
            Vec3d light = Vec3d::Zero();
            std::array<double, kSamples> depths;
            for (size_t s = 0; s < kSamples; ++s) {
                const size_t sample_row = size_t(row - first_row) * kSide + s / kSide;
                const Sample& sample = samples[sample_row * width * kSide + size_t(column) * kSide + s % kSide];
                light += Vec3d(linear[red_of(sample.color)], linear[green_of(sample.color)], linear[blue_of(sample.color)]) / double(kSamples);
                depths[s] = sample.depth;
            }
            picture.image.at(column, row) = make_rgba(code(light.x()), code(light.y()), code(light.z()));
            std::nth_element(depths.begin(), depths.begin() + kSamples / 2, depths.end());
            picture.depths[size_t(row) * width + column] = float(depths[kSamples / 2]);
        }
}

}  // namespace

PointReference::PointReference(LayeredCloud& cloud, const PointColorizer& colors, int threads) {
    std::vector<Vec3d> points;
    PointBatch batch;
    std::vector<Rgba8> batch_colors;
    for (NodeId id = 0; id < cloud.node_count(); ++id) {
        if (cloud.node(id).children_pending) cloud.load_children(id);
        cloud.read_node(id, colors.wanted(), batch);
        batch_colors.resize(batch.size);
        colors.color(batch, cloud.node(id).key.level, batch_colors);
        for (size_t i = 0; i < batch.size; ++i) {
            points.push_back(cloud.info().quantization.world_from_quanta({batch.x[i], batch.y[i], batch.z[i]}));
            splats_.push_back({points.back(), Vec3d::Zero(), 0.0, batch_colors[i]});
        }
    }
    tree_ = std::make_unique<NeighborTree>(points, threads);
    parallel_blocks(threads, points.size(), 4096, [&](size_t begin, size_t end) {
        std::vector<NeighborTree::Neighbor> neighbors;
        std::vector<Vec3d> around;
        const auto look_around = [&](size_t i, size_t count) {
            tree_->nearest(points[i], count + 1, neighbors);  // and itself
            around.clear();
            for (const NeighborTree::Neighbor& neighbor : neighbors) around.push_back(points[neighbor.point] - points[i]);
        };
        for (size_t i = begin; i < end; ++i) {
            look_around(i, kNeighbors);
            const std::optional<Plane> plane = fit_plane(around, kNearWide);
            if (!plane) {
                splats_[i].radius = around[std::min(kLooseNeighbor, around.size() - 1)].norm();
                continue;
            }
            std::array<double, 4> quarters = nearest_quarters(around, *plane);
            if (*std::min_element(quarters.begin(), quarters.end()) == 0.0) {  // at an edge, or beside a denser strip
                look_around(i, kFarNeighbors);
                if (fit_plane(around, kFarWide)) quarters = nearest_quarters(around, *plane);
            }
            // With a quarter that has nothing, what lies farthest in the others may be another wire or roof.
            std::sort(quarters.begin(), quarters.end());
            splats_[i].radius = kReach * quarters[quarters[0] == 0.0 ? 2 : 3];
            splats_[i].normal = plane->normal;
        }
    });
}

bool PointReference::reaches(const Vec3d& p) const {
    std::vector<NeighborTree::Neighbor> nearest;
    tree_->nearest(p, 1, nearest);
    return !nearest.empty() && nearest[0].square <= splats_[nearest[0].point].radius * splats_[nearest[0].point].radius;
}

ReferencePicture PointReference::draw(const Camera& camera, uint32_t width, uint32_t height, Rgba8 background,
                                      int threads) const {
    const Lens lens(camera, width, height);
    Mat3d forward_view = camera.view_from_world;  // z forwards rather than backwards
    forward_view.row(2) *= -1.0;
    std::vector<SeenDisc> discs;
    for (size_t i = 0; i < splats_.size(); ++i) {
        const Splat& splat = splats_[i];
        SeenDisc disc{.center = forward_view * (splat.center - camera.eye), .normal = forward_view * splat.normal,
                      .radius = splat.radius, .color = splat.color};
        if (splat.normal.isZero()) disc.normal = lens.perspective ? disc.center.normalized() : Vec3d(Vec3d::UnitZ());
        if (disc.center.z() >= camera.near_depth && find_range(disc, lens, camera.near_depth)) discs.push_back(disc);
    }
    const size_t bands = (height + kBandRows - 1) / kBandRows;
    std::vector<std::vector<uint32_t>> discs_of(bands);
    for (size_t i = 0; i < discs.size(); ++i)
        for (size_t band = discs[i].first_row / kBandSamples; band <= (discs[i].end_row - 1) / kBandSamples; ++band)
            discs_of[band].push_back(uint32_t(i));

    ReferencePicture picture{Image(width, height), std::vector<float>(size_t(width) * height)};
    parallel_blocks(threads, bands, 1, [&](size_t begin, size_t end) {
        std::vector<Sample> samples;
        for (size_t band = begin; band < end; ++band) {
            draw_band(discs, discs_of[band], lens, camera.near_depth, uint32_t(band) * kBandSamples, background, samples);
            resolve_band(samples, uint32_t(band) * kBandRows, picture);
        }
    });
    return picture;
}

}  // namespace strata
