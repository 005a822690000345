#include "io/output_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

#include "core/error.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

struct CloseFolder {
    void operator()(DIR* folder) const noexcept { ::closedir(folder); }
};

// By readdir: std::filesystem's iterator ends the program when there is no memory for it.
std::vector<std::string> names_in(const std::string& folder) {
    const std::unique_ptr<DIR, CloseFolder> entries(::opendir(folder.c_str()));
    std::vector<std::string> names;
    errno = entries ? 0 : errno;
    for (const dirent* entry = nullptr; entries && (entry = ::readdir(entries.get()));) {
        const std::string_view name = entry->d_name;
        if (name != "." && name != "..") names.emplace_back(name);
        errno = 0;
    }
    // A list that breaks off would pass for a folder without the rest.
    if (errno != 0) throw Error(ErrorKind::io, folder + ": " + std::strerror(errno));
    std::sort(names.begin(), names.end());  // one message for one folder, whatever the file system
    return names;
}

std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
}

// A folder by the name of a part is none: what it holds would go with it.
bool is_part(const std::string& folder, const std::string& name, const FolderParts& parts) {
    std::error_code problem;
    const fs::file_status status = fs::symlink_status(fs::path(folder) / name, problem);
    return parts.is_part(name) && (fs::is_regular_file(status) || fs::is_symlink(status));
}

// Of a path that exists.
// returns  whether there is something to replace
bool check_replaceable(const std::string& path, const FolderParts& parts, bool overwrite) {
    std::error_code problem;
    const std::string none = path + ": exists and is no earlier output (an empty folder or one with " + listed(parts.always) + ")";
    if (!fs::is_directory(path, problem)) throw Error(ErrorKind::io, none);
    const std::vector<std::string> names = names_in(path);
    if (names.empty()) return false;
    const auto stranger = std::find_if(names.begin(), names.end(), [&](const std::string& name) { return !is_part(path, name, parts); });
    const bool some = std::any_of(names.begin(), names.end(), [&](const std::string& name) { return parts.is_part(name); });
    if (some && stranger != names.end())
        throw Error(ErrorKind::io, path + ": holds '" + *stranger + "', which is no part of a data set; --overwrite would delete it");
    const bool whole = std::all_of(parts.always.begin(), parts.always.end(), [&](const std::string& name) { return std::binary_search(names.begin(), names.end(), name); });
    if (!some || !whole) throw Error(ErrorKind::io, none);
    if (!overwrite) throw Error(ErrorKind::io, path + ": exists; --overwrite replaces it");
    return true;
}

// "out/" and "out" are the same folder, and the temporary lies beside it, not in it.
std::string checked_path(std::string path, const FolderParts& parts, bool overwrite) {
    while (path.size() > 1 && path.back() == '/') path.pop_back();
    std::error_code problem;
    if (!fs::exists(fs::symlink_status(path, problem))) return path;
    path = fs::canonical(path, problem).string();
    if (problem) throw Error(ErrorKind::io, path + ": " + problem.message());
    check_replaceable(path, parts, overwrite);
    return path;
}

}  // namespace

OutputFolder::OutputFolder(const std::string& path, FolderParts parts, bool overwrite)
    : path_(checked_path(path, parts, overwrite)), parts_(std::move(parts)), overwrite_(overwrite), temporary_(path_, TemporaryPath::Kind::folder) {}

void OutputFolder::commit(Durability durability) {
    if (durability == Durability::synced) sync_folder_of(path_of("."));
    std::error_code problem;
    // Once more: a conversion takes its time, and somebody may have put something there meanwhile.
    if (fs::exists(path_, problem) && check_replaceable(path_, parts_, overwrite_)) {
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
