#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "io/byte_source.h"

namespace strata {

/// A file from its first byte to its last through one buffer, as bytes and as lines of text. What it hands out is checked against
/// the bytes that are there and holds until the next call.
class ByteStream {
public:
    /// source  must live as long
    explicit ByteStream(const ByteSource& source);

    const std::string& name() const { return source_.name(); }
    uint64_t size() const { return source_.size(); }
    uint64_t position() const { return offset_ + begin_; }  // of the next byte
    uint64_t left() const { return size() - position(); }
    uint64_t line_number() const { return line_; }  // of the line read last, from 1
    std::string place_of_line() const;              // of the line read last: "name: line N"

    /// The next `count` bytes, at most 64 KiB. throws Error{malformed} when fewer are left
    std::span<const std::byte> take(size_t count) {
        if (count > end_ - begin_) fill(count);
        const std::span<const std::byte> taken(buffer_.data() + begin_, count);
        begin_ += count;
        return taken;
    }
    /// Fills `out`. throws Error{malformed} when fewer bytes are left
    void read(std::span<std::byte> out);
    /// The next number: an integer, or a float or double of any bits.
    template <typename T>
        requires std::is_arithmetic_v<T>
    T number() {
        T value;
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }
    /// Goes on from another place of the file, or its end.
    void seek(uint64_t position);
    /// Steps over bytes. throws Error{malformed} when fewer are left
    void skip(uint64_t count);

    /// What ends a line: LF, with or without CR before it, or CR alone in a file whose first line ends so.
    enum class Continued { never, by_backslash };  // whether a backslash at the end of a line joins it with the next

    /// The next line without its LF; false: the file is at its end. A CR before the LF is left: it counts as a blank.
    /// throws  Error{limit}: a line of more than 16 MiB
    bool next_line(std::string_view& line, Continued continued = Continued::never);

    /// throws  Error{malformed}: "name: byte N: expectation", or "name: line N: expectation" for the line read last
    [[noreturn]] void fail_at_byte(const std::string& expectation) const;
    [[noreturn]] void fail_at_line(const std::string& expectation) const;

private:
    void fill(size_t count);
    bool read_more();

    const ByteSource& source_;
    std::vector<std::byte> buffer_;
    uint64_t offset_ = 0;            // in the file, of the buffer's first byte
    size_t begin_ = 0, end_ = 0;     // of what is in the buffer and not taken
    uint64_t line_ = 0, lines_ = 0;  // the number of the line read last, and of lines gone by: more where lines were joined
    char line_end_ = 0;              // 0: not yet known
};

}  // namespace strata
