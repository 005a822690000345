// Any bytes are a volume file: its samples are read to the last, or it is refused with an Error.
#include "tests/fuzz/fuzz_volume.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { return strata::fuzz_volume(data, size); }
