#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "io/volume/volume_source.h"

namespace strata {

/// Reads bytes as a volume whose samples may lie in the same bytes as well, and traps where its numbers do not agree.
inline int fuzz_volume(const uint8_t* data, size_t size) {
    constexpr uint64_t kMostBytes = 4 << 20;  // of samples: a few compressed bytes may rightly hold far more, in the time of many inputs
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        const auto volume = open_volume(memory_source("fuzz", bytes), [&](const std::string& name) { return memory_source(name, bytes); });
        if (volume->header().sample_bytes() > kMostBytes) return 0;
        const VolumeRange range = volume->measure();
        if (range.values + range.nan != volume->header().samples() || (range.values > 0 && !(range.min <= range.max))) __builtin_trap();
        std::vector<float> slice(size_t{volume->size()[0]} * volume->size()[1]);
        for (uint32_t k = 0; k < volume->size()[2]; ++k) volume->read(1, range.min, slice);
    } catch (const Error&) {
    }
    return 0;
}

}  // namespace strata
