#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/output_file.h"

namespace strata {

/// Writes one-channel floats (a depth picture) as PFM: little-endian, bottom row first, as the format has it.
/// Rows may come in any order, so that a picture need not be in memory whole. Infinities and NaN are stored as they are.
/// source  P. Debevec, HDR image formats: "Pf", width, height, -1 for little-endian
class PfmWriter {
public:
    /// throws  Error{usage} when the file exists and `overwrite` is false, Error{io}
    PfmWriter(const std::string& path, uint32_t width, uint32_t height, bool overwrite);

    /// Stores whole rows from `first_row` on, counted from the top. throws Error{io}
    void write_rows(uint32_t first_row, std::span<const float> values);

    /// Gives the file its name. Rows that never came are 0.
    void finish();

private:
    OutputFile file_;
    uint32_t width_, height_;
    uint64_t head_bytes_ = 0;
};

}  // namespace strata
