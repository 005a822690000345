#include "core/cloud/point_batch.h"

namespace strata {

void resize_batch(PointBatch& batch, size_t size, const std::vector<Attribute>& attributes, std::span<const int> wanted) {
    batch.size = size;
    batch.x.resize(size);
    batch.y.resize(size);
    batch.z.resize(size);
    batch.columns.resize(attributes.size());
    std::vector<bool> keep(attributes.size(), false);
    for (const int index : wanted) keep[size_t(index)] = true;
    for (size_t i = 0; i < attributes.size(); ++i) batch.columns[i].resize(keep[i] ? size * attributes[i].size_bytes() : 0);
}

}  // namespace strata
