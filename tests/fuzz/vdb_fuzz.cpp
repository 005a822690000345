// Any bytes are a .vdb file: its header, its voxels and its vectors are read, or it is refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/vdb/vdb_field.h"
#include "io/vdb/vdb_tree.h"
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
    // A grid of vectors is read a component at a time.
    try {
        ByteStream stream(*source);
        for (const VdbGrid& grid : read_vdb_header(stream).grids) {
            if (!is_vector(grid)) continue;
            VdbField field(*source, {.grid = grid.name, .component = 2, .only_active = true, .memory_bytes = 4 << 20});
            field.value_at({1, -2, 3});
        }
    } catch (const Error&) {
    }
    return 0;
}
