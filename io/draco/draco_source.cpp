#include "io/draco/draco_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "io/draco/draco_decoder.h"
#include "io/draco/draco_layout.h"

namespace strata {
namespace drc {

using namespace attribute_name;

/// How one attribute of the cloud comes from the columns that Draco decodes.
struct AttributePlan {
    enum class How { copy, rgb, component, words };
    How how = How::copy;
    std::vector<int> columns;  // one, or the words, lowest first
    int component = 0;         // of a column that is taken apart
};

/// How all of the cloud comes from them.
struct Plan {
    int position = -1;  // column
    // quanta = round(value * ratio + shift). Values are as decoded, where Draco quantized them steps of its grid; in files
    // of our own they are what other programs see, whether Draco quantized them or not.
    Vec3d ratio = Vec3d::Ones(), shift = Vec3d::Zero();
    bool of_steps = true;
    std::vector<AttributePlan> attributes;
};

/// A decoded file; words are put together already.
struct Points {
    size_t size = 0;
    std::vector<Column> columns;
    std::vector<std::vector<std::byte>> joined;  // one an attribute of the cloud; empty unless of words
    Vec3d ratio = Vec3d::Ones(), shift = Vec3d::Zero();  // of the plan, for the values as decoded
};

namespace {

constexpr double kLeastQuanta = std::numeric_limits<int32_t>::min(), kMostQuanta = std::numeric_limits<int32_t>::max();

// The values of an entry, exactly `count` of them; empty: there is none.
template <typename T>
std::vector<T> numbers_of(const Entries& entries, std::string_view key, size_t count, const std::string& place) {
    const auto found = entries.find(key);
    if (found == entries.end()) return {};
    if (found->second.size() != count * sizeof(T))
        throw Error(ErrorKind::malformed, place + ": metadata '" + std::string(key) + "': " + std::to_string(count * sizeof(T)) +
                                              " bytes expected, got " + std::to_string(found->second.size()));
    std::vector<T> values(count);
    std::memcpy(values.data(), found->second.data(), found->second.size());
    return values;
}

std::string text_of(const Entries& entries, std::string_view key) {
    const auto found = entries.find(key);
    if (found == entries.end()) return {};
    return {reinterpret_cast<const char*>(found->second.data()), found->second.size()};
}

// Three finite numbers that must be there.
Vec3d vector_of(const Entries& entries, std::string_view key, const std::string& place) {
    const std::vector<double> values = numbers_of<double>(entries, key, 3, place);
    if (values.empty() || !std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
        throw Error(ErrorKind::malformed, place + ": metadata '" + std::string(key) + "': three finite numbers expected");
    return {values[0], values[1], values[2]};
}

// What readers and renderers take for granted of an attribute of that name.
struct KnownAttribute {
    std::string_view name;
    ScalarType type;
    int components;
};
constexpr KnownAttribute kKnown[] = {
    {kIntensity, ScalarType::uint16, 1},  {kReturnNumber, ScalarType::uint8, 1}, {kNumberOfReturns, ScalarType::uint8, 1},
    {kClassificationFlags, ScalarType::uint8, 1}, {kClassification, ScalarType::uint8, 1}, {kScanAngleRank, ScalarType::int8, 1},
    {kScanAngle, ScalarType::int16, 1}, {kUserData, ScalarType::uint8, 1}, {kPointSourceId, ScalarType::uint16, 1},
    {kGpsTime, ScalarType::float64, 1}, {kRgb, ScalarType::uint16, 3}, {kNearInfrared, ScalarType::uint16, 1},
    {kNormal[0], ScalarType::float32, 1}, {kNormal[1], ScalarType::float32, 1}, {kNormal[2], ScalarType::float32, 1},
    {kDensity, ScalarType::float32, 1}};

std::optional<ScalarType> scalar_named(std::string_view name) {
    constexpr std::array kAll = {ScalarType::int8, ScalarType::uint8, ScalarType::int16, ScalarType::uint16, ScalarType::int32,
                                 ScalarType::uint32, ScalarType::int64, ScalarType::uint64, ScalarType::float32, ScalarType::float64};
    for (const ScalarType type : kAll)
        if (scalar_name(type) == name) return type;
    return std::nullopt;
}

bool is_ours(const Header& header) { return !header.mesh && header.metadata.contains(kLayout); }

/// Makes the attributes of a cloud and their plans from what a file says of its own.
class AttributePlanner {
public:
    AttributePlanner(const Header& header, const std::string& name, CloudInfo& info, Plan& plan)
        : header_(header), name_(name), info_(info), plan_(plan), ours_(is_ours(header)) {}

    void add_all(const std::vector<AttributeHeader>& attributes) {
        for (size_t i = 0; i < attributes.size(); ++i) add(attributes[i], int(i));
        if (plan_.position < 0) throw Error(ErrorKind::malformed, name_ + ": no attribute POSITION");
        for (size_t i = 0; i < plan_.attributes.size(); ++i)
            for (const int column : plan_.attributes[i].columns)
                if (column < 0) throw Error(ErrorKind::malformed, name_ + ": attribute '" + info_.attributes[i].name + "': a word is missing");
    }

private:
    void add(const AttributeHeader& attribute, int column) {
        static const Entries none;
        const auto found = header_.attribute_metadata.find(attribute.id);
        const Entries& entries = found == header_.attribute_metadata.end() ? none : found->second;
        switch (attribute.kind) {
            case AttributeKind::position:
                if (plan_.position >= 0) {
                    info_.notes.push_back("a second attribute POSITION is left out");
                    return;
                }
                plan_.position = column;
                return;
            case AttributeKind::normal:
                if (attribute.components == 3 && find_attribute(info_.attributes, kNormal[0]) < 0) return add_normal(column);
                break;
            case AttributeKind::color:
                if (find_attribute(info_.attributes, kRgb) < 0) return add_color(attribute, column);
                break;
            default: break;
        }
        if (ours_ && entries.contains(kWord)) return add_word(entries, attribute, column);
        Attribute plain = described(entries, name_of(attribute.kind, entries));
        plain.type = attribute.type;
        plain.components = attribute.components;
        add_plan(std::move(plain), {AttributePlan::How::copy, {column}, 0});
    }

    void add_normal(int column) {
        for (int axis = 0; axis < 3; ++axis)
            add_plan({.name = std::string(kNormal[axis]), .description = "", .type = ScalarType::float32}, {AttributePlan::How::component, {column}, axis});
    }

    void add_color(const AttributeHeader& attribute, int column) {
        add_plan({.name = std::string(kRgb), .description = "", .type = ScalarType::uint16, .components = 3}, {AttributePlan::How::rgb, {column}, 0});
        if (attribute.components == 2 || attribute.components == 4)
            add_plan({.name = "alpha", .description = "", .type = ScalarType::uint16}, {AttributePlan::How::rgb, {column}, attribute.components - 1});
    }

    void add_word(const Entries& entries, const AttributeHeader& attribute, int column) {
        const std::string name = text_of(entries, kName);
        const std::optional<ScalarType> type = scalar_named(text_of(entries, kType));
        const int word = numbers_of<int32_t>(entries, kWord, 1, name_).front();
        if (!type || scalar_size(*type) < 4 || word < 0 || size_t(word) >= scalar_size(*type) / 2 || attribute.type != ScalarType::uint16)
            throw Error(ErrorKind::malformed, name_ + ": attribute '" + name + "': word " + std::to_string(word) + " of a type that has none");
        size_t at = size_t(std::find(word_names_.begin(), word_names_.end(), name) - word_names_.begin());
        if (at == word_names_.size()) {
            word_names_.push_back(name);
            word_attributes_.push_back(int(info_.attributes.size()));
            Attribute joined = described(entries, name);
            joined.type = *type;
            joined.components = attribute.components;
            add_plan(std::move(joined), {AttributePlan::How::words, std::vector<int>(scalar_size(*type) / 2, -1), 0});
        }
        const size_t index = size_t(word_attributes_[at]);
        std::vector<int>& columns = plan_.attributes[index].columns;
        if (size_t(word) >= columns.size() || columns[size_t(word)] >= 0 || info_.attributes[index].type != *type ||
            info_.attributes[index].components != attribute.components)
            throw Error(ErrorKind::malformed, name_ + ": attribute '" + name + "': words of one kind expected, each once");
        columns[size_t(word)] = column;
    }

    Attribute described(const Entries& entries, std::string attribute_name) const {
        Attribute attribute;
        attribute.name = std::move(attribute_name);
        if (!ours_) return attribute;
        attribute.description = text_of(entries, kDescription);
        const auto number = [&](std::string_view key, double& value) {
            const std::vector<double> found = numbers_of<double>(entries, key, 1, name_);
            if (!found.empty()) value = found.front();
        };
        number(kValueScale, attribute.scale);
        number(kValueOffset, attribute.offset);
        number(kNoData, attribute.no_data);
        return attribute;
    }

    std::string name_of(AttributeKind kind, const Entries& entries) {
        constexpr std::array<std::string_view, 9> kNames = {"position", "normal", "color", "texture", "generic", "tangent", "material", "joints", "weights"};
        const int number = counts_[size_t(kind)]++;
        const std::string given = text_of(entries, kName);
        return given.empty() ? std::string(kNames[size_t(kind)]) + " " + std::to_string(number) : given;
    }

    // Under its name, or one like it where that is taken, or stands for something else.
    void add_plan(Attribute attribute, AttributePlan plan) {
        const std::string name = attribute.name;
        for (const KnownAttribute& known : kKnown)
            if (known.name == name && (known.type != attribute.type || known.components != attribute.components)) attribute.name += " (draco)";
        for (int number = 2; find_attribute(info_.attributes, attribute.name) >= 0; ++number) attribute.name = name + " " + std::to_string(number);
        info_.attributes.push_back(std::move(attribute));
        plan_.attributes.push_back(std::move(plan));
    }

    const Header& header_;
    const std::string& name_;
    CloudInfo& info_;
    Plan& plan_;
    bool ours_;
    std::array<int, 9> counts_{};           // attributes by kind so far
    std::vector<std::string> word_names_;   // of attributes of words
    std::vector<int> word_attributes_;      // their indices
};

// The source's own quanta, from what our writer says of them; nothing is decoded.
void plan_our_positions(const Header& header, const std::string& name, CloudInfo& info, Plan& plan) {
    if (const int32_t layout = numbers_of<int32_t>(header.metadata, kLayout, 1, name).front(); layout != 1)
        throw Error(ErrorKind::unsupported, name + ": metadata of strata, layout " + std::to_string(layout) + "; 1 is expected");
    const Vec3d scale = vector_of(header.metadata, kScale, name);
    info.quantization.scale = vector_of(header.metadata, kGridScale, name);
    info.quantization.offset = vector_of(header.metadata, kGridOffset, name);
    if ((info.quantization.scale.array() <= 0.0).any() || (scale.array() <= 0.0).any())
        throw Error(ErrorKind::malformed, name + ": metadata: positive scales expected");
    const std::vector<int32_t> origin = numbers_of<int32_t>(header.metadata, kGridOrigin, 3, name);
    if (origin.empty()) throw Error(ErrorKind::malformed, name + ": metadata 'grid_origin': three integers expected");
    plan.of_steps = false;
    plan.ratio = scale.cwiseQuotient(info.quantization.scale);
    plan.shift = {double(origin[0]), double(origin[1]), double(origin[2])};
    info.bounds.min = vector_of(header.metadata, kMin, name);
    info.bounds.max = vector_of(header.metadata, kMax, name);
    if ((info.bounds.min.array() > info.bounds.max.array()).any())
        throw Error(ErrorKind::malformed, name + ": metadata: min above max");
    info.crs = text_of(header.metadata, kCrs);
}

// A position as decoded.
Vec3d value_at(const Column& column, size_t point) {
    const size_t size = scalar_size(column.header.type);
    const std::byte* const at = column.values.data() + point * 3 * size;
    return {load_scalar(column.header.type, at), load_scalar(column.header.type, at + size), load_scalar(column.header.type, at + 2 * size)};
}

double step_of(const Lattice& lattice) { return lattice.range / double((uint64_t{1} << lattice.bits) - 1); }

bool is_real(ScalarType type) { return type == ScalarType::float32 || type == ScalarType::float64; }

// Drops the points whose position is no number.
uint64_t drop_points_nowhere(Points& points, int position) {
    const Column& places = points.columns[size_t(position)];
    if (!is_real(places.header.type)) return 0;
    std::vector<uint32_t> kept;
    for (size_t i = 0; i < points.size; ++i)
        if (value_at(places, i).allFinite()) kept.push_back(uint32_t(i));
    const uint64_t dropped = points.size - kept.size();
    if (dropped == 0) return 0;
    for (Column& column : points.columns) {
        const size_t size = column.header.size_bytes();
        for (size_t i = 0; i < kept.size(); ++i) std::memmove(column.values.data() + i * size, column.values.data() + kept[i] * size, size);
        column.values.resize(kept.size() * size);
    }
    points.size = kept.size();
    return dropped;
}

// The least scale with which 32 bits hold a range.
double least_scale(double low, double high, double offset) {
    return std::max(std::abs(low - offset), std::abs(high - offset)) / (kMostQuanta - 1.0);
}

// The scale for values of a float type, an axis: the greatest power of ten that is not above the step of the type at the
// farthest value, so that half of it, the worst rounding, is below half that step; coarser where 32 bits could not hold it.
double scale_of_reals(ScalarType type, double low, double high, double offset) {
    const double farthest = std::max(std::abs(low), std::abs(high));
    const double step = type == ScalarType::float32 ? double(std::nextafter(float(farthest), std::numeric_limits<float>::infinity())) - farthest
                                                    : std::nextafter(farthest, std::numeric_limits<double>::infinity()) - farthest;
    const double least = least_scale(low, high, offset);
    if (farthest == 0.0 || !std::isfinite(step)) return std::max(0.001, least);
    double scale = std::pow(10.0, std::floor(std::log10(step)));
    if (scale < least) scale = std::pow(10.0, std::ceil(std::log10(least)));
    return std::max(scale, std::numeric_limits<double>::min());
}

// Scale, offset and bounds of a file by others, from its points.
void plan_foreign_positions(const Points& points, const std::string& name, CloudInfo& info, Plan& plan) {
    const Column& places = points.columns[size_t(plan.position)];
    Box3d range;
    for (size_t i = 0; i < points.size; ++i) range.extend(value_at(places, i));
    if (points.size == 0) range.extend(Vec3d::Zero());
    Quantization& quantization = info.quantization;
    if (places.lattice) {
        const Lattice& lattice = *places.lattice;
        const double step = step_of(lattice);
        if (!(step >= 0.0) || !std::isfinite(step)) throw Error(ErrorKind::malformed, name + ": a positive range of positions expected");
        quantization.offset = {lattice.min[0], lattice.min[1], lattice.min[2]};
        if (!quantization.offset.allFinite()) throw Error(ErrorKind::malformed, name + ": a finite origin of positions expected");
        quantization.scale = Vec3d::Constant(step > 0.0 ? step : 1.0);
        if (step == 0.0) plan.ratio = Vec3d::Zero();  // all points lie at the origin
    } else if (is_real(places.header.type)) {
        for (int axis = 0; axis < 3; ++axis) {
            const double low = range.min[axis], high = range.max[axis];
            // Doubles carry the large offset of their coordinates; floats have no room for one.
            quantization.offset[axis] = places.header.type == ScalarType::float64 ? std::round(0.5 * low + 0.5 * high) : 0.0;
            quantization.scale[axis] = scale_of_reals(places.header.type, low, high, quantization.offset[axis]);
        }
        plan.ratio = quantization.scale.cwiseInverse();
        plan.shift = -quantization.offset.cwiseQuotient(quantization.scale);
    } else {
        for (int axis = 0; axis < 3; ++axis) {  // integers beyond int32 are moved there, and widened
            const double low = range.min[axis], high = range.max[axis];
            if (low < kLeastQuanta || high > kMostQuanta) quantization.offset[axis] = std::round(0.5 * low + 0.5 * high);
            quantization.scale[axis] = std::pow(10.0, std::max(0.0, std::ceil(std::log10(least_scale(low, high, quantization.offset[axis])))));
        }
        plan.ratio = quantization.scale.cwiseInverse();
        plan.shift = -quantization.offset.cwiseQuotient(quantization.scale);
    }
    for (size_t i = 0; i < points.size; ++i) {
        const Vec3d value = value_at(places, i), quanta = (value.cwiseProduct(plan.ratio) + plan.shift).array().rint();
        const Vec3d world = quanta.cwiseProduct(quantization.scale) + quantization.offset;
        info.bounds.extend(world);
        if (!places.lattice) info.worst_rounding = std::max(info.worst_rounding, (world - value).cwiseAbs().maxCoeff());
    }
}

std::vector<std::byte> joined_words(const Points& points, const AttributePlan& plan, const Attribute& attribute) {
    const size_t size = scalar_size(attribute.type), components = size_t(attribute.components);
    std::vector<std::byte> values(points.size * size * components);
    std::vector<uint64_t> bits(components, 0);
    for (size_t i = 0; i < points.size * components; ++i) {
        uint64_t coded = 0;
        for (size_t word = 0; word < plan.columns.size(); ++word) {
            uint16_t part;
            std::memcpy(&part, points.columns[size_t(plan.columns[word])].values.data() + 2 * i, sizeof part);
            coded |= uint64_t(part) << (16 * word);
        }
        uint64_t& value = bits[i % components];  // of 32 bits only the lower half counts, whatever is carried out of it
        value += (coded >> 1) ^ (0 - (coded & 1));
        std::memcpy(values.data() + i * size, &value, size);
    }
    return values;
}

uint16_t channel_of(const AttributeHeader& header, const std::byte* at) {
    const double value = load_scalar(header.type, at);
    const double scaled = is_real(header.type) ? value * 65535.0 : value;
    return scaled > 0.0 ? uint16_t(std::lround(std::min(scaled, 65535.0))) : uint16_t(0);
}

void copy_rgb(const Column& column, int component, size_t begin, std::span<uint16_t> out) {
    const AttributeHeader& header = column.header;
    const size_t size = scalar_size(header.type), width = header.size_bytes();
    const bool gray = header.components < 3, alpha = component > 0;
    const size_t channels = alpha ? 1 : 3;
    for (size_t i = 0; i < out.size() / channels; ++i) {
        const std::byte* const at = column.values.data() + (begin + i) * width;
        for (size_t c = 0; c < channels; ++c) out[i * channels + c] = channel_of(header, at + (alpha ? size_t(component) : gray ? 0 : c) * size);
    }
}

// A component as float; normalized integers as -1 to 1.
void copy_component(const Column& column, int component, size_t begin, std::span<float> out) {
    const AttributeHeader& header = column.header;
    const size_t size = scalar_size(header.type), width = header.size_bytes();
    const bool is_signed = header.type == ScalarType::int8 || header.type == ScalarType::int16 || header.type == ScalarType::int32;
    const double most = std::pow(2.0, double(8 * size - (is_signed ? 1 : 0))) - 1.0;
    const double unit = header.normalized && !is_real(header.type) ? 1.0 / most : 1.0;
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = float(load_scalar(header.type, column.values.data() + (begin + i) * width + size_t(component) * size) * unit);
}

void copy_axis(const Points& points, int position, int axis, size_t begin, const std::string& name, std::vector<int32_t>& out) {
    const Column& column = points.columns[size_t(position)];
    const AttributeHeader& header = column.header;
    const size_t size = scalar_size(header.type);
    const double ratio = points.ratio[axis], shift = points.shift[axis];
    for (size_t i = 0; i < out.size(); ++i) {
        const double value = load_scalar(header.type, column.values.data() + ((begin + i) * 3 + size_t(axis)) * size);
        const double quanta = std::nearbyint(value * ratio + shift);
        if (!(quanta >= kLeastQuanta && quanta <= kMostQuanta))
            throw Error(ErrorKind::malformed, name + ": point " + std::to_string(begin + i) + ": its position is beyond 32 bits of its scale");
        out[i] = int32_t(quanta);
    }
}

// What is left to do once a file is decoded and its plan is known.
void finish(const Plan& plan, const std::vector<Attribute>& attributes, Points& points) {
    points.ratio = plan.ratio;
    points.shift = plan.shift;
    if (const std::optional<Lattice>& lattice = points.columns[size_t(plan.position)].lattice; lattice && !plan.of_steps) {
        points.shift += plan.ratio.cwiseProduct(Vec3d(lattice->min[0], lattice->min[1], lattice->min[2]));
        points.ratio *= step_of(*lattice);
    }
    points.joined.resize(attributes.size());
    for (size_t i = 0; i < attributes.size(); ++i)
        if (plan.attributes[i].how == AttributePlan::How::words) points.joined[i] = joined_words(points, plan.attributes[i], attributes[i]);
}

}  // namespace
}  // namespace drc

DracoSource::DracoSource(std::unique_ptr<ByteSource> bytes, Keep keep)
    : bytes_(std::move(bytes)), header_(drc::read_header(*bytes_)), plan_(std::make_unique<drc::Plan>()) {
    const std::string& name = bytes_->name();
    info_.format = "draco " + std::to_string(header_.major_version) + "." + std::to_string(header_.minor_version) + ", " +
                   (header_.mesh ? "mesh, " : "points, ") + header_.method;
    info_.points = header_.points;
    if (header_.mesh) info_.notes.push_back("a mesh of " + std::to_string(header_.faces) + " faces: its vertices are read, as points");
    drc::AttributePlanner planner(header_, name, info_, *plan_);
    if (drc::is_ours(header_)) {
        planner.add_all(header_.attributes);
        drc::plan_our_positions(header_, name, info_, *plan_);
        return;
    }
    std::vector<std::byte> file(size_t(bytes_->size()));
    bytes_->read(0, file);
    drc::DecodedPoints decoded = drc::decode(file, header_, name);
    file = {};
    std::vector<drc::AttributeHeader> attributes;
    for (const drc::Column& column : decoded.columns) attributes.push_back(column.header);
    planner.add_all(attributes);
    auto points = std::make_shared<drc::Points>();
    points->size = size_t(decoded.points);
    points->columns = std::move(decoded.columns);
    if (const uint64_t dropped = drc::drop_points_nowhere(*points, plan_->position); dropped > 0)
        info_.notes.push_back(std::to_string(dropped) + " points without a finite position are left out");
    info_.points = points->size;
    drc::plan_foreign_positions(*points, name, info_, *plan_);
    drc::finish(*plan_, info_.attributes, *points);
    if (keep == Keep::decoded) kept_ = std::move(points);
}

DracoSource::~DracoSource() = default;

uint64_t DracoSource::batch_count() const {
    if (info_.points <= kWholeBatchPoints) return info_.points > 0 ? 1 : 0;
    return (info_.points + kBatchPoints - 1) / kBatchPoints;
}

std::shared_ptr<const drc::Points> DracoSource::decode() const {
    std::vector<std::byte> file(size_t(bytes_->size()));
    bytes_->read(0, file);
    drc::DecodedPoints decoded = drc::decode(file, header_, bytes_->name());
    file = {};
    auto points = std::make_shared<drc::Points>();
    points->size = size_t(decoded.points);
    points->columns = std::move(decoded.columns);
    drc::drop_points_nowhere(*points, plan_->position);
    if (points->size != info_.points)
        throw Error(ErrorKind::malformed, bytes_->name() + ": " + std::to_string(info_.points) + " points expected, " + std::to_string(points->size) + " decoded");
    drc::finish(*plan_, info_.attributes, *points);
    return points;
}

void DracoSource::read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const {
    std::shared_ptr<const drc::Points> points;
    if (batch_count() == 1) {
        {
            const std::lock_guard lock(decoding_);
            points = std::move(kept_);
            kept_ = nullptr;
        }
        if (!points) points = decode();
    } else {
        // One decodes, the others wait for it.
        const std::lock_guard lock(decoding_);
        if (!kept_) kept_ = decode();
        points = kept_;
        if (index + 1 == batch_count()) kept_ = nullptr;
    }
    const size_t begin = batch_count() == 1 ? 0 : size_t(index * kBatchPoints);
    const size_t size = batch_count() == 1 ? points->size : std::min(size_t(kBatchPoints), points->size - begin);
    resize_batch(out, size, info_.attributes, wanted);
    std::vector<int32_t>* const axes[] = {&out.x, &out.y, &out.z};
    for (int axis = 0; axis < 3; ++axis) drc::copy_axis(*points, plan_->position, axis, begin, bytes_->name(), *axes[axis]);
    for (const int i : wanted) {
        const drc::AttributePlan& plan = plan_->attributes[size_t(i)];
        const drc::Column& column = points->columns[size_t(plan.columns.front())];
        const size_t width = info_.attributes[size_t(i)].size_bytes();
        using How = drc::AttributePlan::How;
        switch (plan.how) {
            case How::copy: std::memcpy(out.columns[size_t(i)].data(), column.values.data() + begin * width, size * width); break;
            case How::rgb: drc::copy_rgb(column, plan.component, begin, out.column<uint16_t>(size_t(i))); break;
            case How::component: drc::copy_component(column, plan.component, begin, out.column<float>(size_t(i))); break;
            case How::words: std::memcpy(out.columns[size_t(i)].data(), points->joined[size_t(i)].data() + begin * width, size * width); break;
        }
    }
}

}  // namespace strata
