#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "io/temporary_path.h"

namespace strata {

/// Whether a finished output must survive a power cut, or only the end of the program.
enum class Durability { synced, unsynced };

/// A file that is whole or absent: written under a temporary name beside the final one and renamed by commit().
/// Without commit() nothing stays behind and an earlier file keeps its content.
class OutputFile {
public:
    /// A path that is a symbolic link stands for the file it points to.
    /// throws  Error{io}: the file exists and `overwrite` is false, or the path is no regular file
    ///         Error{io, not_found}: the folder is missing or not writable
    OutputFile(const std::string& path, bool overwrite);

    const std::string& path() const { return path_; }
    /// Bytes up to the end of what was written or reserved.
    uint64_t size() const { return size_.load(std::memory_order_relaxed); }

    /// Writes at the end. Unbuffered: gather small pieces first. One thread at a time.
    /// throws  Error{io}, naming the path, the place, the reason and the bytes that did not fit
    void write(std::span<const std::byte> bytes) { write_at(size(), bytes); }
    /// Writes at any place. Safe from several threads.
    void write_at(uint64_t offset, std::span<const std::byte> bytes);
    /// Makes sure that the disk has room for the first `bytes` bytes, where the file system can say so early.
    void reserve(uint64_t bytes);
    /// Reads back what was written.
    void read_at(uint64_t offset, std::span<std::byte> out) const;
    /// Drops what lies beyond `bytes`.
    void truncate(uint64_t bytes);

    /// Gives the file its name; with Durability::synced, it and its name are on the disk first. Once.
    /// throws  Error{io} when another writer took the name meanwhile and `overwrite` was not given
    void commit(Durability durability = Durability::synced);

private:
    [[noreturn]] void fail(const std::string& what, int error_number) const;

    std::string path_;
    bool overwrite_;
    std::optional<TemporaryPath> temporary_;  // until commit()
    std::atomic<uint64_t> size_ = 0;
};

/// What an existing output means for whoever wants to write there: throws Error{io} unless `overwrite`.
/// returns  the path with symbolic links at its end resolved
std::string check_output_path(const std::string& path, bool overwrite);

/// Renames `from` to `to`, which must not exist unless `overwrite`; decided in one step, so that of two writers one wins.
/// throws  Error{io} when `to` exists and may not be replaced, Error{io}
void rename_output(const std::string& from, const std::string& to, bool overwrite);

/// Puts a folder's entries (names given by rename) on the disk.
void sync_folder_of(const std::string& path);

}  // namespace strata
