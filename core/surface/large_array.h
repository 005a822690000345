#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace strata {

/// An array whose elements are not set when it is made, so that the threads which fill it are the first to touch its pages; these are huge
/// ones where the system has them.
template <typename T>
class LargeArray {
    static_assert(std::is_trivially_destructible_v<T>);

public:
    LargeArray() = default;
    explicit LargeArray(size_t size) : size_(size) {
        if (size == 0) return;
        const size_t bytes = size * sizeof(T);
        const size_t alignment = bytes >= kHugePage ? kHugePage : kLine;
        void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
        if (memory == nullptr) throw std::bad_alloc();
        data_.reset(static_cast<T*>(memory));
        if (bytes >= kHugePage) (void)::madvise(memory, bytes, MADV_HUGEPAGE);
    }

    T* data() { return data_.get(); }
    const T* data() const { return data_.get(); }
    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    T& operator[](size_t i) { return data_.get()[i]; }
    const T& operator[](size_t i) const { return data_.get()[i]; }
    T* begin() { return data(); }
    T* end() { return data() + size_; }
    const T* begin() const { return data(); }
    const T* end() const { return data() + size_; }

private:
    static constexpr size_t kHugePage = size_t{1} << 21, kLine = 64;

    struct Free {
        void operator()(T* memory) const { std::free(memory); }
    };
    std::unique_ptr<T, Free> data_;
    size_t size_ = 0;
};

}  // namespace strata
