#include "io/temporary_path.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <set>
#include <string_view>

#include "core/error.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = ".strata-";
constexpr std::string_view kEnding = ".tmp";
constexpr size_t kLongestName = 255;  // bytes in one path component, on every file system we meet
constexpr size_t kLongestPid = 10;

// What a signal must clean up. The one process-wide state: signals are process-wide too.
struct Registry {
    std::mutex mutex;
    std::set<std::string> paths;
};
Registry& registry() {
    static Registry& instance = *new Registry;  // outlives static destructors: a signal may come while they run
    return instance;
}

// Names are unlinked without memory of ours: a temporary goes also when there is no more of it.
void empty_folder(int descriptor) noexcept {
    DIR* folder = nullptr;
    for (int attempt = 0; !folder && attempt < 3; ++attempt) folder = ::fdopendir(descriptor);
    if (!folder) {
        ::close(descriptor);
        return;
    }
    while (const dirent* entry = ::readdir(folder)) {
        const char* const name = entry->d_name;
        if (!std::strcmp(name, ".") || !std::strcmp(name, "..") || ::unlinkat(descriptor, name, 0) == 0) continue;
        const int child = ::openat(descriptor, name, O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
        if (child < 0) continue;
        empty_folder(child);
        ::unlinkat(descriptor, name, AT_REMOVEDIR);
    }
    ::closedir(folder);
}

void remove_quietly(const std::string& path) noexcept {
    if (::unlink(path.c_str()) == 0 || errno == ENOENT) return;
    for (int attempt = 0; attempt < 3; ++attempt) {  // another thread may have given a file in it its name meanwhile
        const int folder = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
        if (folder < 0) continue;
        empty_folder(folder);
        if (::rmdir(path.c_str()) == 0) return;
    }
}

// ".NAME.strata-", shortened so that a name of 255 bytes still gets a temporary.
std::string name_prefix(const std::string& final_path) {
    const std::string name = fs::path(final_path).filename().string();
    const size_t room = kLongestName - 1 - kMark.size() - kLongestPid - kEnding.size();
    std::string prefix = ".";
    prefix.append(name, 0, room).append(kMark);
    return prefix;
}

std::string parent_of(const std::string& path) {
    const std::string parent = fs::path(path).parent_path().string();
    return parent.empty() ? "." : parent;
}

// A process of this machine with that number runs, whatever it is. Our own number counts as free: in containers the
// process that died had it too, and the lock tells the rest.
bool process_runs(pid_t pid) { return pid != ::getpid() && (::kill(pid, 0) == 0 || errno != ESRCH); }

void remove_if_stale(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0) return;
    if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) remove_quietly(path);
    ::close(descriptor);
}

struct CloseFolder {
    void operator()(DIR* folder) const noexcept { ::closedir(folder); }
};

// By readdir: std::filesystem's iterator ends the program when there is no memory for it.
void remove_stale(const std::string& folder, const std::string& prefix) {
    const std::unique_ptr<DIR, CloseFolder> entries(::opendir(folder.c_str()));
    if (!entries) return;
    while (const dirent* entry = ::readdir(entries.get())) {
        const std::string_view name = entry->d_name;
        if (!name.starts_with(prefix) || !name.ends_with(kEnding) || name.size() <= prefix.size() + kEnding.size()) continue;
        const char* first = name.data() + prefix.size();
        const char* last = name.data() + name.size() - kEnding.size();
        pid_t pid = 0;
        const auto [stop, error] = std::from_chars(first, last, pid);
        if (error == std::errc() && stop == last && pid > 0 && !process_runs(pid)) remove_if_stale(folder + "/" + std::string(name));
    }
}

}  // namespace

TemporaryPath::TemporaryPath(const std::string& final_path, Kind kind) {
    const std::string folder = parent_of(final_path);
    const std::string prefix = name_prefix(final_path);
    remove_stale(folder, prefix);
    path_ = (fs::path(folder) / prefix).string();
    path_.append(std::to_string(::getpid())).append(kEnding);

    int problem = 0;
    Registry& all = registry();
    const std::lock_guard lock(all.mutex);  // a signal between entry and creation would meet another's file
    all.paths.insert(path_);                // first: a lack of memory after creation would leave the file behind
    if (kind == Kind::file) {
        descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        problem = errno;
    } else if (::mkdir(path_.c_str(), 0777) == 0) {
        descriptor_ = ::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        problem = errno;
        if (descriptor_ < 0) remove_quietly(path_);
    } else {
        problem = errno;
    }
    if (descriptor_ < 0) {
        all.paths.erase(path_);
        if (problem == EEXIST) throw Error(ErrorKind::io, final_path + ": is being written already, as " + path_);
        throw Error(problem == ENOENT ? ErrorKind::not_found : ErrorKind::io,
                    final_path + ": cannot be written into " + folder + ": " + std::strerror(problem));
    }
    ::flock(descriptor_, LOCK_EX | LOCK_NB);  // where a file system has no locks, the process number alone decides
}

TemporaryPath::~TemporaryPath() {
    if (!kept_) {
        remove_quietly(path_);
        const std::lock_guard lock(registry().mutex);
        registry().paths.erase(path_);
    }
    ::close(descriptor_);
}

void TemporaryPath::keep() {
    const std::lock_guard lock(registry().mutex);
    registry().paths.erase(path_);
    kept_ = true;
}

void remove_temporaries_and_exit(int exit_code) noexcept {
    // Never given back: no temporary is made from here on, and a thread that fails because its file is gone waits in
    // ~TemporaryPath for the end instead of reporting it.
    registry().mutex.lock();
    for (const std::string& path : registry().paths) remove_quietly(path);
    ::_exit(exit_code);
}

}  // namespace strata
