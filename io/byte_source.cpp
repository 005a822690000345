#include "io/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace strata {
namespace {

class FileSource : public ByteSource {
public:
    explicit FileSource(const std::string& path) : path_(path), descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
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
        if (offset > size_ || out.size() > size_ - offset)
            throw Error(ErrorKind::malformed, path_ + ": byte " + std::to_string(offset) + ": " + std::to_string(out.size()) +
                                                  " bytes needed, " + std::to_string(size_ - std::min(offset, size_)) + " left");
        while (!out.empty()) {
            const ssize_t count = ::pread(descriptor_, out.data(), out.size(), off_t(offset));
            if (count < 0 && errno == EINTR) continue;
            if (count < 0)
                throw Error(ErrorKind::io, path_ + ": byte " + std::to_string(offset) + ": " + std::strerror(errno));
            if (count == 0) throw Error(ErrorKind::io, path_ + ": byte " + std::to_string(offset) + ": the file became shorter");
            out = out.subspan(size_t(count));
            offset += uint64_t(count);
        }
    }

private:
    std::string path_;
    int descriptor_;
    uint64_t size_ = 0;
};

}  // namespace

std::unique_ptr<ByteSource> open_file(const std::string& path) { return std::make_unique<FileSource>(path); }

}  // namespace strata
