#include "io/byte_stream.h"

#include <algorithm>
#include <cstring>

#include "core/error.h"

namespace strata {
namespace {

constexpr size_t kBuffer = 256 * 1024;
constexpr size_t kLongestLine = 16 * 1024 * 1024;  // a polygon of a million corners fits

}  // namespace

ByteStream::ByteStream(const ByteSource& source) : source_(source), buffer_(size_t(std::min<uint64_t>(kBuffer, source.size()))) {}

// Moves what is left to the front and reads on until the buffer is full; false: the file has no more.
bool ByteStream::read_more() {
    if (begin_ > 0) std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    offset_ += begin_;
    end_ -= begin_;
    begin_ = 0;
    const size_t count = size_t(std::min<uint64_t>(buffer_.size() - end_, size() - offset_ - end_));
    source_.read(offset_ + end_, std::span(buffer_).subspan(end_, count));
    end_ += count;
    return count > 0;
}

void ByteStream::fill(size_t count) {
    if (count > left()) fail_at_byte(std::to_string(count) + " bytes needed, " + std::to_string(left()) + " left");
    read_more();
}

void ByteStream::skip(uint64_t count) {
    if (count > left()) fail_at_byte(std::to_string(count) + " bytes needed, " + std::to_string(left()) + " left");
    if (count <= end_ - begin_) {
        begin_ += size_t(count);
        return;
    }
    offset_ = position() + count;
    begin_ = end_ = 0;
}

void ByteStream::seek(uint64_t position) {
    if (position > size()) fail_at_byte("byte " + std::to_string(position) + " is beyond the file's " + std::to_string(size()));
    if (position >= offset_ && position <= offset_ + end_) {
        begin_ = size_t(position - offset_);
        return;
    }
    offset_ = position;
    begin_ = end_ = 0;
}

void ByteStream::read(std::span<std::byte> out) {
    if (out.size() > left()) fail_at_byte(std::to_string(out.size()) + " bytes needed, " + std::to_string(left()) + " left");
    while (!out.empty()) {
        const std::span<const std::byte> piece = take(std::min<size_t>(out.size(), 64 * 1024));
        std::memcpy(out.data(), piece.data(), piece.size());
        out = out.subspan(piece.size());
    }
}

bool ByteStream::next_line(std::string_view& line, Continued continued) {
    if (line_end_ == 0) {
        read_more();
        const std::string_view head(reinterpret_cast<const char*>(buffer_.data()) + begin_, end_ - begin_);
        const size_t first = head.find_first_of("\r\n");
        line_end_ = first != std::string_view::npos && first + 1 < head.size() && head[first] == '\r' && head[first + 1] != '\n' ? '\r' : '\n';
    }
    line_ = lines_ + 1;
    for (size_t scanned = 0;;) {
        if (begin_ == end_ && left() == 0) return false;
        char* const text = reinterpret_cast<char*>(buffer_.data()) + begin_;
        const size_t count = end_ - begin_;
        char* const end = static_cast<char*>(std::memchr(text + scanned, line_end_, count - scanned));
        if (end == nullptr) {
            scanned = count;
            if (begin_ == 0 && end_ == buffer_.size() && left() > count) {
                if (count >= kLongestLine)
                    throw Error(ErrorKind::limit, name() + ": line " + std::to_string(line_) + ": lines of at most 16 MiB are expected");
                buffer_.resize(2 * count);
            }
            if (read_more()) continue;
            line = {reinterpret_cast<const char*>(buffer_.data()) + begin_, count};
            begin_ = end_;
            ++lines_;
            return count > 0;
        }
        ++lines_;
        scanned = size_t(end - text) + 1;
        char* const last = end > text && end[-1] == '\r' ? end - 1 : end;
        if (continued == Continued::by_backslash && last > text && last[-1] == '\\') {
            std::fill(last - 1, end + 1, ' ');
            continue;
        }
        line = {text, size_t(end - text)};
        begin_ += scanned;
        return true;
    }
}

void ByteStream::fail_at_byte(const std::string& expectation) const {
    throw Error(ErrorKind::malformed, name() + ": byte " + std::to_string(position()) + ": " + expectation);
}

std::string ByteStream::place_of_line() const { return name() + ": line " + std::to_string(std::max<uint64_t>(line_, 1)); }

void ByteStream::fail_at_line(const std::string& expectation) const {
    throw Error(ErrorKind::malformed, place_of_line() + ": " + expectation);
}

}  // namespace strata
