#include "io/potree/potree_hierarchy.h"

#include <bit>
#include <cstring>
#include <string>

#include "core/error.h"

namespace strata {
namespace {

static_assert(std::endian::native == std::endian::little, "hierarchy.bin is read as it lies in memory");

template <typename T>
T load(const std::byte* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

Error at_node(const NodeKey& key, const std::string& message) {
    return {ErrorKind::malformed, "node " + node_name(key) + ": " + message};
}

/// What a record says of itself, whatever its neighbors.
void check_record(const NodeKey& key, const HierarchyRecord& record) {
    if (record.type != PotreeNodeType::proxy && record.points > 0 && record.byte_size == 0)
        throw at_node(key, std::to_string(record.points) + " points in 0 bytes");
    const bool has_children = record.type == PotreeNodeType::proxy || record.child_mask != 0;
    if (has_children && key.level >= kDeepestLevel)
        throw at_node(key, "deeper than " + std::to_string(kDeepestLevel) + " levels");
}

}  // namespace

HierarchyRecord parse_hierarchy_record(std::span<const std::byte, kHierarchyRecordBytes> bytes) {
    const auto type = load<uint8_t>(&bytes[0]);
    if (type > uint8_t(PotreeNodeType::proxy))
        throw Error(ErrorKind::malformed, "node type 0, 1 or 2 is expected, " + std::to_string(type) + " found");
    return {.type = PotreeNodeType(type),
            .child_mask = load<uint8_t>(&bytes[1]),
            .points = load<uint32_t>(&bytes[2]),
            .byte_offset = load<uint64_t>(&bytes[6]),
            .byte_size = load<uint64_t>(&bytes[14])};
}

std::vector<ChunkNode> parse_hierarchy_chunk(std::span<const std::byte> bytes, const NodeKey& root) {
    if (bytes.empty() || bytes.size() % kHierarchyRecordBytes != 0)
        throw at_node(root, "a chunk of 22-byte records is expected, " + std::to_string(bytes.size()) + " bytes found");
    const size_t record_count = bytes.size() / kHierarchyRecordBytes;
    std::vector<ChunkNode> nodes;
    nodes.reserve(record_count);
    nodes.push_back({.key = root});
    for (size_t i = 0; i < nodes.size(); ++i) {
        const NodeKey key = nodes[i].key;
        try {
            nodes[i].record =
                parse_hierarchy_record(bytes.subspan(i * kHierarchyRecordBytes).first<kHierarchyRecordBytes>());
        } catch (const Error& error) {
            throw error.within("node " + node_name(key));
        }
        const HierarchyRecord& record = nodes[i].record;
        check_record(key, record);
        if (record.type == PotreeNodeType::proxy) continue;  // its mask, if any, is repeated by the real record
        nodes[i].first_child = uint32_t(nodes.size());
        nodes[i].child_count = uint32_t(std::popcount(record.child_mask));
        if (nodes[i].child_count > record_count - nodes.size())
            throw at_node(key, "more children than records: the chunk holds " + std::to_string(record_count));
        const uint8_t mask = record.child_mask;
        for (int octant = 0; octant < 8; ++octant)
            if (mask >> octant & 1) nodes.push_back({.key = key.child(octant)});
    }
    if (nodes.size() != record_count)
        throw at_node(root, "the chunk holds " + std::to_string(record_count) + " records, its child masks name " +
                                std::to_string(nodes.size()));
    return nodes;
}

}  // namespace strata
