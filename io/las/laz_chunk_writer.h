#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/idle_pool.h"
#include "io/las/laz_encoder.h"
#include "io/output_file.h"

namespace strata::las {

/// Appends the points of a LAZ file: the place of the chunk table, chunks of 50,000 points, the table.
class LazChunkWriter {
public:
    static constexpr size_t kChunkPoints = 50'000;

    /// file  at the end of its header; it must outlive this
    LazChunkWriter(OutputFile& file, int point_format, size_t record_size, int threads);

    /// Takes records; those that fill no chunk yet are kept back. Threads share the chunks out.
    void write(std::span<const std::byte> records);
    /// Writes what was kept back, and the table.
    void finish();

private:
    void write_chunks(std::span<const std::span<const std::byte>> chunks);

    OutputFile& file_;
    int point_format_;
    size_t record_size_;
    int threads_;
    uint64_t table_place_;  // of the table's offset, bytes
    std::vector<std::byte> kept_back_;
    std::vector<LazTableEntry> table_;
    IdlePool<LazEncoder> encoders_;
};

}  // namespace strata::las
