#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/surface/surface_sink.h"

namespace strata {

/// Counts the attributes of vertices while it hands pieces on.
class ScalarRanges : public SurfaceSink {
public:
    struct Range {
        std::string name;
        float least = std::numeric_limits<float>::infinity(), greatest = -std::numeric_limits<float>::infinity();  // of values that are finite
        uint64_t unknown = 0;                                                                                       // vertices with another value
        bool known() const { return least <= greatest; }
        float step() const;       // between floats at the value farthest from 0
        bool is_coarse() const;   // less than 1,000 steps from the least value to the greatest, so that differences are lost; or whole numbers are
        void add(std::span<const float> values);
    };

    /// next  must outlive it
    ScalarRanges(SurfaceSink& next, const std::vector<std::string>& names);
    void add(const SurfacePiece& piece) override;
    const std::vector<Range>& ranges() const { return ranges_; }

private:
    SurfaceSink& next_;
    std::vector<Range> ranges_;
};

}  // namespace strata
