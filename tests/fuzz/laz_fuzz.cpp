// Any bytes are a LAZ file: they are read to the last point, or refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>

#include "core/error.h"
#include "io/las/laz_source.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    constexpr uint64_t kMostBytes = 4 << 20;  // of records: a few bytes may rightly hold far more, in the time of many inputs
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        const LazSource source(memory_source("fuzz.laz", std::move(bytes)));
        if (source.info().points > kMostBytes / source.header().record_size) return 0;
        std::vector<int> all(source.info().attributes.size());
        std::iota(all.begin(), all.end(), 0);
        PointBatch batch;
        uint64_t points = 0;
        for (uint64_t i = 0; i < source.batch_count(); ++i) {
            source.read_batch(i, all, batch);
            points += batch.size;
        }
        if (points != source.info().points) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}
