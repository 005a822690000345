#pragma once

#include <cstdint>
#include <utility>

namespace strata {

/// Memory of the GPU, of a fixed size. Owns its GL name; the context must be current.
class Buffer {
public:
    /// What it holds is undefined. size_bytes: at least 1
    /// throws  Error{device} where the GPU has no room
    explicit Buffer(uint64_t size_bytes);
    Buffer(Buffer&& other) noexcept : name_(std::exchange(other.name_, 0)), size_bytes_(other.size_bytes_) {}
    Buffer& operator=(Buffer&& other) noexcept;
    ~Buffer();

    /// The largest that a shader takes as a buffer block.
    static uint64_t most_storage_bytes();

    uint64_t size_bytes() const { return size_bytes_; }
    void write(uint64_t offset, const void* bytes, uint64_t count);
    /// Waits for whatever writes it.
    void read(uint64_t offset, void* bytes, uint64_t count) const;
    /// The first `count` bytes, a multiple of 4, become 0.
    void clear(uint64_t count);
    /// As a shader's buffer block of that binding.
    void bind_storage(uint32_t binding) const;
    /// As a shader's uniform block of that binding.
    void bind_uniforms(uint32_t binding) const;

private:
    uint32_t name_ = 0;
    uint64_t size_bytes_;
};

}  // namespace strata
