#pragma once

#include <string>

namespace strata {

/// Owns the name of an output while it is not whole: `.NAME.strata-PID.tmp` beside NAME, so that a rename finishes it.
/// The file or folder of that name is removed with all it holds unless keep() was called first. A temporary of the same
/// NAME whose process is dead is removed on the way. The path is locked while its owner lives (flock), which tells a
/// dead owner from one in another container or on another machine.
class TemporaryPath {
public:
    enum class Kind { file, folder };

    /// Creates an empty file or folder. `final_path` is NAME with its folder, which must exist.
    /// throws  Error{io, not_found}: the folder is missing or not writable, another writer of this process is at it
    TemporaryPath(const std::string& final_path, Kind kind);
    TemporaryPath(const TemporaryPath&) = delete;
    TemporaryPath& operator=(const TemporaryPath&) = delete;
    ~TemporaryPath();

    const std::string& path() const { return path_; }
    /// Open for reading and writing (folder: reading) as long as this object lives.
    int descriptor() const { return descriptor_; }
    /// The path now bears its final name: leave it alone from here on.
    void keep();

private:
    std::string path_;
    int descriptor_ = -1;
    bool kept_ = false;
};

/// Removes the temporaries of this process and ends it, for the thread that waits for signals. Other threads may be at
/// work: what they fail at meanwhile is not reported. Takes a lock: not for a signal handler itself.
[[noreturn]] void remove_temporaries_and_exit(int exit_code) noexcept;

}  // namespace strata
