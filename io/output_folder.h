#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/output_file.h"
#include "io/temporary_path.h"

namespace strata {

/// The files that an output folder of one kind holds.
struct FolderParts {
    std::vector<std::string> always;         // in each
    bool (*is_part)(std::string_view name);  // these and what else may be in one
};

/// A folder that is whole or absent: filled under a temporary name beside the final one, and renamed, or exchanged with
/// the earlier one, by commit(). An earlier output is replaced only when it is one: a folder that is empty, or holds all
/// that is always there and nothing but parts. One with anything else that a user keeps there is left alone.
class OutputFolder {
public:
    /// throws  Error{io}: exists and `overwrite` is false, or is no such output; Error{not_found, io}: cannot be made
    OutputFolder(const std::string& path, FolderParts parts, bool overwrite);

    const std::string& path() const { return path_; }
    /// Where a file of the folder lies until commit().
    std::string path_of(const std::string& name) const { return temporary_.path() + "/" + name; }

    /// Gives the folder its name; with Durability::synced its entries and its name are on the disk first. Once, when
    /// its files are committed.
    /// throws  Error{io}: what the constructor refuses is there by now; the file system
    void commit(Durability durability);

private:
    std::string path_;
    FolderParts parts_;
    bool overwrite_;
    TemporaryPath temporary_;
};

}  // namespace strata
