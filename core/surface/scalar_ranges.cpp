#include "core/surface/scalar_ranges.h"

#include <algorithm>
#include <cmath>

namespace strata {

ScalarRanges::ScalarRanges(SurfaceSink& next, const std::vector<std::string>& names) : next_(next) {
    for (const std::string& name : names) ranges_.push_back({.name = name});
}

void ScalarRanges::add(const SurfacePiece& piece) {
    for (size_t s = 0; s < piece.scalars.size() && s < ranges_.size(); ++s) {
        Range& range = ranges_[s];
        for (const float value : piece.scalars[s].values) {
            if (std::isfinite(value)) {
                range.least = std::min(range.least, value);
                range.greatest = std::max(range.greatest, value);
            } else {
                ++range.unknown;
            }
        }
    }
    next_.add(piece);
}

}  // namespace strata
