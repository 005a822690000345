#include "io/mesh/mesh_memory.h"

#include <string>

#include "core/error.h"

namespace strata {

void MeshMemory::refuse(uint64_t bytes, const char* about) const {
    throw Error(ErrorKind::limit, stream_.name() + ": the mesh needs " + about + std::to_string(bytes) + " bytes of memory, " +
                                      std::to_string(most_) + " are allowed");
}

void MeshMemory::refuse_to_grow(uint64_t bytes) const {
    // What comes is taken to be like what came. An array that grows by half is there twice for a while: 2.5 times what it held.
    const double part = double(std::max<uint64_t>(stream_.position(), 1)) / double(std::max<uint64_t>(stream_.size(), 1));
    refuse(std::max(held_ + bytes, uint64_t(double(held_) / part * 2.5)), "about ");
}

}  // namespace strata
