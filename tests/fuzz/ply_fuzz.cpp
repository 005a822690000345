// Any bytes are a PLY file: its mesh is whole, or it is refused with an Error.
#include "tests/fuzz/fuzz_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { return strata::fuzz_mesh(strata::read_ply, data, size); }
