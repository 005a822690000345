#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/cloud_statistics.h"
#include "core/cloud/point_source.h"

namespace strata {

/// What a point's value must be: in any of the ranges, both ends included; a single value is a range of itself.
struct FilterTerm {
    std::string name;  // an attribute as find_component takes it, elevation, or lod (the level of the point's node)
    std::vector<ValueRange> ranges;  // as values: stored * scale + offset; may be infinite
};

/// Tells the points of a cloud that pass all of several terms. NaN and "no data" never pass.
class PointFilter {
public:
    PointFilter() = default;  // every point passes
    /// throws  Error{usage}: the cloud has no such attribute; the message lists those it has
    PointFilter(const CloudInfo& info, std::span<const FilterTerm> terms);

    bool everything() const { return tests_.empty(); }
    /// Whether what the cloud says of its attributes proves that no point passes.
    bool nothing() const { return nothing_; }
    /// Attributes that `test` reads: pass to read_node.
    std::span<const int> wanted() const { return wanted_; }

    /// Sets passes[i] to 0 where point i does not pass; other entries stay as they are.
    /// level  of the points' node
    void test(const PointBatch& batch, uint32_t level, std::span<uint8_t> passes) const;

    bool operator==(const PointFilter& other) const = default;

private:
    // One term, with its ranges in stored values as far as that decides them exactly.
    struct Test {
        enum class Of { attribute, elevation, level };
        Of of = Of::attribute;
        int attribute = -1, component = 0, components = 1;
        ScalarType type = ScalarType::uint8;
        double scale = 1.0, offset = 0.0;  // from stored to compared values
        double no_data = 0.0;              // stored; where has_no_data
        bool has_no_data = false;
        std::vector<std::pair<double, double>> ranges;

        bool holds(double value) const;
        bool operator==(const Test& other) const = default;
    };
    static Test make_test(const CloudInfo& info, const FilterTerm& term);
    static bool excludes_all(const CloudInfo& info, const Test& test);

    std::vector<Test> tests_;
    std::vector<int> wanted_;
    bool nothing_ = false;
};

}  // namespace strata
