// Preloaded into a program, it fails one call: STRATA_FAULT=CALL:K:HOW fails the K-th CALL (counted from 1) by HOW.
//   CALL  malloc, write, pwrite, pread, fsync, rename, open, mkdir
//   HOW   an errno by name (ENOSPC, EIO, EINTR, ENOMEM, EACCES), short (half of the bytes), kill (SIGKILL before the
//   call)
// With STRATA_FAULT_COUNT=FILE the number of CALLs made is written there at the end, so that a driver knows how far K
// goes.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kShort = -1, kKill = -2 };

static char armed_call[16];
static long armed_at = 0;
static int armed_how = 0;  // an errno, kShort or kKill
static atomic_long calls = 0;

static void arm(void) {
    const char* text = getenv("STRATA_FAULT");
    char how[16] = "";
    char call[16] = "";
    if (!text || sscanf(text, "%15[^:]:%ld:%15s", call, &armed_at, how) < 2) return;
    armed_how = !strcmp(how, "ENOSPC")   ? ENOSPC
                : !strcmp(how, "EINTR")  ? EINTR
                : !strcmp(how, "ENOMEM") ? ENOMEM
                : !strcmp(how, "EACCES") ? EACCES
                : !strcmp(how, "short")  ? kShort
                : !strcmp(how, "kill")   ? kKill
                                         : EIO;
    atomic_store(&calls, 0);
    strcpy(armed_call, call);
}

// Calls count from main on: what static initializers ask for before it cannot be answered by any code.
static int (*program_main)(int, char**, char**);
static int armed_main(int argc, char** argv, char** environment) {
    arm();
    return program_main(argc, argv, environment);
}
int __libc_start_main(int (*main_function)(int, char**, char**), int argc, char** argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void* stack_end) {
    program_main = main_function;
    return ((__typeof__(&__libc_start_main))dlsym(RTLD_NEXT, "__libc_start_main"))(armed_main, argc, argv, init, fini,
                                                                                   rtld_fini, stack_end);
}

__attribute__((destructor)) static void count(void) {
    const char* path = getenv("STRATA_FAULT_COUNT");
    const long made = atomic_load(&calls);
    armed_call[0] = '\0';
    FILE* file = path ? fopen(path, "w") : NULL;
    if (!file) return;
    fprintf(file, "%ld\n", made);
    fclose(file);
}

// How this call must fail; 0: not at all.
static int fault(const char* call) {
    if (strcmp(call, armed_call) != 0 || atomic_fetch_add(&calls, 1) + 1 != armed_at) return 0;
    if (armed_how == kKill) raise(SIGKILL);
    return armed_how;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL(call)               \
    const int how = fault(call); \
    if (how > 0) return errno = how, -1
#define FEWER(size) (how == kShort ? (size + 1) / 2 : size)

void* __libc_malloc(size_t size);
void* malloc(size_t size) {
    if (armed_call[0] == 'm' && fault("malloc")) return errno = ENOMEM, NULL;
    return __libc_malloc(size);
}

ssize_t write(int fd, const void* data, size_t size) {
    FAIL("write");
    return NEXT(write)(fd, data, FEWER(size));
}
ssize_t pwrite(int fd, const void* data, size_t size, off_t offset) {
    FAIL("pwrite");
    return NEXT(pwrite)(fd, data, FEWER(size), offset);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t offset) {
    FAIL("pwrite");
    return NEXT(pwrite64)(fd, data, FEWER(size), offset);
}
ssize_t pread(int fd, void* data, size_t size, off_t offset) {
    FAIL("pread");
    return NEXT(pread)(fd, data, FEWER(size), offset);
}
ssize_t pread64(int fd, void* data, size_t size, off64_t offset) {
    FAIL("pread");
    return NEXT(pread64)(fd, data, FEWER(size), offset);
}
ssize_t preadv(int fd, const struct iovec* pieces, int n, off_t offset) {
    FAIL("pread");
    return NEXT(preadv)(fd, pieces, FEWER(n), offset);
}
ssize_t preadv64(int fd, const struct iovec* pieces, int n, off64_t offset) {
    FAIL("pread");
    return NEXT(preadv64)(fd, pieces, FEWER(n), offset);
}
int fsync(int fd) {
    FAIL("fsync");
    return NEXT(fsync)(fd);
}
int rename(const char* from, const char* to) {
    FAIL("rename");
    return NEXT(rename)(from, to);
}
int renameat2(int from_dir, const char* from, int to_dir, const char* to, unsigned flags) {
    FAIL("rename");
    return NEXT(renameat2)(from_dir, from, to_dir, to, flags);
}
int mkdir(const char* path, mode_t mode) {
    FAIL("mkdir");
    return NEXT(mkdir)(path, mode);
}

static mode_t mode_of(int flags, va_list rest) {
    return (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(rest, mode_t) : 0;
}
int open(const char* path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    const mode_t mode = mode_of(flags, rest);
    va_end(rest);
    FAIL("open");
    return NEXT(open)(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    const mode_t mode = mode_of(flags, rest);
    va_end(rest);
    FAIL("open");
    return NEXT(open64)(path, flags, mode);
}
