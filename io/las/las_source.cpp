#include "io/las/las_source.h"

#include <algorithm>

#include "core/error.h"
#include "io/las/las_extra_bytes.h"
#include "io/las/las_info.h"

namespace strata {
namespace {

// Bytes of one read: few calls, and the records are still in the second-level cache when they are decoded.
constexpr size_t kReadBytes = 256 * 1024;

las::Header read_uncompressed_header(const ByteSource& bytes, las::Damage damage) {
    las::Header header = las::read_header(bytes, damage);
    if (header.compressed)
        throw Error(ErrorKind::unsupported, bytes.name() + ": compressed (LAZ): uncompressed LAS is expected");
    return header;
}

}  // namespace

LasSource::LasSource(std::unique_ptr<ByteSource> bytes, las::Damage damage)
    : bytes_(std::move(bytes)),
      header_(read_uncompressed_header(*bytes_, damage)),
      notes_(header_.notes),
      columns_(header_.point_format, header_.record_size, las::read_extra_bytes(*bytes_, header_, notes_)) {
    info_ = las::cloud_info(*bytes_, header_, columns_, "las", std::move(notes_));
}

void LasSource::read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const {
    const uint64_t first = index * kBatchPoints;
    const size_t count = size_t(std::min({most, kBatchPoints, header_.points - first}));
    const size_t record_size = header_.record_size, step = std::max<size_t>(1, kReadBytes / record_size);
    resize_batch(out, count, info_.attributes, wanted);

    thread_local std::vector<std::byte> records;
    for (size_t begin = 0; begin < count; begin += step) {
        const size_t size = std::min(step, count - begin) * record_size;
        if (records.size() < size) records.resize(size);
        bytes_->read(header_.point_offset + (first + begin) * record_size, std::span(records).first(size));
        columns_.decode(std::span(records).first(size), wanted, begin, out);
    }
}

}  // namespace strata
