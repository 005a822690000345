#include "io/svo/svo_dag_coding.h"

#include <bit>
#include <cassert>

#include "core/error.h"
#include "core/voxel/voxel_tree.h"

namespace strata::svo {
namespace {

// Bits of a number below `count`.
int width_of(uint32_t count) { return count < 2 ? 0 : std::bit_width(count - 1); }

class BitWriter {
public:
    explicit BitWriter(std::vector<uint8_t>& bytes) : bytes_(bytes) {}
    void put(uint64_t value, int width) {
        word_ |= value << used_;
        for (used_ += width; used_ >= 8; used_ -= 8, word_ >>= 8) bytes_.push_back(uint8_t(word_));
    }
    void finish() {
        if (used_ > 0) bytes_.push_back(uint8_t(word_));
    }

private:
    std::vector<uint8_t>& bytes_;
    uint64_t word_ = 0;
    int used_ = 0;
};

}  // namespace

std::vector<uint8_t> encode_masks(std::span<const uint64_t> masks) {
    std::vector<uint8_t> bytes;
    for (const uint64_t mask : masks) {
        const uint32_t present = bytes_present(mask);
        bytes.push_back(uint8_t(present));
        for (int i = 0; i < 8; ++i)
            if ((present >> i & 1) != 0) bytes.push_back(uint8_t(mask >> 8 * i));
    }
    return bytes;
}

std::vector<uint64_t> decode_masks(std::span<const uint8_t> bytes, const std::string& place) {
    const auto fail = [&](const std::string& what) { throw Error(ErrorKind::malformed, place + ": " + what); };
    std::vector<uint64_t> masks;
    for (size_t next = 0; next < bytes.size();) {
        const uint8_t present = bytes[next++];
        if (present == 0) fail("one of them is 0");
        if (size_t(std::popcount(present)) > bytes.size() - next) fail("they end within a mask");
        uint64_t mask = 0;
        for (int i = 0; i < 8; ++i) {
            if ((present >> i & 1) == 0) continue;
            const uint8_t byte = bytes[next++];
            if (byte == 0) fail("a byte of 0 that is said to be another");
            mask |= uint64_t{byte} << 8 * i;
        }
        masks.push_back(mask);
    }
    return masks;
}

std::vector<uint8_t> encode_pointers(std::span<const uint32_t> pointers) {
    std::vector<uint8_t> bytes;
    BitWriter bits(bytes);
    uint32_t nodes = 0;  // that occurred
    for (const uint32_t pointer : pointers) {
        assert(pointer <= nodes);
        if (pointer == nodes) {
            bits.put(1, 1);
            ++nodes;
        } else {
            bits.put(uint64_t{pointer} << 1, 1 + width_of(nodes));
        }
    }
    bits.finish();
    return bytes;
}

std::vector<uint32_t> decode_pointers(std::span<const uint8_t> bytes, uint64_t count, const std::string& place) {
    const auto fail = [&](const std::string& what) { throw Error(ErrorKind::malformed, place + ": " + what); };
    if (count > 8 * uint64_t{bytes.size()}) fail(std::to_string(count) + " pointers are expected in " + std::to_string(bytes.size()) + " bytes");
    std::vector<uint32_t> pointers;
    pointers.reserve(count);
    uint64_t word = 0;
    int held = 0;
    size_t next = 0;
    const auto take = [&](int width) {
        for (; held < width; held += 8) {
            if (next == bytes.size()) fail("the pointers end early");
            word |= uint64_t{bytes[next++]} << held;
        }
        const uint64_t value = word & ((uint64_t{1} << width) - 1);
        word >>= width;
        held -= width;
        return uint32_t(value);
    };
    uint32_t nodes = 0;
    while (pointers.size() < count) {
        if (take(1) == 1) {
            pointers.push_back(nodes++);
            continue;
        }
        const uint32_t pointer = take(width_of(nodes));
        if (pointer >= nodes) fail("a pointer to node " + std::to_string(pointer) + ", which did not occur yet");
        pointers.push_back(pointer);
    }
    if (next != bytes.size() || word != 0) fail("more than the " + std::to_string(count) + " pointers that are expected");
    return pointers;
}

}  // namespace strata::svo
