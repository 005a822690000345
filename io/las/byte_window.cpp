#include "io/las/byte_window.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "core/error.h"

namespace strata::las {
namespace {

constexpr size_t kWindowBytes = 1 << 20;  // a usual chunk is one window

}  // namespace

void ByteWindow::open(const ByteSource& source, uint64_t begin, uint64_t end, size_t margin, uint64_t first) {
    source_ = &source;
    offset_ = begin;
    end_ = end;
    margin_ = margin;
    fill(0, first);
}

// Reads on behind the `kept` bytes at the buffer's front.
void ByteWindow::fill(size_t kept, uint64_t most) {
    const uint64_t left = end_ - offset_ - kept;
    const size_t count = size_t(std::min<uint64_t>(left, std::max<uint64_t>(std::min<uint64_t>(kWindowBytes, most), 2 * margin_)));
    bytes_.resize(kept + count + margin_);
    source_->read(offset_ + kept, std::span(bytes_).subspan(kept, count));
    const bool last = count == left;
    std::memset(bytes_.data() + kept + count, 0, margin_);
    limit_ = kept + count - (last ? 0 : margin_);
}

const std::byte* ByteWindow::advance(const std::byte* next) {
    check(next);
    const size_t done = size_t(next - bytes_.data());
    const size_t kept = size_t(std::min<uint64_t>(bytes_.size() - margin_, end_ - offset_)) - done;
    std::memmove(bytes_.data(), next, kept);
    offset_ += done;
    fill(kept, kWindowBytes);
    return bytes_.data();
}

void ByteWindow::check(const std::byte* next) const {
    if (offset_of(next) > end_)
        throw Error(ErrorKind::malformed, "byte " + std::to_string(end_) + ": the compressed points go on where their bytes end");
}

}  // namespace strata::las
