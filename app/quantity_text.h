#pragma once

#include <cstdint>
#include <string>

namespace strata {

/// 1234567 as "1,234,567".
std::string with_commas(uint64_t count);

/// Bytes in the largest binary unit of which there is one: "512 B", "3.8 MiB".
std::string size_text(uint64_t bytes);

}  // namespace strata
