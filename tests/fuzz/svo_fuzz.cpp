// Any bytes whose checksums fit are a voxel file: its tree is loaded whole and in part, or refused with an Error.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "io/svo/svo_file.h"
#include "io/svo/svo_layout.h"

namespace {

using namespace strata;

/// Bytes whose numbers can be read and written anywhere within them.
class Patch {
public:
    explicit Patch(std::vector<std::byte>& bytes) : bytes_(bytes) {}

    template <typename T>
    T get(uint64_t at) const {
        T value = 0;
        if (holds(at, sizeof value)) std::memcpy(&value, bytes_.data() + at, sizeof value);
        return value;
    }
    /// Makes the checksum at `at` that of a range.
    void put_checksum(uint64_t at, uint64_t offset, uint64_t size) {
        if (!holds(at, 4) || !holds(offset, size)) return;
        const uint32_t checksum = svo::checksum(bytes_.data() + offset, size);
        std::memcpy(bytes_.data() + at, &checksum, sizeof checksum);
    }

private:
    bool holds(uint64_t at, uint64_t size) const { return at <= bytes_.size() && size <= bytes_.size() - at; }
    std::vector<std::byte>& bytes_;
};

// Otherwise the fuzzer would see nothing behind the first checksum.
void mend_checksums(std::vector<std::byte>& bytes) {
    Patch patch(bytes);
    const uint64_t offset = patch.get<uint64_t>(64), size = patch.get<uint64_t>(72);
    uint64_t at = offset;
    for (int text = 0; text < 2; ++text) at += 4 + uint64_t{patch.get<uint32_t>(at)};
    const uint32_t streams = patch.get<uint32_t>(at);
    at += 4;
    for (uint32_t i = 0; i < streams && at < bytes.size(); ++i) {
        const uint64_t element = patch.get<uint16_t>(at + 2), in_block = patch.get<uint32_t>(at + 4);
        uint64_t left = patch.get<uint64_t>(at + 8);
        at += svo::kStreamEntryBytes;
        for (; left > 0 && in_block > 0 && at < bytes.size(); at += svo::kBlockEntryBytes) {
            const uint64_t taken = std::min(left, in_block);
            if (taken < bytes.size()) patch.put_checksum(at + 8, patch.get<uint64_t>(at), taken * element);
            left -= taken;
        }
    }
    patch.put_checksum(80, offset, size);
    patch.put_checksum(svo::kHeaderBytes - 4, 0, svo::kHeaderBytes - 4);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    mend_checksums(bytes);
    try {
        const SvoFile file(memory_source("fuzz.svo", std::move(bytes)));
        for (const int levels : {1, file.levels_within(uint64_t{32} << 20, true)}) {
            const VoxelTree tree = file.load(levels, true, 1);
            const uint32_t side = tree.frame.side();
            for (const uint32_t place : {0u, 1u, side / 2, side - 1}) is_occupied(tree, place, side - 1 - place, place);
        }
    } catch (const Error&) {
    }
    return 0;
}
