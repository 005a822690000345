// Any bytes are a LAS file.
#include "io/las/las_source.h"
#include "tests/fuzz/fuzz_points.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    return fuzz_points(data, size, [](std::unique_ptr<ByteSource> bytes) { return std::make_unique<LasSource>(std::move(bytes)); });
}
