#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace strata {

/// One range of a source and where its bytes go.
struct ByteRange {
    uint64_t offset = 0;
    std::span<std::byte> out;
};

/// Bytes addressed by range: a file by pread today, HTTP ranges later. Never memory-mapped: a file that shrinks under a
/// mapping kills the process, and mapped pages break the memory cap. All functions are safe from several threads.
class ByteSource {
public:
    virtual ~ByteSource() = default;

    virtual const std::string& name() const = 0;  // for messages
    virtual uint64_t size() const = 0;            // bytes

    /// Fills all of `out` from `offset`. throws Error{malformed} beyond the end, Error{io} when reading fails
    virtual void read(uint64_t offset, std::span<std::byte> out) const = 0;
    /// Fills every range, neighbours in one request. Costs least when the ranges come in the order of their offsets.
    /// throws  as read does
    virtual void read_many(std::span<const ByteRange> ranges) const {
        for (const ByteRange& range : ranges) read(range.offset, range.out);
    }
    /// Says that a range will be read soon, and returns at once: the source may fetch it meanwhile. Never fails.
    virtual void prefetch(uint64_t offset, uint64_t size) const { (void)offset, (void)size; }
};

/// throws  Error{not_found, io}, naming the path
std::unique_ptr<ByteSource> open_file(const std::string& path);

/// Bytes in memory, called `name` in messages.
std::unique_ptr<ByteSource> memory_source(std::string name, std::vector<std::byte> bytes);

}  // namespace strata
