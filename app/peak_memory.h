#pragma once

#include <cstdint>

namespace strata {

/// The most memory that this program has had resident, bytes.
uint64_t peak_memory_bytes();

}  // namespace strata
