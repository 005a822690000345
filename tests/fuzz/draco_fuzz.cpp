// Any bytes are a Draco file: it is read to the last point, or refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>

#include "core/error.h"
#include "io/draco/draco_source.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        const DracoSource source(memory_source("fuzz.drc", std::move(bytes)));
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
