#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <numeric>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/error.h"
#include "io/byte_source.h"

namespace strata {

/// Any bytes are a file of points: it is read to the last point, or refused with an Error.
/// open  a source of the bytes; none: it is left out
template <typename Open>
int fuzz_points(const uint8_t* data, size_t size, const Open& open) {
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        const std::unique_ptr<PointSource> source = open(memory_source("fuzz", std::move(bytes)));
        if (source == nullptr) return 0;
        std::vector<int> all(source->info().attributes.size());
        std::iota(all.begin(), all.end(), 0);
        PointBatch batch;
        uint64_t points = 0;
        for (uint64_t i = 0; i < source->batch_count(); ++i) {
            source->read_batch(i, all, batch);
            points += batch.size;
        }
        if (points != source->info().points) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}

}  // namespace strata
