#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/math/vec.h"

namespace strata {

/// How the builder keeps a point: stored quanta as int32 x, y, z, then the attributes, packed.
struct RecordLayout {
    explicit RecordLayout(std::vector<Attribute> record_attributes) : attributes(std::move(record_attributes)) {
        for (const Attribute& attribute : attributes) {
            offsets.push_back(size);
            size += attribute.size_bytes();
        }
    }

    std::vector<Attribute> attributes;
    std::vector<size_t> offsets;  // of each attribute, bytes
    size_t size = 12;             // bytes of a record
};

/// The layout of the attributes that are kept.
inline RecordLayout without(const RecordLayout& layout, const std::vector<bool>& kept) {
    std::vector<Attribute> attributes;
    for (size_t a = 0; a < layout.attributes.size(); ++a)
        if (kept[a]) attributes.push_back(layout.attributes[a]);
    return RecordLayout(std::move(attributes));
}

/// Squeezes records of `layout` in place to those of without(layout, kept), and returns these.
std::span<std::byte> drop_attributes(const RecordLayout& layout, const std::vector<bool>& kept, std::span<std::byte> records);

/// Copies one record. Inline, by overlapping blocks: a call of memcpy costs more than the bytes.
inline void copy_record(std::byte* to, const std::byte* from, size_t size) {
    constexpr size_t kBlock = 12;  // a record has at least its position
    for (size_t at = 0; at + kBlock < size; at += kBlock) std::memcpy(to + at, from + at, kBlock);
    std::memcpy(to + size - kBlock, from + size - kBlock, kBlock);
}

inline Vec3i record_position(const std::byte* record) {
    Vec3i p_quanta;
    std::memcpy(p_quanta.data(), record, 12);
    return p_quanta;
}

}  // namespace strata
