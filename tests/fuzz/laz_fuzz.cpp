// Any bytes are a LAZ file.
#include "io/las/laz_source.h"
#include "tests/fuzz/fuzz_points.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    constexpr uint64_t kMostBytes = 4 << 20;  // of records: a few bytes may rightly hold far more, in the time of many inputs
    return fuzz_points(data, size, [](std::unique_ptr<ByteSource> bytes) {
        auto source = std::make_unique<LazSource>(std::move(bytes));
        return source->info().points > kMostBytes / source->header().record_size ? nullptr : std::move(source);
    });
}
