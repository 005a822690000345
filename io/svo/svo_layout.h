#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace strata::svo {

// What a file begins with, and what its parts are; docs/svo.md is the specification.
inline constexpr std::string_view kMagic("\x89SVO\r\n\x1a\n", 8);  // as PNG's: transfers that change line ends break it
inline constexpr uint16_t kMajorVersion = 1, kMinorVersion = 0;
inline constexpr size_t kHeaderBytes = 128;
inline constexpr size_t kBlockBytes = size_t{1} << 16;  // of a stream, that the writer checks and stores together; whole elements
inline constexpr size_t kBlockEntryBytes = 12;          // of the directory
inline constexpr size_t kStreamEntryBytes = 16;

/// dag: identical subtrees are stored once, and pointers lead from level to level.
enum class Layout : uint32_t { tree = 0, dag = 1 };

/// CRC-32 of ISO 3309, as in PNG and zlib.
uint32_t checksum(const void* bytes, size_t size);

}  // namespace strata::svo
