#pragma once

#include <memory>
#include <string>

#include "io/node_writer.h"
#include "io/output_file.h"

namespace strata {

enum class PotreeEncoding { plain, brotli };  // "DEFAULT" and "BROTLI" in metadata.json

struct PotreeWriteSettings {
    PotreeEncoding encoding = PotreeEncoding::plain;
    int brotli_quality = 2;  // 0 ... 11
    bool overwrite = false;
    Durability durability = Durability::synced;
};

/// Writes a Potree 2.0 folder: metadata.json, hierarchy.bin, octree.bin. It gets its name when finish() has put all
/// on the disk; until then, and when anything fails, an earlier output stays as it was.
/// throws  Error{io}: the folder exists and may not be replaced, or cannot be made
std::unique_ptr<NodeWriter> make_potree_writer(const std::string& folder, const PotreeWriteSettings& settings);

}  // namespace strata
