#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/surface/scalar_field.h"

namespace strata::test {

/// A field by its values at samples, slice after slice.
class FunctionSlices : public SliceSource {
public:
    using Value = std::function<double(int i, int j, int k)>;
    FunctionSlices(std::array<uint32_t, 3> size, Value value, GridPlacement placement = {})
        : size_(size), value_(std::move(value)), placement_(placement) {}

    const GridPlacement& placement() const override { return placement_; }
    std::array<uint32_t, 3> size() const override { return size_; }
    void read(uint32_t count, double reference, std::span<float> out) override {
        size_t at = 0;
        for (uint32_t k = 0; k < count; ++k, ++next_)
            for (uint32_t j = 0; j < size_[1]; ++j)
                for (uint32_t i = 0; i < size_[0]; ++i) out[at++] = float(value_(int(i), int(j), int(next_)) - reference);
    }

private:
    std::array<uint32_t, 3> size_;
    Value value_;
    GridPlacement placement_;
    uint32_t next_ = 0;
};

/// The same by the bricks in a range that `wanted` keeps; the others are background.
class FunctionBricks : public FieldBrickSource {
public:
    using Value = FunctionSlices::Value;
    /// first, last  bricks, in units of 8 samples; the last one is left out
    FunctionBricks(std::array<int32_t, 3> first, std::array<int32_t, 3> last, float background, Value value, Value wanted,
                   GridPlacement placement = {})
        : first_(first),
          last_(last),
          background_(background),
          value_(std::move(value)),
          wanted_(std::move(wanted)),
          placement_(placement),
          next_(first[2]) {}

    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return background_; }
    float absent_value(const std::array<int32_t, 3>& corner) const override {
        return absent_ ? float(absent_(corner[0], corner[1], corner[2])) : background_;
    }
    /// What bricks that are not given hold; the background if not set.
    void set_absent(Value absent) { absent_ = std::move(absent); }
    bool next_layer(FieldBrickLayer& out) override {
        for (; next_ < last_[2]; ++next_) {
            out = {.k = 8 * next_};
            for (int32_t j = first_[1]; j < last_[1]; ++j)
                for (int32_t i = first_[0]; i < last_[0]; ++i) {
                    if (wanted_(i, j, next_) == 0.0) continue;
                    out.corners.push_back({8 * i, 8 * j});
                    for (int z = 0; z < 8; ++z)
                        for (int y = 0; y < 8; ++y)
                            for (int x = 0; x < 8; ++x) out.values.push_back(float(value_(8 * i + x, 8 * j + y, 8 * next_ + z)));
                }
            if (out.corners.empty()) continue;
            ++next_;
            return true;
        }
        return false;
    }

private:
    std::array<int32_t, 3> first_, last_;
    float background_;
    Value value_, wanted_, absent_;
    GridPlacement placement_;
    int32_t next_;
};

}  // namespace strata::test
