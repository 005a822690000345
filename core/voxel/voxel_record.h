#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/voxel/voxel_block.h"

namespace strata {

/// What records hold beside their voxel's code.
struct RecordForm {
    bool count = false, color = false, normal = false;

    constexpr bool has_sums() const { return color || normal; }
};

/// Some of the points of one voxel: what they add to its count and sums.
/// Records of a voxel may come in any number and order. The first word of a
/// record is its key, the code above four bits that say what the rest means.
///   without sums  the key alone: 2^kind points
///   packed        a word for color, one for normal: count - 1 in four bits,
///   then three sums of 20 bits wide          likewise, in two records: count
///   and the first sum, then the second and the third, of 32 bits each
template <RecordForm form>
struct VoxelRecord {
    static constexpr size_t kColor = 1, kNormal = form.color ? 2 : 1;
    static constexpr size_t kWords = 1 + (form.color ? 1 : 0) + (form.normal ? 1 : 0);
    std::array<uint64_t, kWords> words;

    uint64_t code() const { return words[0] >> 4; }
    uint32_t kind() const { return words[0] & 15; }
    void set_key(uint64_t code, uint32_t kind) { words[0] = code << 4 | kind; }
};

inline uint64_t code_of_key(uint64_t key) { return key >> 4; }
inline uint64_t key_of_code(uint64_t code) { return code << 4; }  // of records with keys alone

enum : uint32_t { kPacked, kWideFirst, kWideSecond };  // kinds of records with sums
inline constexpr uint64_t kMostPackedPoints = 16;      // whose sums of 16-bit numbers fit in 20 bits, signed ones too
inline constexpr uint64_t kPackedBits = (uint64_t{1} << 20) - 1;

/// Sum `i` of a packed word.
inline uint64_t packed_sum(uint64_t word, size_t i) { return word >> (4 + 20 * i) & kPackedBits; }
/// The same of signed sums.
inline int64_t packed_signed_sum(uint64_t word, size_t i) { return int64_t(word << (40 - 20 * i)) >> 44; }

/// All points of a voxel.
struct VoxelSums {
    uint64_t count = 0;
    std::array<uint64_t, 3> color = {};
    std::array<int64_t, 3> normal = {};

    template <RecordForm form>
    void add(const VoxelRecord<form>& record) {
        using Record = VoxelRecord<form>;
        const uint32_t kind = record.kind();
        if constexpr (!form.has_sums()) {
            count += uint64_t{1} << kind;
        } else if (kind == kPacked) {
            count += (record.words[1] & 15) + 1;
            for (size_t i = 0; i < 3; ++i) {
                if constexpr (form.color) color[i] += packed_sum(record.words[Record::kColor], i);
                if constexpr (form.normal) normal[i] += packed_signed_sum(record.words[Record::kNormal], i);
            }
        } else {
            const auto low = [&](size_t word) { return uint32_t(record.words[word]); };
            const auto high = [&](size_t word) { return uint32_t(record.words[word] >> 32); };
            const bool first = kind == kWideFirst;
            if (first) count += low(1);
            if constexpr (form.color) {
                if (!first) color[1] += low(Record::kColor);
                color[first ? 0 : 2] += high(Record::kColor);
            }
            if constexpr (form.normal) {
                if (!first) normal[1] += int32_t(low(Record::kNormal));
                normal[first ? 0 : 2] += int32_t(high(Record::kNormal));
            }
        }
    }
};

/// Appends what stands for all these points of a voxel: no more records than
/// there are points, if there is more than one.
template <RecordForm form>
void append_records(uint64_t code, VoxelSums sums, std::vector<VoxelRecord<form>>& out) {
    using Record = VoxelRecord<form>;
    Record record;
    if constexpr (!form.count && !form.has_sums()) {
        record.set_key(code, 0);
        out.push_back(record);
    } else if constexpr (!form.has_sums()) {
        constexpr uint32_t kMostKind = 15;
        for (; sums.count >> (kMostKind + 1) != 0; sums.count -= uint64_t{1} << kMostKind) {
            record.set_key(code, kMostKind);
            out.push_back(record);
        }
        for (uint64_t left = sums.count; left != 0; left &= left - 1) {
            record.set_key(code, uint32_t(std::countr_zero(left)));
            out.push_back(record);
        }
    } else {
        if constexpr (!form.color) sums.color = {};
        if constexpr (!form.normal) sums.normal = {};
        // Parts of wide records may come without their count.
        const bool packs =
            sums.count - 1 < kMostPackedPoints && *std::max_element(sums.color.begin(), sums.color.end()) <= kPackedBits &&
            std::all_of(sums.normal.begin(), sums.normal.end(), [](int64_t sum) { return sum >= -(1 << 19) && sum < 1 << 19; });
        if (packs) {
            record.set_key(code, kPacked);
            const uint64_t count = sums.count - 1;
            if constexpr (form.color) record.words[Record::kColor] = count | sums.color[0] << 4 | sums.color[1] << 24 | sums.color[2] << 44;
            if constexpr (form.normal) {
                record.words[Record::kNormal] = count;
                for (size_t i = 0; i < 3; ++i) record.words[Record::kNormal] |= (uint64_t(sums.normal[i]) & kPackedBits) << (4 + 20 * i);
            }
            out.push_back(record);
            return;
        }
        const auto take = [](uint64_t& sum) {
            const uint64_t part = std::min<uint64_t>(sum, UINT32_MAX);
            sum -= part;
            return part;
        };
        const auto take_signed = [](int64_t& sum) {
            const int64_t part = std::clamp<int64_t>(sum, INT32_MIN, INT32_MAX);
            sum -= part;
            return uint64_t(uint32_t(part));
        };
        const auto is_left = [](auto sum) { return sum != 0; };
        do {
            const uint64_t count = take(sums.count);
            record.set_key(code, kWideFirst);
            record.words[1] = 0;
            if constexpr (form.color) record.words[Record::kColor] = take(sums.color[0]) << 32;
            if constexpr (form.normal) record.words[Record::kNormal] = take_signed(sums.normal[0]) << 32;
            record.words[1] |= count;
            out.push_back(record);
            record.set_key(code, kWideSecond);
            if constexpr (form.color)
                record.words[Record::kColor] = take(sums.color[1]), record.words[Record::kColor] |= take(sums.color[2]) << 32;
            if constexpr (form.normal)
                record.words[Record::kNormal] = take_signed(sums.normal[1]), record.words[Record::kNormal] |= take_signed(sums.normal[2])
                                                                                                              << 32;
            out.push_back(record);
        } while (sums.count != 0 || std::any_of(sums.color.begin(), sums.color.end(), is_left) ||
                 std::any_of(sums.normal.begin(), sums.normal.end(), is_left));
    }
}

inline uint32_t saturated_count(uint64_t count) { return uint32_t(std::min<uint64_t>(count, UINT32_MAX)); }

/// Rounded mean of 8-bit channels; that of 16-bit ones falls into 256 equal bins, so that colors made from bytes, as v * 256 or
/// v * 257, come back exactly, as pictures show them. Stored values are averaged as they are, in sRGB.
/// rgb_bits  8 or 16
VoxelColor mean_color(const VoxelSums& sums, int rgb_bits);

/// The direction of the sum, zero where that is zero.
VoxelNormal mean_normal(const VoxelSums& sums);

}  // namespace strata
