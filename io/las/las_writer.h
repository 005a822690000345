#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "core/math/quantization.h"
#include "io/output_file.h"

namespace strata {

struct LasWriterSettings {
    int point_format = 7;  // 6, 7 or 8
    Quantization quantization;
    std::string crs_wkt;                // may be empty
    std::vector<Attribute> attributes;  // of the batches; those that the format has no field for must not be there
    std::string system_identifier = "strata";
    std::string generating_software = "strata";
    uint16_t creation_day = 0, creation_year = 0;  // day of the year, from 1; arguments, so that files can be reproduced
    bool adjusted_gps_time = true;                 // standard GPS time - 1e9 s; else seconds of the week
    bool overwrite = false;
};

/// Streams points into a LAS 1.4 file: whole under its name after finish(), absent without. Counts and bounds of the header
/// are those of the points written.
/// source  ASPRS, "LAS Specification 1.4 - R15", sections 2.4 (header), 2.5 (VLRs), 2.6 (point records), 3.1 (WKT)
class LasWriter {
public:
    /// expected_points  reserves the room on disk, so that a disk too small is found out first; 0: unknown
    /// throws           Error{usage}: the file exists, or an attribute has no field; Error{unsupported}: the point format;
    ///                  Error{io}: the folder or the disk
    LasWriter(const std::string& path, const LasWriterSettings& settings, uint64_t expected_points = 0);

    /// Appends the points of a batch, whose columns are those of settings.attributes (an empty column: zeros).
    /// throws  Error{io}, naming the path and the byte
    void write(const PointBatch& batch);
    /// Writes the header and gives the file its name. Once, last.
    void finish(Durability durability = Durability::synced);

    uint64_t points() const { return points_; }
    uint64_t size_bytes() const { return file_.size(); }

private:
    struct Field {
        size_t column;      // of the batch
        size_t position;    // byte in the record
        size_t size_bytes;  // of a point
    };

    std::vector<std::byte> header() const;
    void encode_plain(const PointBatch& batch);
    void encode_returns_and_flags(const PointBatch& batch);

    LasWriterSettings settings_;
    size_t record_size_ = 0;
    std::vector<Field> fields_;  // copied as they are
    int return_number_column_ = -1, return_count_column_ = -1, flags_column_ = -1;
    OutputFile file_;
    std::vector<std::byte> records_;  // of the batch at hand
    uint64_t points_ = 0;
    std::array<uint64_t, 15> points_by_return_{};
    std::array<int32_t, 3> least_{}, most_{};  // quanta
};

}  // namespace strata
