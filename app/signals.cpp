#include "app/signals.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include "io/temporary_path.h"

namespace strata {
namespace {

constexpr int kEnding[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};

sigset_t ending_signals() {
    sigset_t set;
    sigemptyset(&set);
    for (const int number : kEnding) {
        struct sigaction action {};
        if (::sigaction(number, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) sigaddset(&set, number);
    }
    return set;
}

// A thread, not a handler: removing files takes locks and memory, which a handler may not.
void* wait_for_signal(void*) {
    const sigset_t set = ending_signals();
    int number = 0;
    while (::sigwait(&set, &number) != 0) {
    }
    remove_temporaries_and_exit(128 + number);
}

}  // namespace

void end_on_signals() noexcept {
    ::signal(SIGXFSZ, SIG_IGN);
    const sigset_t set = ending_signals();
    sigset_t before;
    if (::pthread_sigmask(SIG_BLOCK, &set, &before) != 0) return;  // threads made from here on inherit it
    pthread_t thread;
    if (::pthread_create(&thread, nullptr, wait_for_signal, nullptr) == 0)
        ::pthread_detach(thread);
    else
        ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void occupy_standard_descriptors() noexcept {
    for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
        if (::fcntl(descriptor, F_GETFD) >= 0) continue;
        // The lowest free number is the one that is missing; opened against its direction, so that its use fails.
        (void)!::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    }
}

}  // namespace strata
