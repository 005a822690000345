#include "core/surface/point_layers.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "core/parallel.h"
#include "core/surface/brick_layers.h"
#include "core/surface/class_vote.h"
#include "core/voxel/voxel_record.h"

namespace strata {
namespace {

std::string number_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

constexpr size_t kBlockBytes = 6144;  // small, as each layer keeps one that is not full
constexpr double kMostUnits = 1 << 20;

using Place = std::array<int32_t, 3>;

Place place_in(const std::byte* record) {
    Place place;
    std::memcpy(place.data(), record + sizeof(uint64_t), sizeof place);
    return place;
}

void put_head(std::byte* record, uint64_t layer, const Place& place) {
    const uint64_t key = key_of_code(layer);
    std::memcpy(record, &key, sizeof key);
    std::memcpy(record + sizeof key, place.data(), sizeof place);
}

// Writes what is kept of a source's points.
class RecordMaker {
public:
    RecordMaker(const PointForm& form, const std::vector<Attribute>& attributes) : form_(form), attributes_(attributes) {
        if (form.colors) want(rgb_ = find_attribute(attributes, attribute_name::kRgb));
        assert(!form.colors || rgb_ >= 0);
        for (size_t axis = 0; axis < 3; ++axis) normal_[axis] = find_attribute(attributes, attribute_name::kNormal[axis]);
        has_normals_ = form.normals && *std::min_element(normal_.begin(), normal_.end()) >= 0;
        if (has_normals_)
            for (const int attribute : normal_) want(attribute);
        for (const PointForm::Scalar& scalar : form.scalars) want(scalar.attribute);
        std::sort(wanted_.begin(), wanted_.end());
        wanted_.erase(std::unique(wanted_.begin(), wanted_.end()), wanted_.end());
    }

    std::span<const int> wanted() const { return wanted_; }
    const NormalCount& normals() const { return normals_; }

    void put(const PointBatch& batch, size_t i, std::byte* record) {
        if (form_.colors) {
            const uint16_t* const rgb = batch.column<uint16_t>(size_t(rgb_)).data() + 3 * i;
            const std::array<uint16_t, 4> color = {rgb[0], rgb[1], rgb[2], 0};  // no byte of a record is undefined
            std::memcpy(record + form_.color_at(), color.data(), sizeof color);
        }
        if (form_.normals) {
            Vec3d normal = Vec3d::Zero();
            for (size_t axis = 0; axis < 3 && has_normals_; ++axis) normal[int(axis)] = value(batch, normal_[axis], 0, i);
            const double length = normal.norm();
            const bool known = length > 0.0 && std::isfinite(length);
            const Vec3f unit = known ? Vec3f((normal / length).cast<float>()) : Vec3f(Vec3f::Zero());
            normals_.points += known;
            normals_.up += known && !(normal.z() < 0.0);
            std::memcpy(record + form_.normal_at(), unit.data(), 3 * sizeof(float));
        }
        for (size_t s = 0; s < form_.scalars.size(); ++s) {
            const float number = float(value(batch, form_.scalars[s].attribute, form_.scalars[s].component, i));
            std::memcpy(record + form_.scalars_at() + 4 * s, &number, sizeof number);
        }
    }

private:
    void want(int attribute) { wanted_.push_back(attribute); }

    double value(const PointBatch& batch, int attribute, int component, size_t i) const {
        const Attribute& a = attributes_[size_t(attribute)];
        const double stored = load_scalar(a.type, batch.columns[size_t(attribute)].data() + i * a.size_bytes() + size_t(component) * scalar_size(a.type));
        return stored == a.no_data ? std::numeric_limits<double>::quiet_NaN() : stored * a.scale + a.offset;
    }

    const PointForm& form_;
    const std::vector<Attribute>& attributes_;
    std::vector<int> wanted_;
    int rgb_ = -1;
    std::array<int, 3> normal_ = {-1, -1, -1};
    bool has_normals_ = false;
    NormalCount normals_;
};

// What the records of a layer are sorted by.
struct CellRecord {
    uint64_t cell;  // j and i of the brick, then k, j and i of the cell of half a spacing in it
    uint32_t record;

    uint64_t brick() const { return cell >> 12; }
    BrickPlace corner() const { return {int32_t(cell >> 12 & 0xffff) * kFieldBrickSide, int32_t(cell >> 40) * kFieldBrickSide}; }
};

void check_room(uint64_t points, uint64_t bytes_each, uint64_t memory_bytes) {
    if (points <= ~uint32_t{0} && points * bytes_each <= memory_bytes) return;
    throw Error(ErrorKind::limit, "the points of one layer of bricks need " + std::to_string(points * bytes_each) + " bytes of memory, " + std::to_string(memory_bytes) +
                                      " are left of what is allowed; fewer points, or a smaller voxel size, need less");
}

// Adds points to a layer, each made of one record or of several.
class PointMaker {
public:
    PointMaker(const PointForm& form, const PointGrid& grid, size_t layer, PointLayer& out) : form_(form), grid_(grid), layer_(layer), out_(out) {}

    void reserve(size_t points, size_t bricks) {
        out_.corners.reserve(bricks);
        out_.begins.reserve(bricks + 1);
        out_.places.reserve(points);
        if (form_.colors) out_.colors.reserve(points);
        if (form_.normals) out_.normals.reserve(points);
        out_.scalars.reserve(points * form_.scalars.size());
    }

    void add(const std::vector<std::byte>& records, std::span<const CellRecord> some) {
        const BrickPlace corner = some[0].corner();
        if (out_.corners.empty() || out_.corners.back() != corner) {
            out_.corners.push_back(corner);
            out_.begins.push_back(uint32_t(out_.points()));
        }
        records_.clear();
        for (const CellRecord& one : some) records_.push_back(records.data() + size_t{one.record} * form_.record_bytes());
        out_.places.push_back(mean_place(corner));
        if (form_.colors) out_.colors.push_back(mean_color());
        if (form_.normals) out_.normals.push_back(direction());
        for (size_t s = 0; s < form_.scalars.size(); ++s) out_.scalars.push_back(form_.scalars[s].is_class ? class_of(s) : mean_of(s));
    }

private:
    // From the least sample of the brick, spacings.
    Vec3f mean_place(const BrickPlace& corner) const {
        std::array<int64_t, 3> sums = {};
        for (const std::byte* record : records_) {
            const Place place = place_in(record);
            for (size_t axis = 0; axis < 3; ++axis) sums[axis] += place[axis];
        }
        const auto count = int64_t(records_.size());
        const std::array<int64_t, 3> least = {corner[0], corner[1], int64_t(layer_) * kFieldBrickSide};
        Vec3f place;
        for (size_t axis = 0; axis < 3; ++axis) {
            const int64_t mean = (sums[axis] + count / 2) / count;
            place[int(axis)] = float(double(mean - least[axis] * int64_t(grid_.units)) / grid_.units);
        }
        return place;
    }
    std::array<uint16_t, 3> mean_color() const {
        std::array<uint64_t, 3> sums = {};
        for (const std::byte* record : records_) {
            std::array<uint16_t, 3> rgb;
            std::memcpy(rgb.data(), record + form_.color_at(), sizeof rgb);
            for (size_t c = 0; c < 3; ++c) sums[c] += rgb[c];
        }
        std::array<uint16_t, 3> mean;
        for (size_t c = 0; c < 3; ++c) mean[c] = uint16_t(std::lround(double(sums[c]) / double(records_.size())));
        return mean;
    }
    // Of the sum of normals; those that cancel say nothing.
    Vec3f direction() const {
        Vec3d sum = Vec3d::Zero();
        for (const std::byte* record : records_) {
            Vec3f unit;
            std::memcpy(unit.data(), record + form_.normal_at(), 3 * sizeof(float));
            if (records_.size() == 1) return unit;
            sum += unit.cast<double>();
        }
        return sum.norm() > 1e-3 * double(records_.size()) ? Vec3f(sum.normalized().cast<float>()) : Vec3f(Vec3f::Zero());
    }
    float number_in(const std::byte* record, size_t scalar) const {
        float number;
        std::memcpy(&number, record + form_.scalars_at() + 4 * scalar, sizeof number);
        return number;
    }
    float mean_of(size_t scalar) const {
        double sum = 0.0;
        size_t known = 0;
        for (const std::byte* record : records_) {
            const float number = number_in(record, scalar);
            if (std::isnan(number)) continue;
            sum += double(number);
            ++known;
        }
        return known == 0 ? std::numeric_limits<float>::quiet_NaN() : float(sum / double(known));
    }
    float class_of(size_t scalar) {
        votes_.clear();
        for (const std::byte* record : records_)
            if (const float number = number_in(record, scalar); !std::isnan(number)) votes_.push_back({number, 1.0});
        return most_voted(votes_);
    }

    const PointForm& form_;
    const PointGrid& grid_;
    size_t layer_;
    PointLayer& out_;
    std::vector<const std::byte*> records_;  // of the point that is made
    std::vector<ClassVote> votes_;
};

}  // namespace

PointGrid PointGrid::around(const Box3d& bounds, double spacing, double reach) {
    if (!(spacing > 0.0)) throw Error(ErrorKind::usage, "the spacing of samples is positive");
    PointGrid grid;
    grid.spacing = spacing;
    const double side = kFieldBrickSide * spacing;
    double most = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        const double first = std::floor((bounds.min[axis] - reach * spacing) / side) - 1.0;
        const double last = std::floor((bounds.max[axis] + reach * spacing) / side) + 1.0;
        if (!(last >= first)) throw Error(ErrorKind::limit, "no bounds to lay samples in");
        if (!(last - first < double(1 << 15)))
            throw Error(ErrorKind::limit, "points reach from " + number_text(bounds.min[axis]) + " to " + number_text(bounds.max[axis]) + " along " + "xyz"[axis] +
                                              ": more than 2^18 samples " + number_text(spacing) + " apart; some may lie far from all others, or samples must be farther apart");
        grid.placement.origin[axis] = first * side;
        grid.bricks[size_t(axis)] = uint64_t(last - first) + 1;
        most = std::max(most, double(grid.bricks[size_t(axis)]) * kFieldBrickSide);
    }
    grid.placement.axes = spacing * Mat3d::Identity();
    for (grid.units = kMostUnits; most * grid.units > 0x1p31;) grid.units /= 2.0;
    return grid;
}

size_t find_brick(const std::vector<std::array<int32_t, 2>>& corners, const std::array<int32_t, 2>& corner) {
    const auto found = std::lower_bound(corners.begin(), corners.end(), corner, comes_before);
    return found != corners.end() && *found == corner ? size_t(found - corners.begin()) : corners.size();
}

uint64_t PointLayer::memory_bytes() const {
    return corners.size() * (sizeof corners[0] + sizeof begins[0]) + places.size() * sizeof places[0] + normals.size() * sizeof normals[0] + colors.size() * sizeof colors[0] +
           scalars.size() * sizeof scalars[0];
}

PointLayers::PointLayers(const PointGrid& grid, const PointForm& form, uint64_t memory_bytes, ScratchBlocks& scratch)
    : grid_(grid), form_(form), pool_(kBlockBytes, scratch.present() ? std::max<uint64_t>(memory_bytes, kBlockBytes) : ~uint64_t{0}) {
    std::vector<uint64_t> first_codes(grid.bricks[2]);
    std::iota(first_codes.begin(), first_codes.end(), uint64_t{0});
    buckets_ = std::make_unique<RecordBuckets>(std::move(first_codes), form_.record_bytes(), pool_, scratch);
}

PointLayers::~PointLayers() = default;

uint64_t PointLayers::distribute(const PointSource& points, int threads, const std::function<void(uint64_t points)>& on_points) {
    const Quantization& quantization = points.info().quantization;
    const double side = kFieldBrickSide * grid_.units;
    // What rounds to a place within.
    const Eigen::Array3d least = Eigen::Array3d::Constant(side - 0.5);
    const Eigen::Array3d limit = side * (Eigen::Array3d(double(grid_.bricks[0]), double(grid_.bricks[1]), double(grid_.bricks[2])) - 1.0) - 0.5;
    const size_t size = form_.record_bytes();
    std::atomic<uint64_t> next = 0, outside = 0, normals = 0, up = 0;
    std::atomic<bool> failed = false;
    parallel_workers(threads, [&](int) {
        try {
            PointBatch batch;
            RecordMaker maker(form_, points.info().attributes);
            std::vector<Place> places;
            std::vector<std::array<uint32_t, 2>> order;  // layer, point
            std::vector<std::byte> records;
            for (uint64_t index; !failed && (index = next++) < points.batch_count();) {
                points.read_batch(index, maker.wanted(), batch);
                places.resize(batch.size);
                order.clear();
                for (size_t i = 0; i < batch.size; ++i) {
                    const Eigen::Array3d p = (quantization.world_from_quanta({batch.x[i], batch.y[i], batch.z[i]}) - grid_.placement.origin).array() / grid_.spacing * grid_.units;
                    if (!((p >= least).all() && (p < limit).all())) {
                        ++outside;
                        continue;
                    }
                    places[i] = {int32_t(std::lround(p.x())), int32_t(std::lround(p.y())), int32_t(std::lround(p.z()))};
                    order.push_back({uint32_t(double(places[i][2]) / side), uint32_t(i)});
                }
                std::sort(order.begin(), order.end());
                records.resize(order.size() * size);
                for (size_t n = 0; n < order.size(); ++n) {
                    std::byte* const record = records.data() + n * size;
                    put_head(record, order[n][0], places[order[n][1]]);
                    maker.put(batch, order[n][1], record);
                }
                buckets_->add(records);
                if (on_points) on_points(batch.size);
            }
            normals += maker.normals().points;
            up += maker.normals().up;
        } catch (...) {
            failed = true;
            throw;
        }
    });
    outside_ += outside;
    normals_.add({normals, up});
    return outside;
}

void PointLayers::add(size_t layer, const PointLayer& points) {
    const size_t size = form_.record_bytes();
    std::vector<std::byte> records;
    for (size_t b = 0; b < points.corners.size(); ++b) {
        records.assign((points.begins[b + 1] - points.begins[b]) * size, std::byte{0});
        std::byte* record = records.data();
        for (size_t p = points.begins[b]; p < points.begins[b + 1]; ++p, record += size) {
            Place place;
            const Vec3d corner(points.corners[b][0], points.corners[b][1], double(layer) * kFieldBrickSide);
            for (size_t axis = 0; axis < 3; ++axis) place[axis] = int32_t(std::lround((corner[int(axis)] + double(points.places[p][int(axis)])) * grid_.units));
            put_head(record, layer, place);
            if (form_.colors) std::memcpy(record + form_.color_at(), points.colors[p].data(), sizeof points.colors[p]);
            if (form_.normals) std::memcpy(record + form_.normal_at(), points.normals[p].data(), 3 * sizeof(float));
            if (!form_.scalars.empty()) std::memcpy(record + form_.scalars_at(), points.scalars.data() + p * form_.scalars.size(), 4 * form_.scalars.size());
        }
        buckets_->add(records);
    }
}

void PointLayers::take_places(size_t layer, uint64_t memory_bytes, std::vector<std::array<int32_t, 3>>& out) {
    out.clear();
    check_room(points(layer), sizeof out[0], memory_bytes);
    const size_t size = form_.record_bytes();
    out.reserve(points(layer));
    buckets_->take(layer, [&](std::span<const std::byte> bytes) {
        for (size_t at = 0; at < bytes.size(); at += size) out.push_back(place_in(bytes.data() + at));
    });
}

struct PointLayers::Sorted {
    std::vector<std::byte> records;
    std::vector<CellRecord> order;
};

PointLayers::Sorted PointLayers::read_sorted(size_t layer) {
    const size_t size = form_.record_bytes(), count = size_t(points(layer));
    Sorted sorted;
    sorted.records.reserve(count * size);
    buckets_->take(layer, [&](std::span<const std::byte> bytes) { sorted.records.insert(sorted.records.end(), bytes.begin(), bytes.end()); });
    const double per_cell = 2.0 / grid_.units;
    sorted.order.resize(count);
    for (size_t n = 0; n < count; ++n) {
        const Place place = place_in(sorted.records.data() + n * size);
        std::array<uint64_t, 3> cell;
        for (size_t axis = 0; axis < 3; ++axis) cell[axis] = uint64_t(double(place[axis]) * per_cell);
        sorted.order[n] = {(cell[1] >> 4) << 40 | (cell[0] >> 4) << 12 | (cell[2] & 15) << 8 | (cell[1] & 15) << 4 | (cell[0] & 15), uint32_t(n)};
    }
    // Of points in one cell, their records decide: where all bytes are the same, either may come first.
    const auto rest = [&](uint32_t n) { return sorted.records.data() + size_t{n} * size + sizeof(uint64_t); };
    std::sort(sorted.order.begin(), sorted.order.end(), [&](const CellRecord& a, const CellRecord& b) {
        return a.cell != b.cell ? a.cell < b.cell : std::memcmp(rest(a.record), rest(b.record), size - sizeof(uint64_t)) < 0;
    });
    return sorted;
}

PointLayer PointLayers::take(size_t layer, bool merge, uint64_t memory_bytes, std::vector<std::array<int32_t, 3>>* places) {
    PointLayer out;
    if (places != nullptr) places->clear();
    const uint64_t count = points(layer);
    if (count == 0) return out;
    const size_t size = form_.record_bytes();
    // As records, sorted, and as what is made of them.
    check_room(count, 2 * size + sizeof(CellRecord) + (places != nullptr ? sizeof(Place) : 0), memory_bytes);
    const Sorted sorted = read_sorted(layer);
    if (places != nullptr) {
        places->reserve(count);
        for (size_t n = 0; n < count; ++n) places->push_back(place_in(sorted.records.data() + n * size));
    }
    const std::vector<CellRecord>& order = sorted.order;
    size_t cells = 1, bricks = 1;
    for (size_t n = 1; n < count; ++n) {
        cells += order[n].cell != order[n - 1].cell;
        bricks += order[n].brick() != order[n - 1].brick();
    }
    PointMaker maker(form_, grid_, layer, out);
    maker.reserve(merge ? cells : count, bricks);
    for (size_t begin = 0, end; begin < count; begin = end) {
        for (end = begin + 1; merge && end < count && order[end].cell == order[begin].cell;) ++end;
        maker.add(sorted.records, {order.data() + begin, end - begin});
    }
    out.begins.push_back(uint32_t(out.points()));
    return out;
}

}  // namespace strata
