#include "io/scratch_file.h"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>

#include "core/error.h"

namespace strata {
namespace {

class ScratchFile : public ScratchStore {
public:
    explicit ScratchFile(std::string folder) : folder_(std::move(folder)) {}
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;
    ~ScratchFile() override {
        if (descriptor_ >= 0) ::close(descriptor_);
    }

    void write(uint64_t offset, std::span<const std::byte> bytes) override {
        std::call_once(opened_, [&] { open(); });
        while (!bytes.empty()) {
            const ssize_t count = ::pwrite(descriptor_, bytes.data(), bytes.size(), off_t(offset));
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) throw failure("writing " + std::to_string(bytes.size()) + " bytes at " + std::to_string(offset));
            bytes = bytes.subspan(size_t(count));
            offset += uint64_t(count);
        }
    }

    void read(uint64_t offset, std::span<std::byte> out) const override {
        while (!out.empty()) {
            const ssize_t count = ::pread(descriptor_, out.data(), out.size(), off_t(offset));
            if (count < 0 && errno == EINTR) continue;
            if (count == 0) errno = EIO;
            if (count <= 0) throw failure("reading " + std::to_string(out.size()) + " bytes at " + std::to_string(offset));
            out = out.subspan(size_t(count));
            offset += uint64_t(count);
        }
    }

    void discard(uint64_t offset, uint64_t size) override {
        // Where the file system cannot punch holes, the space is held until the end.
        if (descriptor_ >= 0 && size > 0)
            (void)::fallocate(descriptor_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, off_t(offset), off_t(size));
    }

private:
    void open() {
        descriptor_ = ::open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
        if (descriptor_ < 0) {  // a file system without unnamed files: a name that is gone at once
            std::string name = folder_ + "/.strata-XXXXXX";
            descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
            if (descriptor_ >= 0) ::unlink(name.c_str());
        }
        if (descriptor_ < 0) throw failure("making it");
    }

    Error failure(const std::string& action) const {
        return {ErrorKind::io, folder_ + ": temporary file: " + action + ": " + std::strerror(errno)};
    }

    std::string folder_;
    std::once_flag opened_;
    int descriptor_ = -1;
};

}  // namespace

std::unique_ptr<ScratchStore> make_scratch_file(const std::string& folder) { return std::make_unique<ScratchFile>(folder); }

uint64_t free_disk_bytes(const std::string& folder) {
    struct statvfs status {};
    if (::statvfs(folder.c_str(), &status) != 0)
        throw Error(ErrorKind::io, folder + ": " + std::strerror(errno));
    return uint64_t(status.f_bavail) * status.f_frsize;
}

}  // namespace strata
