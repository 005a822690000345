#include "core/surface/point_field.h"

namespace strata {

bool PointField::next_layer(FieldBrickLayer& out) {
    for (; next_ < layers(); ++next_) {
        if (next_ == 0) load(0);
        load(next_ + 1);
        out.k = int32_t(next_) * kFieldBrickSide;
        out.corners.clear();
        out.values.clear();
        if (has_points_near()) fill(out);
        window_.pass(next_, !out.corners.empty());
        if (out.corners.empty()) continue;
        ++next_;
        return true;
    }
    return false;
}

}  // namespace strata
