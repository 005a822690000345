#pragma once

namespace strata {

/// Makes the signals that ask a program to end (SIGINT, SIGTERM, SIGHUP, SIGPIPE) end it with 128 + the signal's number
/// and without temporaries, wherever its threads are; those that the caller ignores (nohup) stay ignored. A write into
/// a closed pipe, and one beyond the limit of a file's size, fail like any other write, and are reported as such.
/// Before any other thread starts. Without memory for its thread, signals end the program as they always did.
void end_on_signals() noexcept;

/// Keeps the numbers 0, 1 and 2 from becoming files of ours when the caller closed them: an output would receive what
/// is printed. What is then printed to such a descriptor fails.
void occupy_standard_descriptors() noexcept;

}  // namespace strata
