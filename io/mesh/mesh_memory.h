#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "io/byte_stream.h"

namespace strata {

/// The memory that a mesh may take while it is read: its arrays and what the reader keeps beside them grow through this.
class MeshMemory {
public:
    /// stream  how far the file is read tells how much more will come
    MeshMemory(const ByteStream& stream, uint64_t most_bytes) : stream_(stream), most_(most_bytes) {}

    template <typename T>
    void push(std::vector<T>& array, const T& value) {
        if (array.size() == array.capacity()) grow(array, array.size() + 1);
        array.push_back(value);
    }
    /// Makes the array longer, by zeros, if it is shorter than `count`.
    template <typename T>
    void lengthen(std::vector<T>& array, size_t count, const T& value) {
        if (count <= array.size()) return;
        if (count > array.capacity()) grow(array, count);
        array.resize(count, value);
    }
    /// Makes room for exactly so many, as long as the array is empty. The caller has seen that the file can hold so many.
    template <typename T>
    void reserve(std::vector<T>& array, uint64_t count) {
        expect(count * sizeof(T));
        array.reserve(size_t(count));
        held_ += array.capacity() * sizeof(T);
    }
    /// Frees an array.
    template <typename T>
    void release(std::vector<T>& array) {
        held_ -= array.capacity() * sizeof(T);
        std::vector<T>().swap(array);
    }
    /// throws  Error{limit}: there is no room for so many bytes more; the message names all that is needed
    void expect(uint64_t bytes) const {
        if (bytes > most_ - held_) refuse(held_ + bytes, "");
    }

private:
    template <typename T>
    void grow(std::vector<T>& array, size_t least) {
        const size_t old = array.capacity(), wanted = std::max({least, old + old / 2, size_t(64)});
        // Old and new are both there for a while.
        if (wanted * sizeof(T) > most_ - held_) refuse_to_grow(wanted * sizeof(T));
        array.reserve(wanted);
        held_ += (array.capacity() - old) * sizeof(T);
    }
    [[noreturn]] void refuse(uint64_t bytes, const char* about) const;
    [[noreturn]] void refuse_to_grow(uint64_t bytes) const;

    const ByteStream& stream_;
    uint64_t most_, held_ = 0;
};

}  // namespace strata
