// Any bytes are a .vdb file: its header and its voxels are read, or it is refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/vdb/vdb_voxels.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    const auto source = memory_source("fuzz.vdb", std::move(bytes));
    // What is below the cap is built: the builder's asserts see the order of blocks.
    try {
        const VdbVoxels voxels = read_vdb_voxels(*source, {.memory_bytes = 4 << 20});
        VoxelTreeInMemory memory(voxels.frame, {});
        VoxelTreeBuilder builder(voxels.frame, {}, memory);
        voxels.voxels.emit([&](const VoxelBatch& batch) { builder.add(batch); });
        builder.finish();
        memory.take();
    } catch (const Error&) {
    }
    return 0;
}
