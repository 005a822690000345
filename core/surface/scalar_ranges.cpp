#include "core/surface/scalar_ranges.h"

#include <algorithm>
#include <cmath>

namespace strata {

void ScalarRanges::Range::add(std::span<const float> values) {
    for (const float value : values) {
        if (std::isfinite(value)) {
            least = std::min(least, value);
            greatest = std::max(greatest, value);
        } else {
            ++unknown;
        }
    }
}

float ScalarRanges::Range::step() const {
    const float farthest = std::max(std::abs(least), std::abs(greatest));
    return std::nextafter(farthest, std::numeric_limits<float>::infinity()) - farthest;
}

bool ScalarRanges::Range::is_coarse() const { return known() && step() > 1e-3f * (greatest - least) && (least < greatest || step() > 1.0f); }

ScalarRanges::ScalarRanges(SurfaceSink& next, const std::vector<std::string>& names) : next_(next) {
    for (const std::string& name : names) ranges_.push_back({.name = name});
}

void ScalarRanges::add(const SurfacePiece& piece) {
    for (size_t s = 0; s < piece.scalars.size() && s < ranges_.size(); ++s) ranges_[s].add(piece.scalars[s].values);
    next_.add(piece);
}

}  // namespace strata
