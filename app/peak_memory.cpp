#include "app/peak_memory.h"

#include <sys/resource.h>

namespace strata {

uint64_t peak_memory_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return uint64_t(usage.ru_maxrss) * 1024;
}

}  // namespace strata
