#include "core/cloud/point_source.h"

namespace strata {

void PointSource::read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const {
    read_batch(index, wanted, out);
    if (most >= out.size) return;
    out.size = size_t(most);
    for (std::vector<int32_t>* const positions : {&out.x, &out.y, &out.z}) positions->resize(out.size);
    for (const int attribute : wanted) out.columns[size_t(attribute)].resize(out.size * info().attributes[size_t(attribute)].size_bytes());
}

}  // namespace strata
