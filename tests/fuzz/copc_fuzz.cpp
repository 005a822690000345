// Any bytes are a COPC file: its octree is walked and read to the last point, or it is refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/error.h"
#include "core/octree/layered_validation.h"
#include "io/copc/copc_cloud.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        const auto cloud = open_copc(memory_source("fuzz", std::move(bytes)));
        if (cloud->info().points > 100'000) return 0;  // a chunk of few bytes may hold many points: slow, and nothing new
        const LayeredSummary summary = validate_layered(*cloud, {.name = "fuzz", .read_points = true});
        if (summary.points != cloud->info().points) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}
