#pragma once

#include <atomic>
#include <cstdint>

namespace strata {

/// Of a model, by which copies of it on the GPU are known again: no two calls return the same, and none 0. An address would not do, as others may
/// come to lie where a model was.
inline uint64_t next_model_serial() {
    static std::atomic<uint64_t> last = 0;
    return ++last;
}

}  // namespace strata
