#include "io/las/laz_chunk_writer.h"

#include <algorithm>

#include "core/error.h"
#include "core/parallel.h"

namespace strata::las {

LazChunkWriter::LazChunkWriter(OutputFile& file, int point_format, size_t record_size, int threads)
    : file_(file), point_format_(point_format), record_size_(record_size), threads_(threads), table_place_(file.size()) {
    file_.write(std::vector<std::byte>(sizeof(uint64_t)));
}

void LazChunkWriter::write_chunks(std::span<const std::span<const std::byte>> chunks) {
    std::vector<std::vector<std::byte>> encoded(chunks.size());
    parallel_blocks(threads_, chunks.size(), 1, [&](size_t begin, size_t end) {
        std::unique_ptr<LazEncoder> encoder = encoders_.take([&] { return make_laz_encoder(point_format_, record_size_); });
        for (size_t i = begin; i < end; ++i) encoder->encode(chunks[i], encoded[i]);
        encoders_.give_back(std::move(encoder));
    });
    for (size_t i = 0; i < chunks.size(); ++i) {
        file_.write(encoded[i]);
        table_.push_back({uint32_t(chunks[i].size() / record_size_), uint32_t(encoded[i].size())});
    }
}

void LazChunkWriter::write(std::span<const std::byte> records) {
    const size_t chunk_bytes = kChunkPoints * record_size_;
    std::vector<std::span<const std::byte>> chunks;
    if (!kept_back_.empty()) {
        const std::span<const std::byte> missing = records.first(std::min(chunk_bytes - kept_back_.size(), records.size()));
        kept_back_.insert(kept_back_.end(), missing.begin(), missing.end());
        records = records.subspan(missing.size());
        if (kept_back_.size() < chunk_bytes) return;
        chunks.push_back(kept_back_);
    }
    for (; records.size() >= chunk_bytes; records = records.subspan(chunk_bytes)) chunks.push_back(records.first(chunk_bytes));
    write_chunks(chunks);
    kept_back_.assign(records.begin(), records.end());
}

void LazChunkWriter::finish() {
    if (!kept_back_.empty()) write_chunks(std::vector<std::span<const std::byte>>{kept_back_});
    const uint64_t table_offset = file_.size();
    file_.write(encode_chunk_table(table_, false));
    file_.write_at(table_place_, std::as_bytes(std::span(&table_offset, 1)));
}

}  // namespace strata::las
