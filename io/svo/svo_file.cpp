#include "io/svo/svo_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "io/byte_reader.h"
#include "io/svo/svo_dag_coding.h"
#include "io/svo/svo_layout.h"

namespace strata {
namespace {

using Kind = VoxelStream::Kind;

bool is_of_level(Kind kind) { return kind == Kind::mask || kind == Kind::full || kind == Kind::pointer || kind == Kind::packed_mask; }

std::string name_of(VoxelStream stream) {
    constexpr std::array kNames = {"masks", "full cells", "counts", "colors", "normals", "opacities", "pointers", "masks"};
    const bool level = is_of_level(stream.kind);
    return std::string(kNames[size_t(stream.kind)]) + (level ? " of level " : " of depth ") + std::to_string(stream.place);
}

// Whether a tree or DAG of that many levels can have the stream.
bool is_place(VoxelStream stream, int levels, bool dag) {
    switch (stream.kind) {
        case Kind::mask: return !dag && stream.place < levels;
        case Kind::packed_mask: return dag && stream.place < levels;
        case Kind::full: return stream.place + 1 < levels;
        case Kind::pointer: return dag && stream.place + 1 < levels;
        case Kind::opacity: return !dag && stream.place >= 1 && stream.place < 2 * levels;
        default: return !dag && stream.place >= 1 && stream.place <= 2 * levels;
    }
}

// As many as a whole level or depth has.
uint64_t most_elements(VoxelStream stream) {
    switch (stream.kind) {
        case Kind::mask:
        case Kind::full: return uint64_t{1} << 6 * stream.place;
        case Kind::pointer:
        case Kind::packed_mask: return std::numeric_limits<uint64_t>::max();  // bytes
        default: return uint64_t{1} << 3 * stream.place;
    }
}

// Behind its kind and place.
void skip_stream(ByteReader& reader) {
    reader.skip(2);
    const uint64_t in_block = reader.read<uint32_t>(), elements = reader.read<uint64_t>();
    if (in_block == 0) reader.fail("blocks of no elements");
    const uint64_t blocks = elements / in_block + (elements % in_block != 0 ? 1 : 0);
    if (blocks > reader.left() / svo::kBlockEntryBytes) reader.fail("more blocks than the directory has");
    reader.skip(blocks * svo::kBlockEntryBytes);
}

}  // namespace

SvoFile::SvoFile(std::unique_ptr<ByteSource> source) : source_(std::move(source)) {
    read_header();
    if (dag_) read_dag();
}

void SvoFile::read_header() {
    std::array<std::byte, svo::kHeaderBytes> bytes;
    const std::string place = source_->name() + ": header";
    if (source_->size() < bytes.size())
        throw Error(ErrorKind::malformed, place + ": " + std::to_string(bytes.size()) + " bytes needed, " + std::to_string(source_->size()) + " there");
    source_->read(0, bytes);
    ByteReader reader(bytes, place);
    const std::span<const std::byte> magic = reader.take(svo::kMagic.size());
    if (std::memcmp(magic.data(), svo::kMagic.data(), magic.size()) != 0)
        throw Error(ErrorKind::malformed, place + ": not a voxel file, or one whose line ends were changed on its way");
    const uint16_t major = reader.read<uint16_t>();
    if (major != svo::kMajorVersion)
        throw Error(ErrorKind::unsupported, place + ": version " + std::to_string(major) + " of the format; this program reads version 1");
    reader.seek(bytes.size() - sizeof(uint32_t));
    if (reader.read<uint32_t>() != svo::checksum(bytes.data(), bytes.size() - sizeof(uint32_t)))
        throw Error(ErrorKind::malformed, place + ": damaged: its checksum does not fit");
    reader.seek(16);
    const uint32_t layout = reader.read<uint32_t>();
    if (layout > uint32_t(svo::Layout::dag))
        throw Error(ErrorKind::unsupported, place + ": layout " + std::to_string(layout) + "; this program reads 0, a tree, and 1, a DAG");
    if (layout == uint32_t(svo::Layout::dag)) dag_.emplace();
    const uint32_t levels = reader.read<uint32_t>();
    if (levels < 1 || levels > uint32_t(kMostVoxelLevels))
        throw Error(ErrorKind::malformed, place + ": " + std::to_string(levels) + " levels, expected 1 to " + std::to_string(kMostVoxelLevels));
    frame_.levels = int(levels);
    for (int axis = 0; axis < 3; ++axis) frame_.origin[axis] = reader.read<double>();
    frame_.voxel_size = reader.read<double>();
    if (!frame_.origin.allFinite() || !(frame_.voxel_size > 0.0) || !std::isfinite(frame_.voxel_size))
        throw Error(ErrorKind::malformed, place + ": origin and voxel size are not finite and positive");
    voxels_ = reader.read<uint64_t>();
    const uint64_t offset = reader.read<uint64_t>(), size = reader.read<uint64_t>();
    read_directory(offset, size, reader.read<uint32_t>());
}

void SvoFile::read_directory(uint64_t offset, uint64_t size, uint32_t expected_checksum) {
    const std::string place = source_->name() + ": directory";
    if (offset < svo::kHeaderBytes || offset > source_->size() || size > source_->size() - offset)
        throw Error(ErrorKind::malformed, place + ": bytes " + std::to_string(offset) + " to " + std::to_string(offset + size) +
                                              " are expected, the file has " + std::to_string(source_->size()));
    std::vector<std::byte> bytes(size);
    source_->read(offset, bytes);
    if (svo::checksum(bytes.data(), bytes.size()) != expected_checksum)
        throw Error(ErrorKind::malformed, place + ": damaged: its checksum does not fit");
    ByteReader reader(bytes, place, offset);
    const auto text = [&] {
        const std::span<const std::byte> taken = reader.take(reader.read<uint32_t>());
        return std::string(reinterpret_cast<const char*>(taken.data()), taken.size());
    };
    labels_.kind = text();
    labels_.crs = text();
    const uint32_t count = reader.read<uint32_t>();
    uint64_t room = offset - svo::kHeaderBytes;  // streams do not overlap, so they are no longer than that together
    for (uint32_t i = 0; i < count; ++i) {
        Stream stream;
        const uint8_t kind = reader.read<uint8_t>(), stream_place = reader.read<uint8_t>();
        if (kind > uint8_t(Kind::packed_mask)) {  // of a later minor version
            skip_stream(reader);
            continue;
        }
        stream.name = {Kind(kind), stream_place};
        if (!is_place(stream.name, frame_.levels, dag_.has_value())) reader.fail(name_of(stream.name) + " are not expected in a tree of " + std::to_string(frame_.levels) + " levels");
        if (find(stream.name) != nullptr) reader.fail("two streams of " + name_of(stream.name));
        const size_t element = element_size(stream.name.kind);
        if (reader.read<uint16_t>() != element) reader.fail(name_of(stream.name) + ": elements of " + std::to_string(element) + " bytes are expected");
        stream.block_elements = reader.read<uint32_t>();
        stream.elements = reader.read<uint64_t>();
        if (stream.block_elements < 1 || stream.block_elements > svo::kBlockBytes) reader.fail(name_of(stream.name) + ": blocks of 1 to 65536 elements are expected");
        if (stream.elements > most_elements(stream.name)) reader.fail(name_of(stream.name) + ": more of them than there are places");
        if (stream.elements > room / element) reader.fail(name_of(stream.name) + ": more bytes than the file has");
        room -= stream.elements * element;
        const uint64_t blocks = (stream.elements + stream.block_elements - 1) / stream.block_elements;
        if (blocks > reader.left() / svo::kBlockEntryBytes) reader.fail(name_of(stream.name) + ": more blocks than the directory has");
        stream.blocks.resize(blocks);
        for (uint64_t block = 0; block < blocks; ++block) {
            stream.blocks[block] = {reader.read<uint64_t>(), reader.read<uint32_t>()};
            const uint64_t bytes_of_block = std::min<uint64_t>(stream.block_elements, stream.elements - block * stream.block_elements) * element;
            const uint64_t first = stream.blocks[block].offset;
            if (first < svo::kHeaderBytes || first > offset || bytes_of_block > offset - first) reader.fail(name_of(stream.name) + ": a block outside of the file");
        }
        streams_.push_back(std::move(stream));
    }
}

const SvoFile::Stream* SvoFile::find(VoxelStream name) const {
    const auto found = std::find_if(streams_.begin(), streams_.end(), [&](const Stream& stream) { return stream.name == name; });
    return found == streams_.end() ? nullptr : &*found;
}

uint64_t SvoFile::elements(VoxelStream name) const {
    const Stream* const stream = find(name);
    return stream == nullptr ? 0 : stream->elements;
}

VoxelAttributes SvoFile::attributes() const {
    const uint8_t voxels = uint8_t(frame_.depth());
    return {.count = elements({Kind::count, voxels}) > 0,
            .color = elements({Kind::color, voxels}) > 0,
            .normal = elements({Kind::normal, voxels}) > 0,
            .opacity = elements({Kind::opacity, 1}) > 0};
}

void SvoFile::read_block(const Stream& stream, uint64_t block, std::vector<std::byte>& out) const {
    const uint64_t first = block * stream.block_elements;
    out.resize(std::min<uint64_t>(stream.block_elements, stream.elements - first) * element_size(stream.name.kind));
    source_->read(stream.blocks[block].offset, out);
    if (svo::checksum(out.data(), out.size()) != stream.blocks[block].checksum)
        throw Error(ErrorKind::malformed, source_->name() + ": " + name_of(stream.name) + ": byte " + std::to_string(stream.blocks[block].offset) +
                                              ": damaged: the block's checksum does not fit");
}

void SvoFile::read(VoxelStream name, uint64_t first, std::span<std::byte> out) const {
    const Stream* const stream = find(name);
    const size_t element = element_size(name.kind);
    const uint64_t count = out.size() / element;
    if (stream == nullptr || first > stream->elements || count > stream->elements - first)
        throw Error(ErrorKind::malformed, source_->name() + ": " + name_of(name) + ": elements " + std::to_string(first) + " to " +
                                              std::to_string(first + count) + " of " + std::to_string(elements(name)) + " are asked for");
    std::vector<std::byte> bytes;
    while (!out.empty()) {
        const uint64_t block = first / stream->block_elements, skip = first % stream->block_elements;
        read_block(*stream, block, bytes);
        const size_t taken = std::min(out.size(), bytes.size() - skip * element);
        std::memcpy(out.data(), bytes.data() + skip * element, taken);
        out = out.subspan(taken);
        first += taken / element;
    }
}

template <typename T>
void SvoFile::read_all(VoxelStream name, std::vector<T>& out, int threads) const {
    const Stream* const stream = find(name);
    if (stream == nullptr) return;
    out.resize(stream->elements);
    const std::span<std::byte> bytes = std::as_writable_bytes(std::span(out));
    parallel_blocks(threads, stream->blocks.size(), 16, [&](size_t begin, size_t end) {
        const size_t block_bytes = stream->block_elements * sizeof(T), first = begin * block_bytes;
        read(name, begin * stream->block_elements, bytes.subspan(first, std::min(end * block_bytes, bytes.size()) - first));
    });
}

void SvoFile::read_dag() {
    dag_->frame = frame_;
    dag_counts_.resize(size_t(frame_.levels));
    if (elements({Kind::packed_mask, 0}) == 0 && voxels_ == 0) return;  // nothing is occupied
    dag_->levels.resize(size_t(frame_.levels));
    for (size_t number = 0; number < dag_->levels.size(); ++number) {
        DagLevel& level = dag_->levels[number];
        const uint8_t place = uint8_t(number);
        std::vector<uint8_t> packed;
        read_all({Kind::packed_mask, place}, packed, 1);
        level.masks = svo::decode_masks(packed, source_->name() + ": " + name_of({Kind::packed_mask, place}));
        read_all({Kind::full, place}, level.full, 1);
        if (number + 1 == dag_->levels.size()) continue;
        packed.clear();
        read_all({Kind::pointer, place}, packed, 1);
        uint64_t children = 0;
        if (!level.full.empty() && level.full.size() != level.masks.size())
            throw Error(ErrorKind::malformed, source_->name() + ": " + name_of({Kind::full, place}) + ": as many as masks are expected");
        for (size_t node = 0; node < level.masks.size(); ++node) children += uint64_t(std::popcount(level.masks[node] & ~level.full_mask(node)));
        level.pointers = pack_numbers(svo::decode_pointers(packed, children, source_->name() + ": " + name_of({Kind::pointer, place})));
    }
    try {
        index_dag(*dag_);
    } catch (const Error& error) {
        throw error.within(source_->name());
    }
    dag_counts_ = count_dag(*dag_);
    if (count_voxels(*dag_) != voxels_)
        throw Error(ErrorKind::malformed, source_->name() + ": the header counts " + std::to_string(voxels_) + " voxels, there are " + std::to_string(count_voxels(*dag_)));
}

VoxelTree SvoFile::load_from_dag(size_t levels) const {
    VoxelDag coarse;
    coarse.frame = frame_;
    if (dag_->empty()) return {.frame = frame_, .levels = std::vector<VoxelLevel>(levels)};
    coarse.levels.assign(dag_->levels.begin(), dag_->levels.begin() + std::ptrdiff_t(levels));
    coarse.levels.back().pointers = {};
    coarse.levels.back().first_pointer.clear();
    uint64_t most_nodes = 0;
    for (size_t level = 0; level < levels; ++level) most_nodes += dag_counts_[level].tree_nodes;
    return expand(coarse, most_nodes);
}

void SvoFile::verify(int threads) const {
    for (const Stream& stream : streams_)
        parallel_blocks(threads, stream.blocks.size(), 16, [&](size_t begin, size_t end) {
            std::vector<std::byte> bytes;
            for (size_t block = begin; block < end; ++block) read_block(stream, block, bytes);
        });
}

uint64_t SvoFile::memory_bytes(int levels, bool with_attributes) const {
    uint64_t bytes = 0;
    for (int level = 0; dag_ && !dag_->empty() && level < levels; ++level) bytes += nodes(level) * (sizeof(uint64_t) * (dag_->levels[size_t(level)].full.empty() ? 1 : 2) + sizeof(uint32_t));
    if (dag_) return bytes;
    for (const Stream& stream : streams_) {
        const bool level = is_of_level(stream.name.kind);
        if (level ? stream.name.place >= levels : !with_attributes || stream.name.place > 2 * levels) continue;
        bytes += stream.elements * element_size(stream.name.kind);
        if (stream.name.kind == Kind::mask) bytes += stream.elements * sizeof(uint32_t) * (with_attributes ? 3 : 1);  // children, cells before
    }
    return bytes;
}

int SvoFile::levels_within(uint64_t memory, bool with_attributes) const {
    int levels = frame_.levels;
    while (levels > 1 && memory_bytes(levels, with_attributes) > memory) --levels;
    return levels;
}

VoxelTree SvoFile::load(int levels, bool with_attributes, int threads) const {
    if (dag_) return load_from_dag(size_t(std::clamp(levels, 1, frame_.levels)));
    VoxelTree tree;
    tree.frame = frame_;
    tree.levels.resize(size_t(std::clamp(levels, 1, frame_.levels)));
    if (with_attributes && (attributes().any_of_voxels() || attributes().opacity)) tree.attributes.resize(2 * tree.levels.size() + 1);
    for (const Stream& stream : streams_) {
        const bool level = is_of_level(stream.name.kind);
        if (stream.name.place >= (level ? tree.levels.size() : tree.attributes.size())) continue;
        visit_stream(tree, stream.name, [&](auto& array) { read_all(stream.name, array, threads); });
    }
    try {
        index_tree(tree);
        check_attributes(tree);
    } catch (const Error& error) {
        throw error.within(source_->name());
    }
    if (int(tree.levels.size()) == frame_.levels && count_voxels(tree) != voxels_)
        throw Error(ErrorKind::malformed, source_->name() + ": the header counts " + std::to_string(voxels_) + " voxels, there are " + std::to_string(count_voxels(tree)));
    return tree;
}

SvoFile open_svo(const std::string& path) { return SvoFile(open_file(path)); }

}  // namespace strata
