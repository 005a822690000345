#include "render/pass/fill_settings.h"

#include <algorithm>

#include "render/pass/fill_criteria.h"

namespace strata {

int FillSettings::reach_px() const {
    // A ray's length, and the way to the inner place; one for its rounding.
    return gap_px > 0.0f ? int(std::max(gap_px * fill_criteria::kSlantedGap, fill_criteria::kLeastGap) + fill_criteria::kMostSupport) + 1 : 0;
}

}  // namespace strata
