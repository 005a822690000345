#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "core/octree/scratch_store.h"
#include "io/output_file.h"

namespace strata {

/// Small pieces of an output on their way to it, written a MiB at a time, one behind the other.
class GatheredBytes {
public:
    /// Into a file from its end on.
    explicit GatheredBytes(OutputFile& file) : file_(&file), size_(file.size()) {}
    /// Into a scratch store from its start on.
    explicit GatheredBytes(ScratchStore& store) : store_(&store) {}

    /// Room for so many bytes, at most 64 KiB, at the end.
    std::byte* room(size_t count) {
        if (used_ + count > buffer_.size()) flush();
        std::byte* const at = buffer_.data() + used_;
        used_ += count;
        return at;
    }
    template <typename T>
    void put(const T& value) {
        std::memcpy(room(sizeof value), &value, sizeof value);
    }
    void text(std::string_view text) { std::memcpy(room(text.size()), text.data(), text.size()); }

    /// Bytes up to here.
    uint64_t size() const { return size_ + used_; }
    void flush() {
        const auto bytes = std::span<const std::byte>(buffer_).first(used_);
        if (!bytes.empty()) file_ ? file_->write_at(size_, bytes) : store_->write(size_, bytes);
        size_ += used_;
        used_ = 0;
        buffer_.resize(kBuffer);
    }
    /// Gives a file all that is in a store, which was written by `from`.
    void copy(GatheredBytes& from) {
        from.flush();
        flush();
        for (uint64_t at = 0; at < from.size_;) {
            const auto part = std::span(buffer_).first(size_t(std::min<uint64_t>(buffer_.size(), from.size_ - at)));
            from.store_->read(at, part);
            file_->write_at(size_, part);
            at += part.size();
            size_ += part.size();
        }
    }

private:
    static constexpr size_t kBuffer = 1 << 20;

    OutputFile* file_ = nullptr;
    ScratchStore* store_ = nullptr;
    uint64_t size_ = 0;  // bytes that are written
    size_t used_ = 0;    // of the buffer
    std::vector<std::byte> buffer_;
};

}  // namespace strata
