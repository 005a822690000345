#include "io/draco/draco_block.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/cloud/rgb_depth.h"
#include "core/error.h"
#include "core/math/morton.h"
#include "io/draco/draco_columns.h"
#include "io/draco/draco_layout.h"

namespace strata::drc {
namespace {

constexpr int kMostBits = 23;                   // of steps: Draco adds half a step in float32, which then is still exact
constexpr double kMostFloatSteps = 1 << 24;     // from zero, that float32 holds exactly
constexpr double kWorthSorting = 0.9;           // of the bits of positions, before the other columns are looked at in another order
constexpr int64_t kMostIntegerSteps = 1 << 25;  // Draco counts how often each difference comes: 4 bytes a step

std::vector<std::byte> numbers(const Vec3d& v) { return bytes_of(std::array{v.x(), v.y(), v.z()}); }

// The quanta of a batch, an axis each.
std::array<const std::vector<int32_t>*, 3> axes_of(const PointBatch& points) { return {&points.x, &points.y, &points.z}; }

// Positions as they go into a file, and what a reader needs to know of them.
struct Places {
    EncoderColumn column;
    Vec3i origin = Vec3i::Zero();      // quanta of the source where POSITION is zero
    Vec3d scale = Vec3d::Ones();       // world units: world = world of origin + scale * POSITION
    Vec3d grid_scale = Vec3d::Ones();  // of the quanta that a point is read back as
    bool exact = true;                 // these are the source's
    Box3d bounds;                      // world, as read back
};

// The range of a batch, an axis each.
struct QuantaRange {
    std::array<int32_t, 3> min{}, max{};
};

QuantaRange range_of(const PointBatch& points) {
    QuantaRange range;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto [low, high] = std::minmax_element(axes_of(points)[axis]->begin(), axes_of(points)[axis]->end());
        range.min[axis] = *low;
        range.max[axis] = *high;
    }
    return range;
}

// What each axis of a block may be off by.
Vec3d error_of(const BlockFrame& frame, const QuantaRange& range) {
    if (frame.max_error > 0.0) return Vec3d::Constant(frame.max_error);
    Vec3d error;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double extent = double(range.max[axis]) - range.min[axis];  // quanta
        error[Eigen::Index(axis)] = frame.quantization.scale[Eigen::Index(axis)] * std::max(0.5, extent / (1 << kMostBits));
    }
    return error;
}

// The greatest power of two that is at most `value`.
double power_of_two_below(double value) { return std::ldexp(1.0, std::ilogb(value)); }

// Positions as float32 on a grid of a power of two, the coarsest that the error allows: every decoder's arithmetic is exact
// on it. Points that span more steps than float32 has room for cannot be written so; then false.
bool place_on_grid(const PointBatch& points, const BlockFrame& frame, const QuantaRange& range, const Vec3d& max_error, Places& places) {
    const double step = power_of_two_below(2.0 * max_error.minCoeff());
    if (!(step > 0x1p-60 && step < 0x1p60)) return false;
    const Vec3d& scale = frame.quantization.scale;
    std::array<double, 3> low, high;  // steps
    bool near = true;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double ratio = scale[Eigen::Index(axis)] / step, zero = frame.origin[Eigen::Index(axis)];
        low[axis] = std::nearbyint((range.min[axis] - zero) * ratio);
        high[axis] = std::nearbyint((range.max[axis] - zero) * ratio);
        near = near && low[axis] >= -kMostFloatSteps && high[axis] <= kMostFloatSteps;
    }
    places.origin = frame.origin;
    if (!near)  // far from the others: zero is in its own corner
        for (size_t axis = 0; axis < 3; ++axis) {
            places.origin[Eigen::Index(axis)] = range.min[axis];
            low[axis] = 0.0;
            high[axis] = std::nearbyint((double(range.max[axis]) - range.min[axis]) * (scale[Eigen::Index(axis)] / step));
        }
    double most = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) most = std::max(most, high[axis] - low[axis]);
    if (most >= double(1 << kMostBits)) return false;

    places.column = {.header = {.kind = AttributeKind::position, .type = ScalarType::float32, .components = 3}};
    places.column.bits = std::max(1, int(std::bit_width(uint64_t(most))));
    places.column.step = float(step);
    places.column.values.resize(points.size * 3 * sizeof(float));
    places.scale = Vec3d::Ones();
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double ratio = scale[a] / step, zero = places.origin[a];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const float value = float(std::nearbyint((quanta[i] - zero) * ratio) * step);
            std::memcpy(places.column.values.data() + (3 * i + axis) * sizeof value, &value, sizeof value);
        }
        // On steps finer than the source's, the nearest of its quanta is the one that was there.
        const bool restored = step <= scale[a];
        places.exact = places.exact && restored;
        places.grid_scale[a] = restored ? scale[a] : step;
        const double offset = frame.quantization.offset[a] + zero * scale[a];
        places.bounds.min[a] = restored ? range.min[axis] * scale[a] + frame.quantization.offset[a] : offset + low[axis] * step;
        places.bounds.max[a] = restored ? range.max[axis] * scale[a] + frame.quantization.offset[a] : offset + high[axis] * step;
    }
    return true;
}

int64_t floor_divided(int64_t value, int64_t by) { return value >= 0 ? value / by : -((-value + by - 1) / by); }

// Positions as integers, every k-th of the source's quanta with odd k: any range and any scale an axis, and exact where the
// error asks for it, but other programs see steps, not world units.
void place_on_quanta(const PointBatch& points, const BlockFrame& frame, const QuantaRange& range, const Vec3d& max_error, Places& places) {
    places.column = {.header = {.kind = AttributeKind::position, .type = ScalarType::int32, .components = 3}, .delta = true};
    places.column.values.resize(points.size * 3 * sizeof(int32_t));
    places.exact = true;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double scale = frame.quantization.scale[a];
        // A whole number of quanta that the error holds, whatever the rounding of both as decimals.
        const int64_t half = int64_t(std::min(std::floor(max_error[a] / scale + 1e-9), 0x1p31)), k = 2 * half + 1;
        const int64_t spread = (int64_t(range.max[axis]) - range.min[axis]) / k;
        if (spread > kMostIntegerSteps)
            throw Error(ErrorKind::limit, std::string("along ") + "xyz"[axis] + " points are " + std::to_string(spread) + " steps of the error apart, at most " +
                                              std::to_string(kMostIntegerSteps) + " can be compressed; a greater --max-error is needed");
        const int64_t zero = frame.origin[a], least = floor_divided(range.min[axis] - zero + half, k), greatest = floor_divided(range.max[axis] - zero + half, k);
        const bool near = least >= std::numeric_limits<int32_t>::min() / 2 && greatest <= std::numeric_limits<int32_t>::max() / 2;
        places.origin[a] = near ? frame.origin[a] : range.min[axis];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const int32_t value = int32_t(floor_divided(int64_t(quanta[i]) - places.origin[a] + half, k));
            std::memcpy(places.column.values.data() + (3 * i + axis) * sizeof value, &value, sizeof value);
        }
        places.scale[a] = scale * double(k);
        places.grid_scale[a] = scale;
        places.exact = places.exact && k == 1;
        const auto world = [&](int64_t q) {
            return double(places.origin[a] + floor_divided(q - places.origin[a] + half, k) * k) * scale + frame.quantization.offset[a];
        };
        places.bounds.min[a] = world(range.min[axis]);
        places.bounds.max[a] = world(range.max[axis]);
    }
}

Entries metadata_of(const Places& places, const CloudInfo& info, const BlockFrame& frame, const Vec3d& max_error) {
    const Quantization& source = frame.quantization;
    const Vec3d zero = source.world_from_quanta(places.origin);
    Vec3d grid_offset = source.offset;
    Vec3i grid_origin = places.origin;
    for (int axis = 0; axis < 3; ++axis)
        if (places.grid_scale[axis] != source.scale[axis]) {
            grid_offset[axis] = zero[axis];
            grid_origin[axis] = 0;
        }
    Entries entries;
    const auto put = [&](std::string_view key, std::vector<std::byte> value) {
        if (!value.empty()) entries[std::string(key)] = std::move(value);
    };
    put(kLayout, bytes_of(int32_t{1}));
    put(kScale, numbers(places.scale));
    put(kOffset, numbers(zero));
    put(kMin, numbers(places.bounds.min));
    put(kMax, numbers(places.bounds.max));
    put(kMaxError, numbers(max_error));
    put(kGridScale, numbers(places.grid_scale));
    put(kGridOffset, numbers(grid_offset));
    put(kGridOrigin, bytes_of(std::array{grid_origin.x(), grid_origin.y(), grid_origin.z()}));
    put(kCrs, bytes_of(info.crs));
    return entries;
}

// Decodes what was encoded: other columns as they were, positions as far off as they are, which is returned.
double check_block(const std::vector<std::byte>& bytes, const std::vector<EncoderColumn>& columns, const PointBatch& points, const BlockFrame& frame,
                   const Places& places) {
    const std::string name = "encoded block";
    const DecodedPoints decoded = decode(bytes, read_header(*memory_source(name, bytes)), name);
    bool same = decoded.points == points.size && decoded.columns.size() == columns.size();
    for (size_t i = 1; same && i < columns.size(); ++i) same = decoded.columns[i].values == columns[i].values;
    if (!same) throw Error(ErrorKind::unsupported, "Draco does not give back what it was given");
    const Column& found = decoded.columns.front();
    const Lattice unit{.min = {0.0, 0.0, 0.0}, .range = 1.0, .bits = 1};  // of integers
    const Lattice& lattice = found.lattice ? *found.lattice : unit;
    const double step = lattice.range / double((uint64_t{1} << lattice.bits) - 1);
    double worst = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double scale = frame.quantization.scale[a], zero = places.origin[a];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const double value = lattice.min[axis] + step * load_scalar(found.header.type, found.values.data() + (3 * i + axis) * sizeof(int32_t));
            worst = std::max(worst, std::abs(value * places.scale[a] - (quanta[i] - zero) * scale));
        }
    }
    return worst;
}

// A block ready for the encoder.
struct Prepared {
    Places places;
    ColumnSet set;
};

Prepared prepare(const PointBatch& points, const CloudInfo& info, const BlockFrame& frame, const QuantaRange& range, const Vec3d& max_error) {
    Prepared prepared;
    if (!place_on_grid(points, frame, range, max_error, prepared.places)) place_on_quanta(points, frame, range, max_error, prepared.places);
    prepared.set.columns.push_back(std::move(prepared.places.column));
    prepared.set.bits = position_bits(prepared.set.columns.front(), {});
    add_attributes(points, info.attributes, frame.rgb_bits, prepared.set);
    return prepared;
}

// The points along a curve through their box, so that each lies near the one before it.
std::vector<uint32_t> morton_order(const PointBatch& points, const QuantaRange& range) {
    int shift = 0;  // 21 bits an axis go into a code
    for (size_t axis = 0; axis < 3; ++axis) shift = std::max(shift, int(std::bit_width(uint32_t(int64_t(range.max[axis]) - range.min[axis]))) - 21);
    std::vector<std::pair<uint64_t, uint32_t>> codes(points.size);
    const auto cell = [&](size_t axis, size_t i) { return uint32_t(int64_t((*axes_of(points)[axis])[i]) - range.min[axis]) >> shift; };
    for (size_t i = 0; i < points.size; ++i) codes[i] = {octant_code(cell(0, i), cell(1, i), cell(2, i)), uint32_t(i)};
    std::sort(codes.begin(), codes.end());
    std::vector<uint32_t> order(points.size);
    for (size_t i = 0; i < points.size; ++i) order[i] = codes[i].second;
    return order;
}

PointBatch in_order(const PointBatch& points, const std::vector<uint32_t>& order, const std::vector<Attribute>& attributes) {
    PointBatch sorted;
    sorted.size = points.size;
    sorted.columns.resize(points.columns.size());
    const auto take = [&](const std::vector<int32_t>& from, std::vector<int32_t>& to) {
        to.resize(order.size());
        for (size_t i = 0; i < order.size(); ++i) to[i] = from[order[i]];
    };
    take(points.x, sorted.x);
    take(points.y, sorted.y);
    take(points.z, sorted.z);
    for (size_t a = 0; a < points.columns.size(); ++a) {
        const size_t size = attributes[a].size_bytes();
        sorted.columns[a].resize(points.columns[a].size());
        for (size_t i = 0; i < order.size(); ++i) std::memcpy(sorted.columns[a].data() + i * size, points.columns[a].data() + order[i] * size, size);
    }
    return sorted;
}

}  // namespace

BlockFrame block_frame(const PointSource& source, double max_error, int threads) {
    const CloudInfo& info = source.info();
    BlockFrame frame{.quantization = info.quantization, .max_error = max_error};
    for (int axis = 0; axis < 3; ++axis) {
        const double scale = info.quantization.scale[axis], low = info.bounds.min[axis], extent = info.bounds.max[axis] - low;
        const bool known = std::isfinite(extent) && extent >= 0.0;
        const double corner = known ? std::nearbyint((low - info.quantization.offset[axis]) / scale) : 0.0;
        frame.origin[axis] = int32_t(std::clamp(corner, double(std::numeric_limits<int32_t>::min()), double(std::numeric_limits<int32_t>::max())));
    }
    frame.rgb_bits = rgb_depth(source, threads) > 8 ? 16 : 8;
    return frame;
}

EncodedBlock encode_block(const PointBatch& points, const CloudInfo& info, const BlockFrame& frame) {
    const QuantaRange range = range_of(points);
    const Vec3d max_error = error_of(frame, range);
    Prepared best = prepare(points, info, frame, range, max_error);
    PointBatch sorted;
    const std::vector<uint32_t> order = morton_order(points, range);
    if (position_bits(best.set.columns.front(), order) < kWorthSorting * position_bits(best.set.columns.front(), {})) {
        sorted = in_order(points, order, info.attributes);
        Prepared other = prepare(sorted, info, frame, range, max_error);
        if (other.set.bits < best.set.bits)
            best = std::move(other);
        else
            sorted = {};
    }
    EncodedBlock block;
    block.bytes = encode(uint32_t(points.size), best.set.columns, metadata_of(best.places, info, frame, max_error));
    block.worst_error = check_block(block.bytes, best.set.columns, sorted.size > 0 ? sorted : points, frame, best.places);
    block.exact = best.places.exact;
    return block;
}

}  // namespace strata::drc
