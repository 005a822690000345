#include "io/byte_source.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace strata {
namespace {

// Two ranges this near are read in one request: reading the bytes between costs less than another seek.
constexpr uint64_t kLargestGap = 32 * 1024;
constexpr size_t kMostPieces = 512;  // of one request; below IOV_MAX

std::string at_byte(const std::string& name, uint64_t offset) { return name + ": byte " + std::to_string(offset) + ": "; }

void check_range(const std::string& name, uint64_t size, uint64_t offset, uint64_t count) {
    if (offset > size || count > size - offset)
        throw Error(ErrorKind::malformed, at_byte(name, offset) + std::to_string(count) + " bytes needed, " +
                                              std::to_string(size - std::min(offset, size)) + " left");
}

// Many data sets are thousands of tiles; the soft limit on open files is often 1024, the hard one far higher.
bool raise_open_file_limit() {
    struct rlimit limit {};
    if (::getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == limit.rlim_max) return false;
    limit.rlim_cur = limit.rlim_max;
    return ::setrlimit(RLIMIT_NOFILE, &limit) == 0;
}

int open_for_reading(const std::string& path) {
    // Without O_NONBLOCK, opening a FIFO waits for a writer; regular files ignore the flag.
    constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK;
    int descriptor = ::open(path.c_str(), kFlags);
    if (descriptor < 0 && errno == EMFILE && raise_open_file_limit()) descriptor = ::open(path.c_str(), kFlags);
    return descriptor;
}

class FileSource : public ByteSource {
public:
    explicit FileSource(const std::string& path) : path_(path), descriptor_(open_for_reading(path)) {
        if (descriptor_ < 0)
            throw Error(errno == ENOENT ? ErrorKind::not_found : ErrorKind::io, path + ": " + std::strerror(errno));
        struct stat status {};
        const bool known = ::fstat(descriptor_, &status) == 0;
        if (!known || !S_ISREG(status.st_mode)) {
            ::close(descriptor_);
            throw Error(ErrorKind::io, path + ": a regular file is expected");
        }
        size_ = uint64_t(status.st_size);
    }
    FileSource(const FileSource&) = delete;
    FileSource& operator=(const FileSource&) = delete;
    ~FileSource() override { ::close(descriptor_); }

    const std::string& name() const override { return path_; }
    uint64_t size() const override { return size_; }

    void read(uint64_t offset, std::span<std::byte> out) const override {
        check_range(path_, size_, offset, out.size());
        while (!out.empty()) {
            const size_t count = checked(::pread(descriptor_, out.data(), out.size(), off_t(offset)), offset);
            out = out.subspan(count);
            offset += count;
        }
    }

    void read_many(std::span<const ByteRange> ranges) const override {
        std::array<std::byte, kLargestGap> gap;  // bytes between two ranges land here and are forgotten
        std::array<iovec, 2 * kMostPieces> pieces;
        for (size_t first = 0; first < ranges.size();) {
            const uint64_t begin = ranges[first].offset;
            uint64_t end = begin;
            size_t count = 0, last = first;
            for (; last < ranges.size() && last - first < kMostPieces; ++last) {
                const ByteRange& range = ranges[last];
                if (range.offset < end || range.offset - end > kLargestGap) break;
                check_range(path_, size_, range.offset, range.out.size());
                if (range.offset > end) pieces[count++] = {gap.data(), size_t(range.offset - end)};
                if (!range.out.empty()) pieces[count++] = {range.out.data(), range.out.size()};
                end = range.offset + range.out.size();
            }
            read_pieces(begin, {pieces.data(), count});
            first = last;
        }
    }

    void prefetch(uint64_t offset, uint64_t size) const override {
        ::posix_fadvise(descriptor_, off_t(offset), off_t(size), POSIX_FADV_WILLNEED);
    }

private:
    // Returns the count of a read, 0 when it is to be tried again.
    size_t checked(ssize_t count, uint64_t offset) const {
        if (count > 0) return size_t(count);
        if (count == 0) throw Error(ErrorKind::io, at_byte(path_, offset) + "the file became shorter");
        if (errno != EINTR) throw Error(ErrorKind::io, at_byte(path_, offset) + std::strerror(errno));
        return 0;
    }

    void read_pieces(uint64_t offset, std::span<iovec> pieces) const {
        while (!pieces.empty()) {
            size_t count = checked(::preadv(descriptor_, pieces.data(), int(pieces.size()), off_t(offset)), offset);
            offset += count;
            for (; !pieces.empty() && count >= pieces.front().iov_len; pieces = pieces.subspan(1))
                count -= pieces.front().iov_len;
            if (count == 0) continue;
            pieces.front().iov_base = static_cast<std::byte*>(pieces.front().iov_base) + count;
            pieces.front().iov_len -= count;
        }
    }

    std::string path_;
    int descriptor_;
    uint64_t size_ = 0;
};

class MemorySource : public ByteSource {
public:
    MemorySource(std::string name, std::vector<std::byte> bytes) : name_(std::move(name)), bytes_(std::move(bytes)) {}

    const std::string& name() const override { return name_; }
    uint64_t size() const override { return bytes_.size(); }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        check_range(name_, bytes_.size(), offset, out.size());
        if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
    }

private:
    std::string name_;
    std::vector<std::byte> bytes_;
};

}  // namespace

std::unique_ptr<ByteSource> open_file(const std::string& path) { return std::make_unique<FileSource>(path); }

std::unique_ptr<ByteSource> memory_source(std::string name, std::vector<std::byte> bytes) {
    return std::make_unique<MemorySource>(std::move(name), std::move(bytes));
}

}  // namespace strata
