#include "io/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

// At most, in one call. The kernel lays page caches out by the size of calls: for large ones it looks for untouched blocks
// of 2 MiB, which a virtual machine may have to ask of its host; smaller ones get pages that were in use a moment ago.
constexpr size_t kWriteBytes = 128 * 1024;

Error exists_error(const std::string& path) {
    return Error(ErrorKind::io, path + ": exists; --overwrite replaces it");
}

}  // namespace

std::string check_output_path(const std::string& path, bool overwrite) {
    if (path.empty()) throw Error(ErrorKind::usage, "the output's name is empty");
    std::string resolved = path;
    struct stat status {};
    if (::lstat(path.c_str(), &status) == 0 && S_ISLNK(status.st_mode)) {
        std::error_code failure;
        resolved = fs::weakly_canonical(fs::absolute(path).parent_path() / fs::read_symlink(path, failure), failure).string();
        if (failure) throw Error(ErrorKind::io, path + ": symbolic link: " + failure.message());
    }
    if (::stat(resolved.c_str(), &status) != 0) {
        if (errno == ENOENT || errno == ENOTDIR) return resolved;
        throw Error(ErrorKind::io, path + ": " + std::strerror(errno));
    }
    if (S_ISDIR(status.st_mode)) throw Error(ErrorKind::io, path + ": is a folder; a file's name is expected");
    if (!S_ISREG(status.st_mode)) throw Error(ErrorKind::io, path + ": is no regular file; strata writes whole files only");
    if (!overwrite) throw exists_error(path);
    return resolved;
}

void rename_output(const std::string& from, const std::string& to, bool overwrite) {
    int outcome;
    if (overwrite) {
        outcome = std::rename(from.c_str(), to.c_str());
    } else {
        outcome = ::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE);
        if (outcome != 0 && (errno == EINVAL || errno == ENOSYS)) {  // a file system without the flag
            outcome = ::link(from.c_str(), to.c_str());
            if (outcome == 0) ::unlink(from.c_str());
        }
    }
    if (outcome == 0) return;
    if (errno == EEXIST && !overwrite) throw exists_error(to);
    throw Error(ErrorKind::io, to + ": renaming " + from + ": " + std::strerror(errno));
}

void sync_folder_of(const std::string& path) {
    const std::string parent = fs::path(path).parent_path().string();
    const int descriptor = ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return;  // a folder may be writable and not readable: then there is nothing to sync by
    const int outcome = ::fsync(descriptor);
    const int error_number = errno;
    ::close(descriptor);
    if (outcome != 0 && error_number != EINVAL)
        throw Error(ErrorKind::io, path + ": syncing its folder: " + std::strerror(error_number));
}

OutputFile::OutputFile(const std::string& path, bool overwrite)
    : path_(check_output_path(path, overwrite)), overwrite_(overwrite) {
    temporary_.emplace(path_, TemporaryPath::Kind::file);
    struct stat earlier {};
    if (::stat(path_.c_str(), &earlier) == 0) ::fchmod(temporary_->descriptor(), earlier.st_mode & 0777);
}

void OutputFile::fail(const std::string& what, int error_number) const {
    throw Error(ErrorKind::io, path_ + ": " + what + ": " + std::strerror(error_number));
}

void OutputFile::write_at(uint64_t offset, std::span<const std::byte> bytes) {
    const uint64_t end = offset + bytes.size();
    while (!bytes.empty()) {
        const ssize_t count = ::pwrite(temporary_->descriptor(), bytes.data(), std::min(bytes.size(), kWriteBytes), off_t(offset));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0)
            fail("byte " + std::to_string(offset) + ": writing " + std::to_string(bytes.size()) + " bytes", count < 0 ? errno : EIO);
        bytes = bytes.subspan(size_t(count));
        offset += uint64_t(count);
    }
    for (uint64_t seen = size(); seen < end && !size_.compare_exchange_weak(seen, end);) {
    }
}

void OutputFile::reserve(uint64_t bytes) {
    int outcome;
    do outcome = ::fallocate(temporary_->descriptor(), FALLOC_FL_KEEP_SIZE, 0, off_t(bytes));
    while (outcome != 0 && errno == EINTR);
    if (outcome != 0 && (errno == ENOSPC || errno == EDQUOT || errno == EFBIG))
        fail(std::to_string(bytes) + " bytes needed", errno);
}

void OutputFile::read_at(uint64_t offset, std::span<std::byte> out) const {
    while (!out.empty()) {
        const ssize_t count = ::pread(temporary_->descriptor(), out.data(), out.size(), off_t(offset));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) fail("byte " + std::to_string(offset) + ": reading back", count < 0 ? errno : EIO);
        out = out.subspan(size_t(count));
        offset += uint64_t(count);
    }
}

void OutputFile::truncate(uint64_t bytes) {
    if (::ftruncate(temporary_->descriptor(), off_t(bytes)) != 0) fail("shortening to " + std::to_string(bytes) + " bytes", errno);
    size_ = bytes;
}

void OutputFile::commit(Durability durability) {
    if (durability == Durability::synced && ::fsync(temporary_->descriptor()) != 0)
        fail("syncing " + std::to_string(size()) + " bytes", errno);
    rename_output(temporary_->path(), path_, overwrite_);
    temporary_->keep();
    temporary_.reset();
    if (durability == Durability::synced) sync_folder_of(path_);
}

}  // namespace strata
