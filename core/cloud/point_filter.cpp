#include "core/cloud/point_filter.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace strata {
namespace {

bool is_float(ScalarType type) { return type == ScalarType::float32 || type == ScalarType::float64; }

// The ranges as whole stored values, decided as coordinates are: 12.34 holds a stored 1234 of scale 0.01.
std::vector<std::pair<double, double>> whole_ranges(std::span<const ValueRange> ranges, double scale, double offset) {
    std::vector<std::pair<double, double>> whole;
    for (const auto& [low, high] : ranges)
        whole.emplace_back(first_quantum_from(low, scale, offset), last_quantum_to(high, scale, offset));
    return whole;
}

// The float nearest to a value. Volatile: GCC 12 at -O3 leaves out the way to float and back of two values side by side.
double nearest_float(double value) {
    volatile float nearest = float(value);
    return nearest;
}

}  // namespace

bool PointFilter::Test::holds(double value) const {
    return std::any_of(ranges.begin(), ranges.end(),
                       [&](const auto& range) { return value >= range.first && value <= range.second; });
}

PointFilter::Test PointFilter::make_test(const CloudInfo& info, const FilterTerm& term) {
    Test test;
    if (term.name == "elevation") {
        test.of = Test::Of::elevation;
        test.ranges = whole_ranges(term.ranges, info.quantization.scale.z(), info.quantization.offset.z());
        return test;
    }
    for (const auto& [low, high] : term.ranges) test.ranges.emplace_back(low, high);
    if (term.name == "lod") {
        test.of = Test::Of::level;
        return test;
    }
    const auto [index, component] = find_component(info.attributes, term.name, "elevation, lod");
    const Attribute& attribute = info.attributes[size_t(index)];
    test.attribute = index;
    test.component = component;
    test.components = attribute.components;
    test.type = attribute.type;
    test.has_no_data = attribute.no_data == attribute.no_data;
    if (test.has_no_data) test.no_data = attribute.no_data;
    if (!is_float(attribute.type) && attribute.scale > 0.0 && std::isfinite(attribute.scale)) {
        test.ranges = whole_ranges(term.ranges, attribute.scale, attribute.offset);
    } else if (attribute.type == ScalarType::float32 && attribute.scale == 1.0 && attribute.offset == 0.0) {
        // 0.1 holds the float that is called 0.1.
        for (auto& [low, high] : test.ranges) low = nearest_float(low), high = nearest_float(high);
    } else {
        test.scale = attribute.scale;
        test.offset = attribute.offset;
    }
    return test;
}

bool PointFilter::excludes_all(const CloudInfo& info, const Test& test) {
    if (test.of != Test::Of::attribute || size_t(test.attribute) >= info.attribute_min.size() ||
        size_t(test.attribute) >= info.attribute_max.size())
        return false;
    const std::vector<double>&least = info.attribute_min[size_t(test.attribute)], &most = info.attribute_max[size_t(test.attribute)];
    if (size_t(test.component) >= least.size() || size_t(test.component) >= most.size()) return false;
    double low = least[size_t(test.component)] * test.scale + test.offset, high = most[size_t(test.component)] * test.scale + test.offset;
    if (low > high) std::swap(low, high);
    // Some writers state such numbers with six digits.
    if (const double slack = is_float(test.type) ? 1e-5 * std::max(std::abs(low), std::abs(high)) : 0.0; slack > 0.0) {
        low -= slack;
        high += slack;
    }
    if (!(low <= high)) return false;
    return std::none_of(test.ranges.begin(), test.ranges.end(),
                        [&](const auto& range) { return range.first <= high && range.second >= low; });
}

PointFilter::PointFilter(const CloudInfo& info, std::span<const FilterTerm> terms) {
    for (const FilterTerm& term : terms) {
        const Test& test = tests_.emplace_back(make_test(info, term));
        nothing_ = nothing_ || excludes_all(info, test);
        if (test.attribute >= 0 && std::find(wanted_.begin(), wanted_.end(), test.attribute) == wanted_.end())
            wanted_.push_back(test.attribute);
    }
}

void PointFilter::test(const PointBatch& batch, uint32_t level, std::span<uint8_t> passes) const {
    assert(passes.size() == batch.size);
    for (const Test& test : tests_) {
        if (test.of == Test::Of::level) {
            if (!test.holds(level)) std::fill(passes.begin(), passes.end(), 0);
            continue;
        }
        if (test.of == Test::Of::elevation) {
            for (size_t i = 0; i < batch.size; ++i) passes[i] &= uint8_t(test.holds(batch.z[i]));
            continue;
        }
        const size_t scalar_bytes = scalar_size(test.type), point_bytes = scalar_bytes * size_t(test.components);
        const std::byte* bytes = batch.columns[size_t(test.attribute)].data() + size_t(test.component) * scalar_bytes;
        for (size_t i = 0; i < batch.size; ++i, bytes += point_bytes) {
            const double stored = load_scalar(test.type, bytes);
            const bool known = !(test.has_no_data && stored == test.no_data);
            passes[i] &= uint8_t(known && test.holds(stored * test.scale + test.offset));
        }
    }
}

}  // namespace strata
