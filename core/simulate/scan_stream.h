#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "core/simulate/survey.h"

namespace strata {

/// Scans a whole survey on `threads` threads and hands its points over in order: part by part, block by block, exactly each
/// part's quota. The points and their order do not depend on the number of threads; memory is a few blocks a thread.
/// sink    gets the next points; called by one thread at a time
/// throws  whatever the sink throws, once all threads have ended
void stream_scan(const VillageScene& scene, const Survey& survey, int threads, const std::function<void(std::span<const ScanPoint>)>& sink);

}  // namespace strata
