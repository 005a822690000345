// Any bytes are a Potree data set: it is walked and read to the last point, or refused with an Error.
// input  u16 size of metadata.json, u16 size of hierarchy.bin, then the three files one after another
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/error.h"
#include "core/octree/layered_validation.h"
#include "io/potree/potree_cloud.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    uint16_t sizes[2];
    if (size < sizeof sizes) return 0;
    std::memcpy(sizes, data, sizeof sizes);
    data += sizeof sizes, size -= sizeof sizes;
    const auto file = [&](const char* name, size_t wanted) {
        const size_t taken = std::min(wanted, size);
        std::vector<std::byte> bytes(taken);
        if (taken > 0) std::memcpy(bytes.data(), data, taken);
        data += taken, size -= taken;
        return memory_source(name, std::move(bytes));
    };
    auto metadata = file("metadata.json", sizes[0]);
    auto hierarchy = file("hierarchy.bin", sizes[1]);
    auto octree = file("octree.bin", size);
    const size_t most_nodes = hierarchy->size() / 22;
    try {
        const auto cloud = open_potree(std::move(metadata), std::move(hierarchy), std::move(octree));
        const LayeredSummary summary = validate_layered(*cloud, {.name = "fuzz", .read_points = true});
        if (summary.points != cloud->info().points || summary.nodes > most_nodes) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}
