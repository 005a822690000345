#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>
#include <utility>

namespace strata {

/// An array whose elements are not set when it is made, so that the threads which fill it are the first to touch its pages; these are huge
/// ones where the system has them. Growing a large one moves its pages, not what is in them.
template <typename T>
class LargeArray {
    static_assert(std::is_trivially_destructible_v<T>);

public:
    LargeArray() = default;
    explicit LargeArray(size_t size) { reserve(size), size_ = size; }
    ~LargeArray() { release(); }
    LargeArray(LargeArray&& other) noexcept { swap(other); }
    LargeArray& operator=(LargeArray&& other) noexcept {
        LargeArray(std::move(other)).swap(*this);
        return *this;
    }

    T* data() { return data_; }
    const T* data() const { return data_; }
    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    T& operator[](size_t i) { return data_[i]; }
    const T& operator[](size_t i) const { return data_[i]; }
    T* begin() { return data_; }
    T* end() { return data_ + size_; }
    const T* begin() const { return data_; }
    const T* end() const { return data_ + size_; }

    /// Keeps what is there, up to the new size; new elements are not set.
    void resize(size_t size) {
        if (size > capacity_ / sizeof(T)) reserve(std::max(size, 2 * size_));  // memory that is never touched is address space alone
        size_ = size;
    }

private:
    static constexpr size_t kHugePage = size_t{1} << 21;

    static bool is_mapped(size_t bytes) { return bytes >= kHugePage; }

    void reserve(size_t size) {
        size_t bytes = size * sizeof(T);
        if (bytes <= capacity_) return;
        void* memory = nullptr;
        if (is_mapped(bytes)) {
            bytes = (bytes + kHugePage - 1) / kHugePage * kHugePage;
            memory = is_mapped(capacity_) ? ::mremap(static_cast<void*>(data_), capacity_, bytes, MREMAP_MAYMOVE)
                                          : ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
            if (memory == MAP_FAILED) throw std::bad_alloc();
            (void)::madvise(memory, bytes, MADV_HUGEPAGE);
        } else {
            memory = std::malloc(bytes);
            if (memory == nullptr) throw std::bad_alloc();
        }
        if (!is_mapped(capacity_)) {
            if (size_ > 0) std::memcpy(memory, static_cast<const void*>(data_), size_ * sizeof(T));
            release();
        }
        data_ = static_cast<T*>(memory);
        capacity_ = bytes;
    }

    void release() {
        if (is_mapped(capacity_)) (void)::munmap(static_cast<void*>(data_), capacity_);
        else std::free(static_cast<void*>(data_));
    }

    void swap(LargeArray& other) {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
    }

    T* data_ = nullptr;
    size_t size_ = 0;
    size_t capacity_ = 0;  // bytes
};

}  // namespace strata
