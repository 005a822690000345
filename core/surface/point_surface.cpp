#include "core/surface/point_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <tuple>

#include "core/error.h"
#include "core/parallel.h"
#include "core/surface/layer_normals.h"
#include "core/surface/near_points.h"
#include "core/surface/normal_orientation.h"
#include "core/surface/plane_mean.h"

namespace strata {
namespace {

constexpr uint64_t kRecordParts = 8;  // of the memory one is for records of points, and one for the same with normals
// Spacings: between neighboring samples on different sides of a surface the field changes by about one. Where it changes by more, each is at a
// sheet of its own, and none is between.
constexpr float kMostStep = 1.75f;
constexpr int kOrientationCell = 1;                      // samples

constexpr size_t kSide = kFieldBrickSide, kPlane = kSide * kSide;

// Samples of a brick from which it is no surface that the field changes to a neighbor's sign.
class JumpFinder {
public:
    /// found  gets the samples, some perhaps twice
    JumpFinder(float most, const float* values, std::vector<uint16_t>& found) : most_(most), values_(values), found_(found) {}

    void within() {
        for (size_t at = 0; at < kFieldBrickSamples; ++at) {
            if (std::isnan(values_[at])) continue;
            for (const size_t step : {size_t{1}, kSide, kPlane}) {
                const size_t place = at / step % kSide;
                if (place > 0) compare(at, values_[at - step], false);
                if (place + 1 < kSide) compare(at, values_[at + step], false);
            }
        }
    }
    /// To the next brick along i or j.
    void across(int axis, bool upper, const float* other) {
        const size_t step = axis == 0 ? 1 : kSide, along = axis == 0 ? kSide : 1, last = (kSide - 1) * step, here = upper ? last : 0, there = upper ? 0 : last;
        for (size_t k = 0; k < kSide; ++k)
            for (size_t n = 0; n < kSide; ++n) compare(k * kPlane + n * along + here, other[k * kPlane + n * along + there], false);
    }
    /// top  samples of the brick below
    void from_below(const float* top) {
        for (size_t n = 0; n < kPlane; ++n) compare(n, top[n], true);
    }

private:
    void compare(size_t at, float other, bool anyway) {
        const float value = values_[at];
        const bool is_jump = (value < 0.0f) != (other < 0.0f) && std::abs(value) + std::abs(other) > most_;
        if (is_jump && (anyway || std::abs(value) >= std::abs(other))) found_.push_back(uint16_t(at));
    }

    float most_;
    const float* values_;
    std::vector<uint16_t>& found_;
};

// The cell in which the side of a point's normal is chosen.
std::array<int32_t, 3> orientation_cell(const std::array<int32_t, 2>& corner, size_t layer, const Vec3f& place) {
    const auto cell = [](int32_t corner_samples, float offset) { return (corner_samples + std::clamp(int32_t(offset), 0, kFieldBrickSide - 1)) / kOrientationCell; };
    return {cell(corner[0], place.x()), cell(corner[1], place.y()), cell(int32_t(layer) * kFieldBrickSide, place.z())};
}

PointGrid grid_of(const Box3d& bounds, const PointSurfaceSettings& settings) {
    const double steps = settings.radius / settings.spacing;
    if (!(settings.spacing > 0.0 && steps >= settings.kLeastReach && steps <= settings.kMostReach))
        throw Error(ErrorKind::usage, "the radius of a smooth surface is from 2 to 7 spacings of samples");
    return PointGrid::around(bounds, settings.spacing, steps);
}

// Turns the normals of a layer's points to agree within each cell, and adds the cells, in their order.
// cost  cell_bytes(points) for the while
uint64_t cell_bytes(const PointLayer& points) { return points.points() * sizeof(NormalOrientation::Cell); }

void gather_cells(size_t layer, PointLayer& points, NormalOrientation& orientation) {
    struct Sum {
        Vec3f normal = Vec3f::Zero(), place = Vec3f::Zero();
        float points = 0.0f;
    };
    constexpr size_t kAlong = kFieldBrickSide / kOrientationCell;
    std::vector<NormalOrientation::Cell> cells;
    cells.reserve(points.points());
    for (size_t b = 0; b < points.corners.size(); ++b) {
        std::array<Sum, kAlong * kAlong * kAlong> sums = {};
        const auto slot = [&](const Vec3f& place) {
            const auto c = orientation_cell({0, 0}, 0, place);
            return size_t(c[2]) * kAlong * kAlong + size_t(c[1]) * kAlong + size_t(c[0]);
        };
        for (const bool last : {false, true})
            for (uint32_t p = points.begins[b]; p < points.begins[b + 1]; ++p) {
                Vec3f& normal = points.normals[p];
                if (normal.isZero(0.0f)) continue;
                Sum& sum = sums[slot(points.places[p])];
                if (normal.dot(sum.normal) < 0.0f) normal = -normal;
                if (last) continue;
                sum.normal += normal;
                sum.place += points.places[p];
                sum.points += 1.0f;
            }
        for (size_t n = 0; n < sums.size(); ++n) {
            if (sums[n].points == 0.0f) continue;
            const std::array<int32_t, 3> in_brick = {int32_t(n % kAlong), int32_t(n / kAlong % kAlong), int32_t(n / kAlong / kAlong)};
            const std::array<int32_t, 3> at = {points.corners[b][0] / kOrientationCell + in_brick[0], points.corners[b][1] / kOrientationCell + in_brick[1],
                                               int32_t(layer * kAlong) + in_brick[2]};
            const Vec3f place = sums[n].place / sums[n].points / float(kOrientationCell) - Vec3f(float(in_brick[0]), float(in_brick[1]), float(in_brick[2]));
            cells.push_back({at, place, sums[n].normal.normalized()});
        }
    }
    std::sort(cells.begin(), cells.end(), [](const auto& a, const auto& b) { return std::tie(a.at[2], a.at[1], a.at[0]) < std::tie(b.at[2], b.at[1], b.at[0]); });
    orientation.add(cells);
}

}  // namespace

PointSurface::PointSurface(const PointSource& points, const Box3d& bounds, const PointSurfaceSettings& settings)
    : settings_(settings), radius_(float(settings.radius / settings.spacing)), scratch_(settings.scratch) {
    settings_.form.normals = true;
    distribute(points, bounds);
    if (layers_->outside() > 0 && settings_.bounds_of_all) distribute(points, settings_.bounds_of_all(layers_->outside()));
    report_.outside = layers_->outside();
    const NormalCount& found = layers_->normals();
    report_.has_normals = found.points > 0;
    const bool all_up = found.points == found.up;
    report_.oriented = !settings.viewpoint && all_up;
    find_normals(!report_.has_normals, report_.oriented);
}

float PointSurface::background() const { return std::numeric_limits<float>::quiet_NaN(); }

void PointSurface::distribute(const PointSource& points, const Box3d& bounds) {
    layers_ = nullptr;
    grid_ = grid_of(bounds, settings_);
    layers_ = std::make_unique<PointLayers>(grid_, settings_.form, settings_.memory_bytes / kRecordParts, scratch_);
    layers_->distribute(points, settings_.threads, settings_.on_points);
}

// Goes through the points once: of each cell of half a spacing one is left, with a normal.
void PointSurface::find_normals(bool fit, bool turn) {
    auto done = std::make_unique<PointLayers>(grid_, settings_.form, settings_.memory_bytes / kRecordParts, scratch_);
    NormalOrientation orientation;
    std::array<std::shared_ptr<PointLayer>, 3> near;
    const auto held = [&] {
        uint64_t bytes = 2 * (settings_.memory_bytes / kRecordParts) + orientation.memory_bytes();
        for (const auto& other : near) bytes += other ? other->memory_bytes() : 0;
        return bytes;
    };
    const auto read = [&](size_t layer) {
        near[layer % 3] = nullptr;
        if (layer < layers_->size()) near[layer % 3] = std::make_shared<PointLayer>(layers_->take(layer, true, left_beside(held())));
    };
    read(0);
    for (size_t layer = 0; layer < layers_->size(); ++layer) {
        read(layer + 1);
        PointLayer& points = *near[layer % 3];
        if (points.points() == 0) continue;
        const std::array<const PointLayer*, 3> around = {layer > 0 ? near[(layer + 2) % 3].get() : nullptr, &points, near[(layer + 1) % 3].get()};
        if (fit) points.normals = layer_normals(around, radius_, settings_.threads);
        report_.merged += points.points();
        for (const Vec3f& normal : points.normals) report_.without_normal += normal.isZero(0.0f);
        if (settings_.viewpoint)
            for (size_t b = 0; b < points.corners.size(); ++b)
                for (uint32_t p = points.begins[b]; p < points.begins[b + 1]; ++p) {
                    const Vec3d place = grid_.placement.world_from_index(Vec3d(points.corners[b][0], points.corners[b][1], double(layer) * kFieldBrickSide) + points.places[p].cast<double>());
                    if (points.normals[p].cast<double>().dot(*settings_.viewpoint - place) < 0.0) points.normals[p] = -points.normals[p];
                }
        else if (turn) {
            if (const uint64_t needed = held() + cell_bytes(points); needed > settings_.memory_bytes)
                throw Error(ErrorKind::limit, "choosing sides for the normals needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(settings_.memory_bytes) +
                                                  " are allowed; a larger voxel size needs less, points with normals none");
            gather_cells(layer, points, orientation);
        }
        done->add(layer, points);
    }
    layers_ = std::move(done);
    if (!turn) return;
    near = {};
    orientation.solve(left_beside(settings_.memory_bytes / kRecordParts));
    report_.components = orientation.components();
    orientation_ = std::move(orientation);
}

// What is left beside records, layers of points, cells and the samples that are kept: all of it known from the points alone.
uint64_t PointSurface::room() const {
    uint64_t held = settings_.memory_bytes / kRecordParts + orientation_.memory_bytes() + top_.memory_bytes() + window_.memory_bytes();
    if (!settings_.keep_points)
        for (const auto& other : near_) held += other ? other->memory_bytes() : 0;
    return left_beside(held);
}

void PointSurface::load(size_t layer) {
    std::shared_ptr<const PointLayer>& slot = near_[layer % 3];
    slot = nullptr;
    if (layers_->points(layer) == 0) return;
    auto points = std::make_shared<PointLayer>(layers_->take(layer, false, room()));
    if (orientation_.cells() > 0)
        for (size_t b = 0; b < points->corners.size(); ++b)
            for (uint32_t p = points->begins[b]; p < points->begins[b + 1]; ++p)
                if (orientation_.is_turned(orientation_cell(points->corners[b], layer, points->places[p]))) points->normals[p] = -points->normals[p];
    if (settings_.keep_points) window_.put(layer, points);
    slot = std::move(points);
}

void PointSurface::fill(FieldBrickLayer& out) {
    const size_t layer = next();
    const auto at = [&](size_t other) { return near_[other % 3].get(); };
    const std::array<const PointLayer*, 3> around = {layer > 0 ? at(layer + 2) : nullptr, at(layer), at(layer + 1)};
    out.corners = corners_around(around);
    const uint64_t needed = out.corners.size() * ((kFieldBrickSamples + kPlane) * sizeof(float) + 2 * sizeof out.corners[0]), room = this->room();
    if (needed > room)
        throw Error(ErrorKind::limit, "one layer of bricks needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(room) +
                                          " are left of what is allowed; a larger voxel size needs less");
    out.values.resize(out.corners.size() * kFieldBrickSamples);
    std::vector<uint8_t> reached(out.corners.size());
    const float spacing = float(settings_.spacing);
    parallel_blocks(settings_.threads, out.corners.size(), 8, [&](size_t begin, size_t end) {
        NearPoints near;
        PlaneMean mean(radius_);
        for (size_t b = begin; b < end; ++b) {
            near.gather(around, out.corners[b], radius_, true);
            const std::span<float, kFieldBrickSamples> values(out.values.data() + b * kFieldBrickSamples, kFieldBrickSamples);
            reached[b] = mean.evaluate(near, values);
            for (float& value : values) value *= spacing;
        }
    });
    drop_jumps(out);
    size_t kept = 0;
    for (size_t b = 0; b < reached.size(); ++b) {
        if (reached[b] == 0) continue;
        out.corners[kept] = out.corners[b];
        if (kept != b) std::copy_n(out.values.data() + b * kFieldBrickSamples, kFieldBrickSamples, out.values.data() + kept * kFieldBrickSamples);
        ++kept;
    }
    out.corners.resize(kept);
    out.values.resize(kept * kFieldBrickSamples);
}

// Of neighboring samples that no surface is between, although their signs differ, the one that is farther from its sheet is not known; across layers
// that of the upper one, as the other is gone.
void PointSurface::drop_jumps(FieldBrickLayer& out) {
    const size_t bricks = out.corners.size();
    std::vector<std::vector<uint16_t>> dropped(bricks);
    const bool follows = top_.k + kFieldBrickSide == out.k;
    parallel_blocks(settings_.threads, bricks, 32, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
            JumpFinder jumps(kMostStep * float(settings_.spacing), out.values.data() + b * kFieldBrickSamples, dropped[b]);
            jumps.within();
            for (const int axis : {0, 1})
                for (const bool upper : {false, true}) {
                    std::array<int32_t, 2> beside = out.corners[b];
                    beside[size_t(axis)] += upper ? kFieldBrickSide : -kFieldBrickSide;
                    const size_t other = find_brick(out.corners, beside);
                    if (other < bricks) jumps.across(axis, upper, out.values.data() + other * kFieldBrickSamples);
                }
            const size_t below = follows ? find_brick(top_.corners, out.corners[b]) : top_.corners.size();
            if (below < top_.corners.size()) jumps.from_below(top_.values.data() + below * kPlane);
        }
    });
    top_.k = out.k;
    top_.corners = out.corners;
    top_.values.resize(bricks * kPlane);
    for (size_t b = 0; b < bricks; ++b) {
        float* const values = out.values.data() + b * kFieldBrickSamples;
        std::copy_n(values + (kSide - 1) * kPlane, kPlane, top_.values.begin() + ptrdiff_t(b * kPlane));
        for (const uint16_t at : dropped[b]) values[at] = std::numeric_limits<float>::quiet_NaN();
    }
}

}  // namespace strata
