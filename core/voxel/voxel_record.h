#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/voxel/voxel_block.h"

namespace strata {

/// What a record holds beside its voxel's code.
struct RecordForm {
    bool count = false, color = false, normal = false;

    /// A mean needs the count, too.
    constexpr bool has_count() const { return count || color || normal; }
};

/// Points that one record may stand for: so that sums of 16-bit numbers fit in 32 bits.
inline constexpr uint32_t kMostRecordPoints = 65536;

/// The points of one voxel that are known so far, or some of them: code, count, sums. Packed.
template <RecordForm form>
struct VoxelRecord {
    static constexpr size_t kCount = 2, kColor = 3, kNormal = form.color ? 6 : 3;
    static constexpr size_t kWords = 2 + (form.has_count() ? 1 : 0) + (form.color ? 3 : 0) + (form.normal ? 3 : 0);
    std::array<uint32_t, kWords> words;  // code low, code high, count, red, green, blue, normal x, y, z

    uint64_t code() const { return words[0] | uint64_t{words[1]} << 32; }
    void set_code(uint64_t code) {
        words[0] = uint32_t(code);
        words[1] = uint32_t(code >> 32);
    }
    bool has_room_for(const VoxelRecord& other) const {
        if constexpr (form.has_count()) return words[kCount] + other.words[kCount] <= kMostRecordPoints;
        return true;
    }
    /// Of the same voxel. Sums of negative numbers wrap, as they should.
    void add(const VoxelRecord& other) {
        for (size_t i = kCount; i < kWords; ++i) words[i] += other.words[i];
    }
};

/// All points of a voxel.
struct VoxelSums {
    uint64_t count = 0;
    std::array<uint64_t, 3> color = {};
    std::array<int64_t, 3> normal = {};

    template <RecordForm form>
    void add(const VoxelRecord<form>& record) {
        using Record = VoxelRecord<form>;
        if constexpr (form.has_count()) count += record.words[Record::kCount];
        else ++count;
        for (size_t i = 0; i < 3; ++i) {
            if constexpr (form.color) color[i] += record.words[Record::kColor + i];
            if constexpr (form.normal) normal[i] += int32_t(record.words[Record::kNormal + i]);
        }
    }
};

inline uint32_t saturated_count(uint64_t count) { return uint32_t(std::min<uint64_t>(count, UINT32_MAX)); }

/// Rounded mean of 8-bit channels; that of 16-bit ones falls into 256 equal bins, so that colors made from bytes, as v * 256 or
/// v * 257, come back exactly, as pictures show them. Stored values are averaged as they are, in sRGB.
/// rgb_bits  8 or 16
VoxelColor mean_color(const VoxelSums& sums, int rgb_bits);

/// The direction of the sum, zero where that is zero.
VoxelNormal mean_normal(const VoxelSums& sums);

}  // namespace strata
