#include "io/output_folder.h"

#include <fcntl.h>
#include <stdio.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

// "out/" and "out" are the same folder, and the temporary lies beside it, not in it.
std::string checked_path(std::string path, const std::string& marker, bool overwrite) {
    while (path.size() > 1 && path.back() == '/') path.pop_back();
    std::error_code problem;
    if (!fs::exists(fs::symlink_status(path, problem))) return path;
    path = fs::canonical(path, problem).string();
    if (problem) throw Error(ErrorKind::io, path + ": " + problem.message());
    const bool folder = fs::is_directory(path, problem);
    if (!folder || !(fs::is_empty(path, problem) || fs::exists(fs::path(path) / marker, problem)))
        throw Error(ErrorKind::io, path + ": exists and is no earlier output (an empty folder or one with " + marker + ")");
    if (!overwrite && !fs::is_empty(path, problem))
        throw Error(ErrorKind::io, path + ": exists; --overwrite replaces it");
    return path;
}

}  // namespace

OutputFolder::OutputFolder(const std::string& path, const std::string& marker, bool overwrite)
    : path_(checked_path(path, marker, overwrite)), overwrite_(overwrite), temporary_(path_, TemporaryPath::Kind::folder) {}

void OutputFolder::commit(Durability durability) {
    if (durability == Durability::synced) sync_folder_of(path_of("."));
    std::error_code problem;
    const bool earlier = fs::exists(path_, problem);
    if (earlier && !fs::is_empty(path_, problem)) {
        if (!overwrite_) throw Error(ErrorKind::io, path_ + ": exists; --overwrite replaces it");
        // After the exchange the temporary name holds the earlier output and is removed with it.
        if (::renameat2(AT_FDCWD, temporary_.path().c_str(), AT_FDCWD, path_.c_str(), RENAME_EXCHANGE) != 0)
            throw Error(ErrorKind::io, path_ + ": exchanging it with " + temporary_.path() + ": " + std::strerror(errno));
    } else {
        if (std::rename(temporary_.path().c_str(), path_.c_str()) != 0)
            throw Error(ErrorKind::io, path_ + ": renaming " + temporary_.path() + ": " + std::strerror(errno));
        temporary_.keep();
    }
    if (durability == Durability::synced) sync_folder_of(path_);
}

}  // namespace strata
