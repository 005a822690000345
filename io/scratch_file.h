#pragma once

#include <memory>
#include <string>

#include "core/octree/scratch_store.h"

namespace strata {

/// Room in an unnamed file of `folder`, made with the first write: it vanishes however the program ends.
/// throws (also from its functions)  Error{io}, naming the folder and the bytes needed
std::unique_ptr<ScratchStore> make_scratch_file(const std::string& folder);

/// Bytes that an ordinary user can still write to the file system of `folder`.
uint64_t free_disk_bytes(const std::string& folder);

}  // namespace strata
