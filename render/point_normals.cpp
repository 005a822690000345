#include "render/point_normals.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace strata {
namespace {

PackedNormal pack_normal(const std::array<double, 3>& n) {
    const double largest = std::max({std::abs(n[0]), std::abs(n[1]), std::abs(n[2])});
    PackedNormal packed = {};
    if (!std::isfinite(n[0] + n[1] + n[2]) || !(largest > 0.0)) return packed;
    for (size_t axis = 0; axis < 3; ++axis) packed[axis] = int8_t(std::lround(n[axis] / largest * 127.0));
    return packed;
}

}  // namespace

std::array<int, 3> normal_attributes(const CloudInfo& info) {
    std::array<int, 3> found;
    for (size_t axis = 0; axis < 3; ++axis) {
        found[axis] = find_attribute(info.attributes, attribute_name::kNormal[axis]);
        if (found[axis] < 0 || info.attributes[size_t(found[axis])].components != 1) return {-1, -1, -1};
    }
    return found;
}

PointNormals::PointNormals(const CloudInfo& info) : wanted_(normal_attributes(info)) {
    if (wanted_[0] < 0) throw Error(ErrorKind::usage, "surfels: the cloud has no normals; 'strata convert --normals' computes them");
    for (size_t axis = 0; axis < 3; ++axis) attributes_[axis] = info.attributes[size_t(wanted_[axis])];
}

std::vector<PackedNormal> PointNormals::read(const PointBatch& batch) const {
    std::vector<PackedNormal> normals(batch.size);
    for (size_t i = 0; i < batch.size; ++i) {
        std::array<double, 3> n;
        bool known = true;
        for (size_t axis = 0; axis < 3; ++axis) {
            const Attribute& attribute = attributes_[axis];
            const double stored = load_scalar(attribute.type, batch.columns[size_t(wanted_[axis])].data() + i * scalar_size(attribute.type));
            known &= stored != attribute.no_data;
            n[axis] = stored * attribute.scale + attribute.offset;
        }
        if (known) normals[i] = pack_normal(n);
    }
    return normals;
}

}  // namespace strata
