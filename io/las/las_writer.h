#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "core/cloud/point_source.h"
#include "core/math/quantization.h"
#include "io/las/las_record.h"
#include "io/las/laz_chunk_writer.h"
#include "io/output_file.h"

namespace strata {

struct LasWriterSettings {
    int point_format = 7;     // 0 to 3, 6 to 8
    bool compressed = false;  // LAZ
    Quantization quantization;
    std::vector<CrsRecord> crs_records;  // GeoTIFF keys, for point formats 0 to 3; beside them a WKT needs no LAS 1.4
    std::string crs_wkt;                 // OGC WKT 1; may be empty
    std::vector<Attribute> attributes;   // of the batches; those that the format has no field for become extra bytes
    std::string system_identifier = "strata";
    std::string generating_software = "strata";
    uint16_t creation_day = 0, creation_year = 0;  // day of the year, from 1; arguments, so that files can be reproduced
    /// Standard GPS time - 1e9 s, or seconds of the week; unknown: adjusted, if the times lie beyond a week.
    std::optional<bool> adjusted_gps_time = true;
    int threads = 1;  // that write() may use; the file does not depend on it
    bool overwrite = false;
};

/// Streams points into a LAS or LAZ file: whole under its name after finish(), absent without. Counts and bounds of the header
/// are those of the points written. The version is 1.4, or 1.2 where a point format of 0 to 3 needs nothing newer.
/// source  ASPRS, "LAS Specification 1.4 - R15", sections 2.4 (header), 2.5 (VLRs), 2.6 (point records), 3.1 (WKT)
class LasWriter {
public:
    /// expected_points  reserves the room on disk, so that a disk too small is found out first; 0: unknown
    /// throws           Error{usage, io}: the file exists, the folder or the disk; Error{unsupported}: the point format;
    ///                  Error{limit}: too many points or extra bytes
    LasWriter(const std::string& path, const LasWriterSettings& settings, uint64_t expected_points = 0);

    /// What the file says otherwise than the attributes do; a line each.
    const std::vector<std::string>& notes() const { return fields_.notes(); }

    /// Appends the points of batches, one after the other, whose columns are those of settings.attributes (an empty column:
    /// zeros). Threads share the batches out: several at once are faster.
    /// throws  Error{io}, naming the path and the byte; Error{unsupported}: a value that its field cannot hold
    void write(std::span<const PointBatch> batches);
    void write(const PointBatch& batch) { write(std::span(&batch, 1)); }
    /// Writes the header and gives the file its name. Once, last.
    void finish(Durability durability = Durability::synced);

    size_t record_bytes() const { return fields_.record_size(); }
    uint64_t points() const { return totals_.points; }
    uint64_t size_bytes() const { return file_.size(); }

private:
    // What the header says of the points.
    struct Totals {
        uint64_t points = 0;
        std::array<uint64_t, 15> by_return{};
        std::array<int32_t, 3> least, most;                        // quanta
        double gps_least = 0.0, gps_most = 0.0;                    // from 0 on: a zero says nothing
        std::vector<std::vector<double>> extra_least, extra_most;  // [attribute][component]; NaN: no value

        explicit Totals(const std::vector<Attribute>& attributes);
        void add(const Totals& other);
    };

    Totals measure(const PointBatch& batch, std::span<const std::byte> records) const;
    std::vector<std::byte> header() const;

    LasWriterSettings settings_;
    las::RecordFields fields_;
    bool has_keys_, wkt_is_extended_, has_wkt_;  // what is written of the coordinate system
    int minor_version_;
    OutputFile file_;
    uint64_t point_offset_ = 0, extended_offset_ = 0;  // bytes
    std::optional<las::LazChunkWriter> chunks_;        // where compressed
    std::vector<std::byte> records_;                   // of the batches at hand
    Totals totals_;
};

}  // namespace strata
