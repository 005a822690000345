#include "render/point_color.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/error.h"
#include "render/colormap.h"
#include "render/point_normals.h"

namespace strata {
namespace {

constexpr Rgba8 kNoValue = make_rgba(128, 128, 128);
constexpr uint64_t kSamplePoints = 100'000;  // percentiles of so many are good to about 0.1 %
constexpr size_t kSampleNodes = 64;

struct NamedMode {
    std::string_view name;  // of the attribute, where the rule shows one
    ColorChannel::Rule rule;
    std::string_view colormap;
};

using Rule = ColorChannel::Rule;
constexpr NamedMode kModes[] = {
    {attribute_name::kRgb, Rule::rgb, ""},
    {attribute_name::kIntensity, Rule::ramp, "gray"},
    {"elevation", Rule::elevation, "fjord"},
    {attribute_name::kClassification, Rule::classification, ""},
    {attribute_name::kReturnNumber, Rule::category, ""},
    {attribute_name::kNumberOfReturns, Rule::category, ""},
    {attribute_name::kGpsTime, Rule::ramp, "fjord"},
    {attribute_name::kPointSourceId, Rule::category, ""},
    {attribute_name::kUserData, Rule::category, ""},
    {attribute_name::kDensity, Rule::log_ramp, "fjord"},
    {"normal", Rule::normal, ""},
    {"lod", Rule::level, ""},
};

// Calls visit with a value of the C++ type that `type` stands for.
template <typename Visit>
void with_scalar(ScalarType type, const Visit& visit) {
    switch (type) {
        case ScalarType::int8: return visit(int8_t{});
        case ScalarType::uint8: return visit(uint8_t{});
        case ScalarType::int16: return visit(int16_t{});
        case ScalarType::uint16: return visit(uint16_t{});
        case ScalarType::int32: return visit(int32_t{});
        case ScalarType::uint32: return visit(uint32_t{});
        case ScalarType::int64: return visit(int64_t{});
        case ScalarType::uint64: return visit(uint64_t{});
        case ScalarType::float32: return visit(float{});
        case ScalarType::float64: return visit(double{});
    }
}

// A color map's entries begin in equal ratios. By square roots, which are the same on every machine.
void fill_geometric(double low, double high, std::span<double> steps) {
    const size_t half = steps.size() / 2;
    if (half == 0) return;
    const double middle = std::sqrt(low) * std::sqrt(high);
    steps[half] = middle;
    fill_geometric(low, middle, steps.first(half));
    fill_geometric(middle, high, steps.subspan(half));
}

ColorChannel attribute_channel(const CloudInfo& info, std::string_view name) {
    try {
        const auto [attribute, component] = find_component(info.attributes, name, "elevation, lod");
        return {.name = std::string(name), .rule = Rule::ramp, .attribute = attribute, .component = component};
    } catch (const Error& error) {
        throw error.within("color");
    }
}

double full_scale(ScalarType type) {
    double most = 1.0;  // of colors stored as fractions
    with_scalar(type, [&](auto zero) {
        if constexpr (std::is_integral_v<decltype(zero)>) most = double(std::numeric_limits<decltype(zero)>::max());
    });
    return most;
}

// Calls visit(stored value) for what the channel shows of each point.
template <typename Visit>
void for_each_value(const CloudInfo& info, const ColorChannel& channel, const PointBatch& batch, const Visit& visit) {
    if (channel.rule == Rule::elevation) {
        for (const int32_t z : batch.z) visit(double(z));
        return;
    }
    const Attribute& attribute = info.attributes[size_t(channel.attribute)];
    const std::vector<std::byte>& column = batch.columns[size_t(channel.attribute)];
    const size_t step = channel.rule == Rule::rgb ? 1 : size_t(attribute.components);
    for (size_t i = size_t(channel.component); i < batch.size * size_t(attribute.components); i += step)
        if (const double value = load_scalar(attribute.type, column.data() + i * scalar_size(attribute.type)); value != attribute.no_data)
            visit(value);
}

// The scale and offset from stored to shown values.
std::pair<double, double> value_scale(const CloudInfo& info, const ColorChannel& channel) {
    if (channel.rule == Rule::elevation) return {info.quantization.scale.z(), info.quantization.offset.z()};
    const Attribute& attribute = info.attributes[size_t(channel.attribute)];
    return {attribute.scale, attribute.offset};
}

// NaN gives the first entry; callers tell it apart where it can occur.
size_t clamped_index(double position, size_t entries) {
    return position > 0.0 ? std::min(size_t(std::min(position, double(entries))), entries - 1) : 0;
}

template <typename Scalar>
size_t category_of(Scalar value) {
    if constexpr (std::is_floating_point_v<Scalar>) return std::abs(value) < Scalar(1e9) ? size_t(int64_t(value)) : 0;
    else return size_t(value);
}

}  // namespace

std::string_view default_color(const CloudInfo& info) {
    if (find_attribute(info.attributes, attribute_name::kRgb) >= 0) return "rgb";
    if (find_attribute(info.attributes, attribute_name::kIntensity) >= 0) return "intensity";
    return "elevation";
}

ColorChannel find_color_channel(const CloudInfo& info, std::string_view name) {
    const std::string_view full_name = full_attribute_name(name);
    const auto missing = [&](const char* what, const char* option) {
        return Error(ErrorKind::usage, "color: the cloud has no " + std::string(what) + "; 'strata convert " + option + "' computes them");
    };
    for (const NamedMode& mode : kModes) {
        if (mode.name != full_name) continue;
        ColorChannel channel{.name = std::string(name), .rule = mode.rule};
        if (!mode.colormap.empty()) channel.default_colormap = mode.colormap;
        if (mode.rule == Rule::elevation || mode.rule == Rule::level) return channel;
        if (mode.rule == Rule::normal) {
            if (normal_attributes(info)[0] >= 0) return channel;
            if (find_attribute(info.attributes, name) >= 0) break;
            throw missing("normals", "--normals");
        }
        channel.attribute = find_attribute(info.attributes, full_name);
        if (channel.attribute < 0 && mode.rule == Rule::log_ramp) throw missing("densities", "--density");
        if (channel.attribute < 0) break;
        const bool colors = info.attributes[size_t(channel.attribute)].components == 3;
        if (channel.rule == Rule::rgb && !colors) break;
        return channel;
    }
    return attribute_channel(info, name);
}

AttributeLook look_of_attribute(std::string_view name) {
    std::string spaced(full_attribute_name(name));
    std::replace(spaced.begin(), spaced.end(), '_', ' ');
    if (spaced == "label") return {.rule = Rule::category};
    for (const NamedMode& mode : kModes) {
        if (mode.name != spaced) continue;
        if (mode.rule == Rule::classification || mode.rule == Rule::category) return {.rule = mode.rule};
        if (mode.rule == Rule::ramp) return {.colormap = mode.colormap};
    }
    return {};
}

ColorRange percentile_range(std::vector<double>& values, double low_share, double high_share) {
    std::erase_if(values, [](double value) { return !std::isfinite(value); });
    if (values.empty()) return {};
    const auto percentile = [&](double share) {
        const auto place = values.begin() + ptrdiff_t(std::lround(share * double(values.size() - 1)));
        std::nth_element(values.begin(), place, values.end());
        return *place;
    };
    return {percentile(low_share), percentile(high_share)};
}

ColorRange derive_range(const LayeredCloud& cloud, const ColorChannel& channel) {
    assert(channel.needs_range());
    const CloudInfo& info = cloud.info();
    std::vector<double> values;
    std::vector<int> wanted;
    if (channel.attribute >= 0) wanted.push_back(channel.attribute);
    PointBatch batch;
    uint64_t points = 0;
    std::vector<NodeId> queue = {cloud.root()};  // breadth first
    for (size_t next = 0; next < std::min(queue.size(), kSampleNodes) && points < kSamplePoints; ++next) {
        const LayeredNode& node = cloud.node(queue[next]);
        for (uint32_t child = 0; child < node.child_count; ++child) queue.push_back(node.first_child + child);
        if (node.points == 0) continue;
        cloud.read_node(queue[next], wanted, batch);
        points += batch.size;
        for_each_value(info, channel, batch, [&](double value) { values.push_back(value); });
    }
    const auto [scale, offset] = value_scale(info, channel);
    if (channel.rule == Rule::rgb) {
        const double full = full_scale(info.attributes[size_t(channel.attribute)].type);
        const double most = values.empty() ? full : *std::max_element(values.begin(), values.end());
        return {0.0, most <= 255.0 && full > 255.0 ? 255.0 : full};
    }
    if (channel.rule == Rule::log_ramp) std::erase_if(values, [](double value) { return !(value > 0.0); });
    const ColorRange stored = percentile_range(values);
    return {stored.low * scale + offset, stored.high * scale + offset};
}

PointColorizer::PointColorizer(const CloudInfo& info, const ColorChannel& channel, ColorRange range, std::string_view colormap)
    : channel_(channel) {
    if (channel.attribute >= 0) {
        const Attribute& attribute = info.attributes[size_t(channel.attribute)];
        type_ = attribute.type;
        components_ = attribute.components;
        no_data_ = attribute.no_data;
        wanted_.push_back(channel.attribute);
    }
    switch (channel.rule) {
        case Rule::classification: table_.assign(classification_colors().begin(), classification_colors().end()); break;
        case Rule::category:
        case Rule::level:
            for (uint64_t number = 0; number < 256; ++number) table_.push_back(category_color(number));
            break;
        case Rule::rgb: {
            // 256 equal bins and no rounding: 16-bit colors that were made from 8 bits, as v * 256 or v * 257, come back exactly.
            const double width = range.high - range.low;
            const bool integers = type_ != ScalarType::float32 && type_ != ScalarType::float64;
            gain_ = width == 0.0 ? 0.0 : 256.0 / (width + (integers ? std::copysign(1.0, width) : 0.0));
            bias_ = -range.low * gain_;
            break;
        }
        case Rule::normal:
            for (const int attribute : normal_attributes(info)) {
                wanted_.push_back(attribute);
                normal_.push_back(info.attributes[size_t(attribute)]);
            }
            break;
        case Rule::log_ramp: {
            const auto [low, high] = std::minmax(range.low, range.high);
            if (!(low > 0.0)) throw Error(ErrorKind::usage, "color '" + channel.name + "': expected a range of positive numbers, it is shown by its logarithm");
            const Colormap map(colormap.empty() ? channel.default_colormap : colormap);
            table_.assign(map.colors().begin(), map.colors().end());
            if (range.low > range.high) std::reverse(table_.begin(), table_.end());
            steps_.assign(table_.size(), low);
            fill_geometric(low, high, steps_);
            const auto [scale, offset] = value_scale(info, channel);
            for (double& step : steps_) step = (step - offset) / scale;
            break;
        }
        case Rule::ramp:
        case Rule::elevation: {
            const Colormap map(colormap.empty() ? channel.default_colormap : colormap);
            table_.assign(map.colors().begin(), map.colors().end());
            const auto [scale, offset] = value_scale(info, channel);
            const double width = range.high - range.low;
            if (width == 0.0) {  // a single value: the middle of the map
                bias_ = 0.5 * double(table_.size());
            } else {
                gain_ = double(table_.size()) * scale / width;
                bias_ = double(table_.size()) * (offset - range.low) / width;
            }
            break;
        }
    }
}

// A normal of 0 0 0, which stands for none, becomes the gray of points without a value.
void PointColorizer::color_normals(const PointBatch& batch, std::span<Rgba8> out) const {
    for (size_t i = 0; i < batch.size; ++i) {
        std::array<uint8_t, 3> code;
        bool known = true;
        for (size_t axis = 0; axis < 3; ++axis) {
            const Attribute& attribute = normal_[axis];
            const std::byte* column = batch.columns[size_t(wanted_[axis])].data();
            const double n = load_scalar(attribute.type, column + i * scalar_size(attribute.type)) * attribute.scale + attribute.offset;
            known &= n == n;
            code[axis] = uint8_t(clamped_index((0.5 + 0.5 * n) * 255.0 + 0.5, 256));
        }
        out[i] = known ? make_rgba(code[0], code[1], code[2]) : kNoValue;
    }
}

void PointColorizer::color(const PointBatch& batch, uint32_t level, std::span<Rgba8> out) const {
    assert(out.size() == batch.size);
    const size_t n = batch.size;
    switch (channel_.rule) {
        case Rule::level: std::fill(out.begin(), out.end(), table_[level % table_.size()]); return;
        case Rule::elevation:
            for (size_t i = 0; i < n; ++i) out[i] = table_[clamped_index(batch.z[i] * gain_ + bias_, table_.size())];
            return;
        case Rule::normal: return color_normals(batch, out);
        default: break;
    }
    const std::byte* column = batch.columns[size_t(channel_.attribute)].data();
    with_scalar(type_, [&](auto zero) {
        using Scalar = decltype(zero);
        const auto* values = reinterpret_cast<const Scalar*>(column);
        if (channel_.rule == Rule::rgb) {
            const auto code = [&](Scalar value) { return uint8_t(clamped_index(double(value) * gain_ + bias_, 256)); };
            for (size_t i = 0; i < n; ++i) out[i] = make_rgba(code(values[3 * i]), code(values[3 * i + 1]), code(values[3 * i + 2]));
            return;
        }
        values += channel_.component;
        const size_t step = size_t(components_);
        if (channel_.rule == Rule::ramp) {
            for (size_t i = 0; i < n; ++i) {
                const double value = double(values[i * step]);
                const bool known = value == value && value != no_data_;
                out[i] = known ? table_[clamped_index(value * gain_ + bias_, table_.size())] : kNoValue;
            }
        } else if (channel_.rule == Rule::log_ramp) {
            for (size_t i = 0; i < n; ++i) {
                const double value = double(values[i * step]);
                const size_t above = size_t(std::upper_bound(steps_.begin(), steps_.end(), value) - steps_.begin());
                out[i] = value > 0.0 && value != no_data_ ? table_[std::max<size_t>(above, 1) - 1] : kNoValue;
            }
        } else {
            for (size_t i = 0; i < n; ++i) out[i] = table_[category_of(values[i * step]) % table_.size()];
        }
    });
}

}  // namespace strata
