#include "io/temporary_path.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
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
    static Registry instance;
    return instance;
}

void remove_quietly(const std::string& path) noexcept {
    std::error_code ignored;
    fs::remove_all(path, ignored);
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

void remove_stale(const std::string& folder, const std::string& prefix) {
    std::error_code failure;
    for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end; entry.increment(failure)) {
        const std::string name = entry->path().filename().string();
        if (!name.starts_with(prefix) || !name.ends_with(kEnding) || name.size() <= prefix.size() + kEnding.size()) continue;
        const char* first = name.data() + prefix.size();
        const char* last = name.data() + name.size() - kEnding.size();
        pid_t pid = 0;
        const auto [stop, error] = std::from_chars(first, last, pid);
        if (error == std::errc() && stop == last && pid > 0 && !process_runs(pid)) remove_if_stale(entry->path().string());
    }
}

}  // namespace

TemporaryPath::TemporaryPath(const std::string& final_path, Kind kind) {
    const std::string folder = parent_of(final_path);
    const std::string prefix = name_prefix(final_path);
    remove_stale(folder, prefix);
    path_ = (fs::path(folder) / prefix).string();
    path_.append(std::to_string(::getpid())).append(kEnding);

    Registry& all = registry();
    const std::lock_guard lock(all.mutex);  // a signal between creation and entry would leave the file behind
    if (kind == Kind::file) {
        descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } else if (::mkdir(path_.c_str(), 0777) == 0) {
        descriptor_ = ::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (descriptor_ < 0) remove_quietly(path_);
    }
    if (descriptor_ < 0) {
        if (errno == EEXIST) throw Error(ErrorKind::io, final_path + ": is being written already, as " + path_);
        throw Error(errno == ENOENT ? ErrorKind::not_found : ErrorKind::io,
                    final_path + ": cannot be written into " + folder + ": " + std::strerror(errno));
    }
    ::flock(descriptor_, LOCK_EX | LOCK_NB);  // where a file system has no locks, the process number alone decides
    all.paths.insert(path_);
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

void remove_all_temporaries() noexcept {
    const std::lock_guard lock(registry().mutex);
    for (const std::string& path : registry().paths) remove_quietly(path);
}

}  // namespace strata
