#include "core/surface/point_layers.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "core/parallel.h"
#include "core/voxel/voxel_record.h"

namespace strata {
namespace {

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

float mean_of(const std::vector<float>& numbers) {
    return numbers.empty() ? std::numeric_limits<float>::quiet_NaN() : float(std::accumulate(numbers.begin(), numbers.end(), 0.0) / double(numbers.size()));
}

// The least of those that are equally frequent.
float most_frequent(std::vector<float>& numbers) {
    std::sort(numbers.begin(), numbers.end());
    float found = std::numeric_limits<float>::quiet_NaN();
    size_t most = 0;
    for (size_t begin = 0, end; begin < numbers.size(); begin = end) {
        for (end = begin + 1; end < numbers.size() && numbers[end] == numbers[begin];) ++end;
        if (end - begin > most) {
            most = end - begin;
            found = numbers[begin];
        }
    }
    return found;
}

// Writes what is kept of a source's points.
class RecordMaker {
public:
    RecordMaker(const PointForm& form, const std::vector<Attribute>& attributes) : form_(form), attributes_(attributes) {
        if (form.colors) want(rgb_ = find_attribute(attributes, attribute_name::kRgb));
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
        if (!(last - first < double(1 << 15)))
            throw Error(ErrorKind::limit, "more than 2^18 samples along an axis; a larger spacing has fewer");
        grid.placement.origin[axis] = first * side;
        most = std::max(most, (last - first + 1.0) * kFieldBrickSide);
        if (axis == 2) grid.layers = uint64_t(last - first) + 1;
    }
    grid.placement.axes = spacing * Mat3d::Identity();
    for (grid.units = kMostUnits; most * grid.units > 0x1p31;) grid.units /= 2.0;
    return grid;
}

size_t PointLayer::find(const std::array<int32_t, 2>& corner) const {
    const auto found = std::lower_bound(corners.begin(), corners.end(), corner, [](const auto& a, const auto& b) { return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0]; });
    return found != corners.end() && *found == corner ? size_t(found - corners.begin()) : corners.size();
}

uint64_t PointLayer::memory_bytes() const {
    return corners.size() * (sizeof corners[0] + sizeof begins[0]) + places.size() * sizeof places[0] + normals.size() * sizeof normals[0] + colors.size() * sizeof colors[0] +
           scalars.size() * sizeof scalars[0];
}

PointLayers::PointLayers(const PointGrid& grid, const PointForm& form, uint64_t memory_bytes, ScratchBlocks& scratch)
    : grid_(grid), form_(form), pool_(kBlockBytes, scratch.present() ? std::max<uint64_t>(memory_bytes, kBlockBytes) : ~uint64_t{0}) {
    std::vector<uint64_t> first_codes(grid.layers);
    std::iota(first_codes.begin(), first_codes.end(), uint64_t{0});
    buckets_ = std::make_unique<RecordBuckets>(std::move(first_codes), form_.record_bytes(), pool_, scratch);
}

PointLayers::~PointLayers() = default;

void PointLayers::distribute(const PointSource& points, int threads, const std::function<void(uint64_t points)>& on_points) {
    const Quantization& quantization = points.info().quantization;
    const double side = kFieldBrickSide * grid_.units, limit = double(grid_.layers) * side, width = 0x1p31 - 1.0;
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
                    const Vec3d p = (quantization.world_from_quanta({batch.x[i], batch.y[i], batch.z[i]}) - grid_.placement.origin) / grid_.spacing * grid_.units;
                    if (!(p.minCoeff() >= 0.0 && p.maxCoeff() < width && p.z() < limit - 1.0)) {
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
    outside_ = outside;
    normals_ = {normals, up};
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

void PointLayers::take_places(size_t layer, std::vector<std::array<int32_t, 3>>& out) {
    const size_t size = form_.record_bytes();
    out.clear();
    out.reserve(points(layer));
    buckets_->take(layer, [&](std::span<const std::byte> bytes) {
        for (size_t at = 0; at < bytes.size(); at += size) out.push_back(place_in(bytes.data() + at));
    });
}

PointLayer PointLayers::take(size_t layer, bool merge, uint64_t memory_bytes, std::vector<std::array<int32_t, 3>>* places) {
    PointLayer out;
    if (places != nullptr) places->clear();
    const uint64_t count = points(layer);
    if (count == 0) return out;
    const size_t size = form_.record_bytes();
    struct Order {
        uint64_t cell;  // j and i of the brick, then k, j and i of the cell of half a spacing in it
        uint32_t record;
    };
    if (count > ~uint32_t{0} || count * (2 * size + sizeof(Order)) > memory_bytes)
        throw Error(ErrorKind::limit, "the points of one layer of bricks need " + std::to_string(count * (2 * size + sizeof(Order))) + " bytes of memory, " + std::to_string(memory_bytes) +
                                          " are allowed; fewer points, or a smaller voxel size, need less");
    std::vector<std::byte> records;
    records.reserve(count * size);
    buckets_->take(layer, [&](std::span<const std::byte> bytes) { records.insert(records.end(), bytes.begin(), bytes.end()); });

    const double per_cell = 2.0 / grid_.units;
    std::vector<Order> order(count);
    for (size_t n = 0; n < count; ++n) {
        const Place place = place_in(records.data() + n * size);
        if (places != nullptr) places->push_back(place);
        std::array<uint64_t, 3> cell;
        for (size_t axis = 0; axis < 3; ++axis) cell[axis] = uint64_t(double(place[axis]) * per_cell);
        order[n] = {(cell[1] >> 4) << 40 | (cell[0] >> 4) << 12 | (cell[2] & 15) << 8 | (cell[1] & 15) << 4 | (cell[0] & 15), uint32_t(n)};
    }
    // Of points in one cell, their records decide: where all bytes are the same, either may come first.
    const auto rest = [&](uint32_t n) { return records.data() + size_t{n} * size + sizeof(uint64_t); };
    std::sort(order.begin(), order.end(), [&](const Order& a, const Order& b) {
        return a.cell != b.cell ? a.cell < b.cell : std::memcmp(rest(a.record), rest(b.record), size - sizeof(uint64_t)) < 0;
    });

    std::vector<float> numbers;
    for (size_t begin = 0, end; begin < count; begin = end) {
        for (end = begin + 1; merge && end < count && order[end].cell == order[begin].cell;) ++end;
        const double n = double(end - begin);
        const std::array<int32_t, 2> corner = {int32_t(order[begin].cell >> 12 & 0xffff) * kFieldBrickSide, int32_t(order[begin].cell >> 40) * kFieldBrickSide};
        if (out.corners.empty() || out.corners.back() != corner) {
            out.corners.push_back(corner);
            out.begins.push_back(uint32_t(out.points()));
        }
        std::array<int64_t, 3> sums = {};
        std::array<uint64_t, 3> color = {};
        Vec3d normal = Vec3d::Zero();
        for (size_t m = begin; m < end; ++m) {
            const std::byte* const record = records.data() + size_t{order[m].record} * size;
            const Place place = place_in(record);
            for (size_t axis = 0; axis < 3; ++axis) sums[axis] += place[axis];
            std::array<uint16_t, 3> rgb = {};
            if (form_.colors) std::memcpy(rgb.data(), record + form_.color_at(), sizeof rgb);
            for (size_t c = 0; c < 3; ++c) color[c] += rgb[c];
            Vec3f unit = Vec3f::Zero();
            if (form_.normals) std::memcpy(unit.data(), record + form_.normal_at(), 3 * sizeof(float));
            normal += unit.cast<double>();
        }
        const std::array<int64_t, 3> least = {corner[0], corner[1], int64_t(layer) * kFieldBrickSide};
        Vec3f place;
        for (size_t axis = 0; axis < 3; ++axis) {
            const int64_t mean = (sums[axis] + int64_t(end - begin) / 2) / int64_t(end - begin);
            place[int(axis)] = float(double(mean - least[axis] * int64_t(grid_.units)) / grid_.units);
        }
        out.places.push_back(place);
        if (form_.colors) {
            std::array<uint16_t, 3> rgb;
            for (size_t c = 0; c < 3; ++c) rgb[c] = uint16_t(std::lround(double(color[c]) / n));
            out.colors.push_back(rgb);
        }
        // Normals that cancel say nothing.
        if (form_.normals) out.normals.push_back(normal.norm() > 1e-3 * n ? Vec3f(normal.normalized().cast<float>()) : Vec3f(Vec3f::Zero()));
        for (size_t s = 0; s < form_.scalars.size(); ++s) {
            numbers.clear();
            for (size_t m = begin; m < end; ++m) {
                float number;
                std::memcpy(&number, records.data() + size_t{order[m].record} * size + form_.scalars_at() + 4 * s, sizeof number);
                if (!std::isnan(number)) numbers.push_back(number);
            }
            out.scalars.push_back(form_.scalars[s].is_class ? most_frequent(numbers) : mean_of(numbers));
        }
    }
    out.begins.push_back(uint32_t(out.points()));
    return out;
}

}  // namespace strata
