#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>

#include "core/error.h"

namespace strata {

static_assert(std::endian::native == std::endian::little, "files are little-endian, and so is memory here");

/// The bytes before the first NUL, or all of them, as text.
inline std::string text_before_nul(std::span<const std::byte> bytes) {
    const auto end = std::find(bytes.begin(), bytes.end(), std::byte{0});
    return std::string(reinterpret_cast<const char*>(bytes.data()), size_t(end - bytes.begin()));
}

/// A bounds-checked little-endian cursor: a view of bytes that the caller owns. Every format's small structures are
/// parsed through it, so a file can lie as it likes: what is not there is an Error that names the place.
class ByteReader {
public:
    /// place  for messages: file and structure, "scan.las: header"
    /// base   offset of the first byte in the file, for messages
    ByteReader(std::span<const std::byte> bytes, std::string place, uint64_t base = 0)
        : bytes_(bytes), place_(std::move(place)), base_(base) {}

    size_t position() const { return position_; }
    size_t left() const { return bytes_.size() - position_; }

    /// The next `count` bytes, and steps over them. throws Error{malformed} when fewer are left
    std::span<const std::byte> take(uint64_t count) {
        if (count > left())
            fail(std::to_string(count) + " bytes needed, " + std::to_string(left()) + " left");
        const std::span<const std::byte> taken = bytes_.subspan(position_, size_t(count));
        position_ += size_t(count);
        return taken;
    }
    void skip(uint64_t count) { take(count); }

    /// Moves to a position within the view, its end included.
    void seek(uint64_t position) {
        if (position > bytes_.size())
            fail("position " + std::to_string(position) + " is beyond the " + std::to_string(bytes_.size()) + " bytes here");
        position_ = size_t(position);
    }

    /// The next number: an integer, or a float or double of any bits.
    template <typename T>
        requires std::is_arithmetic_v<T>
    T read() {
        T value;
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }

    /// A field of `count` bytes that holds text up to its first NUL.
    std::string text(uint64_t count) {
        return text_before_nul(take(count));
    }

    /// throws  Error{malformed}: "place: byte N: expectation", N counted from the start of the file
    [[noreturn]] void fail(const std::string& expectation) const {
        throw Error(ErrorKind::malformed, place_ + ": byte " + std::to_string(base_ + position_) + ": " + expectation);
    }

private:
    std::span<const std::byte> bytes_;
    std::string place_;
    uint64_t base_;
    size_t position_ = 0;
};

}  // namespace strata
