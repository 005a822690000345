#include "io/svo/svo_writer.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "io/svo/svo_dag_coding.h"

namespace strata {
namespace {

size_t block_elements(VoxelStream::Kind kind) { return svo::kBlockBytes / element_size(kind); }

class ByteList {
public:
    template <typename T>
    void put(const T& value) {
        put(&value, sizeof value);
    }
    void put(const void* bytes, size_t size) {
        const auto* const first = static_cast<const std::byte*>(bytes);
        bytes_.insert(bytes_.end(), first, first + size);
    }
    void put_text(const std::string& text) {
        put(uint32_t(text.size()));
        put(text.data(), text.size());
    }
    std::vector<std::byte>& bytes() { return bytes_; }

private:
    std::vector<std::byte> bytes_;
};

// The pointers of all nodes, one after the other.
std::vector<uint32_t> pointers_of(const DagLevel& level) {
    std::vector<uint32_t> pointers;
    for (size_t node = 0; node < level.masks.size(); ++node) {
        const int children = std::popcount(level.masks[node] & ~level.full_mask(node));
        for (int child = 0; child < children; ++child) pointers.push_back(level.pointers[level.first_pointer[node] + uint32_t(child)]);
    }
    return pointers;
}

}  // namespace

uint32_t svo::checksum(const void* bytes, size_t size) {
    return uint32_t(crc32_z(0, static_cast<const Bytef*>(bytes), size));
}

SvoWriter::SvoWriter(const std::string& path, bool overwrite, const VoxelFrame& frame, SvoLabels labels, svo::Layout layout)
    : file_(path, overwrite), frame_(frame), labels_(std::move(labels)), layout_(layout) {
    const std::array<std::byte, svo::kHeaderBytes> room = {};  // the header is known last
    file_.write(room);
}

SvoWriter::Stream& SvoWriter::stream_of(VoxelStream name) {
    for (Stream& stream : streams_)
        if (stream.name == name) return stream;
    streams_.push_back({.name = name});
    streams_.back().pending.reserve(svo::kBlockBytes);
    return streams_.back();
}

void SvoWriter::append(VoxelStream name, std::span<const std::byte> bytes) {
    Stream& stream = stream_of(name);
    const size_t element = element_size(name.kind), block_bytes = block_elements(name.kind) * element;
    stream.elements += bytes.size() / element;
    while (!bytes.empty()) {
        const size_t taken = std::min(bytes.size(), block_bytes - stream.pending.size());
        stream.pending.insert(stream.pending.end(), bytes.begin(), bytes.begin() + std::ptrdiff_t(taken));
        bytes = bytes.subspan(taken);
        if (stream.pending.size() == block_bytes) write_block(stream);
    }
}

void SvoWriter::write_block(Stream& stream) {
    stream.blocks.push_back({file_.size(), svo::checksum(stream.pending.data(), stream.pending.size())});
    file_.write(stream.pending);
    stream.pending.clear();
}

uint64_t SvoWriter::commit(uint64_t voxels, Durability durability) {
    // Coarse levels first, so that the order does not depend on which streams began first.
    std::sort(streams_.begin(), streams_.end(), [](const Stream& a, const Stream& b) {
        return std::pair(a.name.kind, a.name.place) < std::pair(b.name.kind, b.name.place);
    });
    for (Stream& stream : streams_)
        if (!stream.pending.empty()) write_block(stream);

    ByteList directory;
    directory.put_text(labels_.kind);
    directory.put_text(labels_.crs);
    directory.put(uint32_t(streams_.size()));
    for (const Stream& stream : streams_) {
        directory.put(uint8_t(stream.name.kind));
        directory.put(stream.name.place);
        directory.put(uint16_t(element_size(stream.name.kind)));
        directory.put(uint32_t(block_elements(stream.name.kind)));
        directory.put(stream.elements);
        for (const Block& block : stream.blocks) {
            directory.put(block.offset);
            directory.put(block.checksum);
        }
    }
    const uint64_t directory_offset = file_.size();
    file_.write(directory.bytes());

    ByteList header;
    header.put(svo::kMagic.data(), svo::kMagic.size());
    header.put(svo::kMajorVersion);
    header.put(svo::kMinorVersion);
    header.put(uint32_t(svo::kHeaderBytes));
    header.put(layout_);
    header.put(uint32_t(frame_.levels));
    for (int axis = 0; axis < 3; ++axis) header.put(frame_.origin[axis]);
    header.put(frame_.voxel_size);
    header.put(voxels);
    header.put(directory_offset);
    header.put(uint64_t(directory.bytes().size()));
    header.put(svo::checksum(directory.bytes().data(), directory.bytes().size()));
    header.bytes().resize(svo::kHeaderBytes - sizeof(uint32_t));
    header.put(svo::checksum(header.bytes().data(), header.bytes().size()));
    file_.write_at(0, header.bytes());
    const uint64_t size = file_.size();
    file_.commit(durability);
    return size;
}

void write_svo_dag(const VoxelDag& dag, VoxelTreeSink& out) {
    for (size_t number = 0; number < dag.levels.size(); ++number) {
        const DagLevel& level = dag.levels[number];
        const uint8_t place = uint8_t(number);
        const std::vector<uint8_t> masks = svo::encode_masks(level.masks);
        out.append({VoxelStream::Kind::packed_mask, place}, std::as_bytes(std::span(masks)));
        if (!level.full.empty()) out.append({VoxelStream::Kind::full, place}, std::as_bytes(std::span(level.full)));
        if (number + 1 == dag.levels.size()) continue;
        const std::vector<uint8_t> packed = svo::encode_pointers(pointers_of(level));
        out.append({VoxelStream::Kind::pointer, place}, std::as_bytes(std::span(packed)));
    }
}

}  // namespace strata
