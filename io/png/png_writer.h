#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/output_file.h"

namespace strata {

/// Writes an 8-bit sRGB PNG from rows that arrive in order, so that a picture need not be in memory whole.
/// Rows are compressed in segments of about 256 KiB, on several threads when a call brings several segments; the file's
/// bytes depend on the pixels alone, neither on the threads nor on how the rows were split over calls.
class PngWriter {
public:
    enum class Alpha { kept, dropped };  // dropped: the picture is opaque and stored as RGB

    struct Options {
        Alpha alpha = Alpha::kept;
        bool overwrite = false;
        int threads = 1;
        std::string software = "strata";  // the text chunk "Software"; empty: none
        Durability durability = Durability::unsynced;  // a picture can be made again
    };

    /// throws  Error{usage}: a side is 0 or above 2^31 - 1, or the file exists; Error{io}
    PngWriter(const std::string& path, uint32_t width, uint32_t height, const Options& options);

    /// Appends whole rows of RGBA pixels, red in the lowest byte. throws Error{io}
    void write_rows(std::span<const uint32_t> rgba);

    /// Ends the picture and gives the file its name. All rows must have come.
    void finish();

private:
    struct Segment {
        std::vector<std::byte> chunk;  // a whole IDAT chunk
        uint32_t checksum = 0;         // Adler-32 of the filtered rows
        uint64_t raw_bytes = 0;
    };

    size_t row_bytes() const { return size_t(width_) * channels_ + 1; }
    void write_segments(std::span<const uint32_t> rgba);
    Segment compress(std::span<const uint32_t> rgba) const;

    OutputFile file_;
    uint32_t width_, height_;
    size_t channels_;
    Options options_;
    uint32_t segment_rows_;
    uint32_t rows_come_ = 0;
    std::vector<uint32_t> pending_;  // rows that do not fill a segment yet
    uint32_t checksum_ = 1;          // Adler-32 of no bytes
};

}  // namespace strata
