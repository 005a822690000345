#include "io/crs/reprojected_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <mutex>
#include <numbers>
#include <optional>

#include "core/error.h"
#include "core/parallel.h"
#include "io/crs/crs_text.h"
#include "io/crs/crs_transformation.h"

namespace strata {
namespace {

constexpr double kMetersOfDegree = 6378137.0 * std::numbers::pi / 180.0;  // on the equator of WGS 84
constexpr double kLeastQuanta = std::numeric_limits<int32_t>::min(), kMostQuanta = std::numeric_limits<int32_t>::max();

class RenamedSource : public PointSource {
public:
    RenamedSource(std::unique_ptr<PointSource> source, const std::string& crs) : source_(std::move(source)), info_(source_->info()) {
        if (!info_.crs.empty() && !same_crs(info_.crs, crs))
            info_.notes.push_back("its coordinate reference system, " + crs_name(info_.crs) + ", is taken for " + crs_name(crs));
        info_.crs = crs;
        info_.crs_records.clear();
    }

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return source_->batch_count(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override { source_->read_batch(index, wanted, out); }
    void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const override {
        source_->read_first(index, most, wanted, out);
    }

private:
    std::unique_ptr<PointSource> source_;
    CloudInfo info_;
};

double power_of_ten_below(double value) {
    // A twentieth of a decade is let pass: a millimeter in degrees is 0.9e-8 on the equator, and 1e-8 means it.
    return std::pow(10.0, std::floor(std::log10(value) + 0.05));
}

// As fine in another unit: `meters` are those of a unit, 0 an angle in degrees.
double scale_in(double scale, double from_meters, double to_meters) {
    if (from_meters == to_meters) return scale;
    const double ground = scale * (from_meters > 0.0 ? from_meters : kMetersOfDegree);
    return power_of_ten_below(ground / (to_meters > 0.0 ? to_meters : kMetersOfDegree));
}

using Columns = std::array<std::vector<double>, 3>;

// A point that PROJ cannot transform: the first of the source, whichever thread meets it.
struct Refused {
    uint64_t batch = UINT64_MAX;
    size_t row = 0;
    Vec3d place = Vec3d::Zero();
};

class ReprojectedSource : public PointSource {
public:
    ReprojectedSource(std::unique_ptr<PointSource> source, std::unique_ptr<CrsTransformation> way, const std::string& to, std::string name,
                      int threads)
        : source_(std::move(source)), way_(std::move(way)), name_(std::move(name)), info_(source_->info()),
          from_(describe_crs(info_.crs).value_or(CrsDescription())), to_(describe_crs(to).value_or(CrsDescription())) {
        // Two systems of the plane: heights are no business of either.
        keeps_z_ = from_.vertical_unit.empty() && to_.vertical_unit.empty();
        choose_quantization(find_bounds(threads));
        const std::string wkt = to.starts_with('+') || to.starts_with('{') ? wkt1_of_crs(to) : std::string();
        info_.crs = wkt.empty() ? to : wkt;
        info_.crs_records.clear();
        add_notes();
    }

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return source_->batch_count(); }

    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        source_->read_batch(index, wanted, out);
        requantize(out);
    }
    void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const override {
        source_->read_first(index, most, wanted, out);
        requantize(out);
    }

private:
    // Where the points are in the new system, infinite where PROJ does not know.
    void transform(const PointBatch& batch, Columns& world) const {
        const std::array<const std::vector<int32_t>*, 3> quanta = {&batch.x, &batch.y, &batch.z};
        const Quantization& in = source_->info().quantization;
        for (size_t axis = 0; axis < 3; ++axis) {
            const double scale = in.scale[Eigen::Index(axis)], offset = in.offset[Eigen::Index(axis)];
            world[axis].resize(batch.size);
            for (size_t i = 0; i < batch.size; ++i) world[axis][i] = double((*quanta[axis])[i]) * scale + offset;
        }
        way_->apply(world[0], world[1], world[2]);
    }

    // The box of the transformed points, exactly; what is not transformed is refused by name.
    Box3d find_bounds(int threads) {
        Box3d bounds;
        Refused refused;
        std::vector<uint64_t> sizes(size_t(source_->batch_count()));
        std::mutex mutex;
        parallel_blocks(threads, sizes.size(), 1, [&](size_t begin, size_t end) {
            PointBatch batch;
            Columns world;
            for (size_t index = begin; index < end; ++index) {
                source_->read_batch(index, {}, batch);
                sizes[index] = batch.size;
                transform(batch, world);
                Box3d own;
                for (size_t i = 0; i < batch.size; ++i) {
                    const Vec3d p(world[0][i], world[1][i], world[2][i]);
                    if (!p.allFinite()) {
                        const std::lock_guard lock(mutex);
                        if (index < refused.batch)
                            refused = {index, i, source_->info().quantization.world_from_quanta(Vec3i(batch.x[i], batch.y[i], batch.z[i]))};
                        break;
                    }
                    own.extend(p);
                }
                if (own.empty()) continue;
                const std::lock_guard lock(mutex);
                bounds.extend(own);
            }
        });
        if (refused.batch != UINT64_MAX) {
            uint64_t number = refused.row + 1;
            for (size_t index = 0; index < refused.batch; ++index) number += sizes[index];
            refuse(number, refused.place);
        }
        if (const auto first = std::find_if(sizes.begin(), sizes.end(), [](uint64_t size) { return size > 0; }); first != sizes.end()) {
            PointBatch batch;
            source_->read_first(uint64_t(first - sizes.begin()), 1, {}, batch);
            if (batch.size == 0) source_->read_batch(uint64_t(first - sizes.begin()), {}, batch);
            check_way(source_->info().quantization.world_from_quanta(Vec3i(batch.x[0], batch.y[0], batch.z[0])));
        }
        return bounds;
    }

    [[noreturn]] void refuse(uint64_t number, const Vec3d& place) const {
        const std::string why = way_->way_at(place).complaint;
        char point[160];
        std::snprintf(point, sizeof point, ": point %llu, at %.10g, %.10g, %.10g, ", static_cast<unsigned long long>(number), place.x(), place.y(), place.z());
        throw Error(ErrorKind::limit, name_ + point + "has no place in " + to_.name + (why.empty() ? "" : ": " + why));
    }

    void check_way(const Vec3d& place) {
        const CrsTransformation::Way way = way_->way_at(place);
        if (way.heights_unmoved)
            throw Error(ErrorKind::unsupported, name_ + ": PROJ lacks the grid that brings heights from " + from_.name + " to " + to_.name +
                                                    "; systems without heights, in --in-crs and --out-crs, leave them as they are");
        if (way.name.find("allpark") != std::string::npos)
            info_.notes.push_back("how the datums of " + from_.name + " and " + to_.name + " relate is not known: they are taken for one");
        else if (way.accuracy >= 0.01)
            info_.notes.push_back("between " + from_.name + " and " + to_.name + " positions are known to about " + decimal(way.accuracy) + " m");
    }

    static std::string decimal(double value) {
        char text[32];
        std::snprintf(text, sizeof text, "%g", value);
        return text;
    }

    void choose_quantization(const Box3d& bounds) {
        const Quantization& in = source_->info().quantization;
        Quantization& out = info_.quantization;
        // PROJ takes heights of which nothing is said for meters.
        const double from_z = from_.vertical_unit.empty() ? 1.0 : from_.vertical_meters, to_z = to_.vertical_unit.empty() ? 1.0 : to_.vertical_meters;
        const double finest_plane = from_.earth_centered ? in.scale.minCoeff() : in.scale.head<2>().minCoeff();
        const double finest_z = from_.earth_centered ? finest_plane : in.scale.z();
        const double plane = scale_in(finest_plane, from_.unit_meters, to_.unit_meters), height = scale_in(finest_z, from_z, to_z);
        out.scale = to_.earth_centered ? Vec3d::Constant(std::min(plane, height)) : Vec3d(plane, plane, height);
        if (keeps_z_) out.scale.z() = in.scale.z();
        info_.bounds = {};
        if (bounds.empty()) return;
        for (int axis = 0; axis < 3; ++axis) {
            if (axis == 2 && keeps_z_) continue;
            double &scale = out.scale[axis], &offset = out.offset[axis];
            const double step = axis < 2 && to_.unit_meters == 0.0 ? 1.0 : 1000.0, finest = scale;
            offset = std::round(0.5 * (bounds.min[axis] + bounds.max[axis]) / step) * step + 0.0;
            while (std::max(std::abs(bounds.min[axis] - offset), std::abs(bounds.max[axis] - offset)) / scale >= kMostQuanta)
                scale = power_of_ten_below(10.0 * scale);
            if (scale != finest) info_.notes.push_back(std::string("the ") + "xyz"[axis] + " scale is widened to " + decimal(scale) + " to hold all points");
            info_.worst_rounding = std::max(info_.worst_rounding, 0.5 * scale);
        }
        info_.bounds.extend(on_grid(bounds.min));
        info_.bounds.extend(on_grid(bounds.max));
    }

    Vec3d on_grid(const Vec3d& p) const {
        const Quantization& grid = info_.quantization;
        Vec3d place;
        for (int axis = 0; axis < 3; ++axis)
            place[axis] = std::round((p[axis] - grid.offset[axis]) / grid.scale[axis]) * grid.scale[axis] + grid.offset[axis];
        return place;
    }

    void add_notes() {
        const auto note = [&](const std::string& text) { info_.notes.push_back(text); };
        if (keeps_z_ && from_.unit_meters != to_.unit_meters && from_.unit_meters != 1.0 && from_.unit_meters > 0.0)
            note("heights stay the numbers that they are: neither system says what they are in");
        if (!keeps_z_ && from_.vertical_unit.empty()) note(from_.name + " says nothing of heights: they are taken for meters above the ellipsoid, unless --in-crs says more");
        if (find_attribute(info_.attributes, attribute_name::kNormal[0]) >= 0) note("normals keep their directions: they are not turned with the axes");
    }

    void requantize(PointBatch& batch) const {
        thread_local Columns world;
        transform(batch, world);
        const std::array<std::vector<int32_t>*, 3> quanta = {&batch.x, &batch.y, &batch.z};
        for (size_t axis = 0; axis < (keeps_z_ ? 2 : 3); ++axis) {
            const double scale = info_.quantization.scale[Eigen::Index(axis)], offset = info_.quantization.offset[Eigen::Index(axis)];
            double least = 0.0, most = 0.0;
            for (size_t i = 0; i < batch.size; ++i) {
                const double q = std::round((world[axis][i] - offset) / scale);
                least = std::min(least, q);
                most = std::max(most, q);
                (*quanta[axis])[i] = int32_t(std::clamp(q, kLeastQuanta, kMostQuanta));
            }
            if (!(least >= kLeastQuanta && most <= kMostQuanta)) throw Error(ErrorKind::io, name_ + ": its points are not those that were read before");
        }
    }

    std::unique_ptr<PointSource> source_;
    std::unique_ptr<CrsTransformation> way_;
    std::string name_;
    CloudInfo info_;
    CrsDescription from_, to_;
    bool keeps_z_ = false;
};

}  // namespace

std::unique_ptr<PointSource> with_crs(std::unique_ptr<PointSource> source, const std::string& crs) {
    return std::make_unique<RenamedSource>(std::move(source), crs);
}

std::unique_ptr<PointSource> reproject_points(std::unique_ptr<PointSource> source, const std::string& to, const std::string& name, int threads) {
    const std::string from = source->info().crs;
    if (from.empty()) throw Error(ErrorKind::unsupported, name + ": the file does not say its coordinate reference system; say it, as in --in-crs EPSG:25832");
    // What a file says of its system stays as it is, keys and all; a PROJ string is only ever the caller's.
    if (same_crs(from, to)) return from.starts_with('+') ? with_crs(std::move(source), to) : std::move(source);
    std::unique_ptr<CrsTransformation> way;
    try {
        way = std::make_unique<CrsTransformation>(from, to);
    } catch (const Error& error) {
        throw error.within(name);
    }
    return std::make_unique<ReprojectedSource>(std::move(source), std::move(way), to, name, threads);
}

}  // namespace strata
