#include "core/cloud/rgb_depth.h"

#include <algorithm>
#include <atomic>

#include "core/parallel.h"

namespace strata {

int rgb_depth(const PointSource& source, int threads) {
    const int index = find_attribute(source.info().attributes, attribute_name::kRgb);
    if (index < 0 || source.info().attributes[size_t(index)].type != ScalarType::uint16) return 0;
    std::atomic<int> bits = 0;
    parallel_blocks(threads, size_t(source.batch_count()), 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t i = begin; i < end && bits < 16; ++i) {
            source.read_batch(i, {&index, 1}, batch);
            uint16_t all = 0;  // a bit above the eighth is set where a channel exceeds 255
            for (const uint16_t channel : batch.column<uint16_t>(size_t(index))) all |= channel;
            const int found = all > 255 ? 16 : all > 0 ? 8 : 0;
            for (int seen = bits; seen < found && !bits.compare_exchange_weak(seen, found);) {
            }
        }
    });
    return bits;
}

}  // namespace strata
