#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "core/math/box.h"
#include "core/math/quantization.h"

namespace strata {

/// A record of GeoTIFF keys as a LAS file holds it: 34735 the keys, 34736 their numbers, 34737 their texts.
struct CrsRecord {
    uint16_t id = 0;
    std::vector<std::byte> bytes;

    bool operator==(const CrsRecord&) const = default;
};

/// What a cloud says of itself.
struct CloudInfo {
    std::string format;  // "las 1.2, point format 3"; "potree 2.0, DEFAULT"
    uint64_t points = 0;
    Box3d bounds;  // world; as the header states it, so it may lie
    Quantization quantization;
    double worst_rounding = 0.0;  // world units, an axis: how far bringing several files to one quantization moves points
    std::vector<Attribute> attributes;
    std::vector<std::vector<double>> attribute_min, attribute_max;  // [attribute][component] stored values, as stated; empty: unknown
    std::string crs;  // WKT, "EPSG:n" or "EPSG:h+v", or only a name where GeoTIFF keys could not be translated; empty: unknown
    std::vector<CrsRecord> crs_records;  // where the file has GeoTIFF keys: what a LAS writer keeps of what `crs` cannot say
    std::optional<bool> adjusted_gps_time;  // GPS times are standard GPS time - 1e9 s, else seconds of the week; unknown: not said
    std::vector<std::string> notes;  // what the reader left out or found odd but not wrong; a line each
};

/// Points of any file, readable in batches in any order. The format's reader implements it in io.
class PointSource {
public:
    virtual ~PointSource() = default;

    virtual const CloudInfo& info() const = 0;
    virtual uint64_t batch_count() const = 0;

    /// Reads batch `index` < batch_count(). Safe to call from several threads at once, each with its own `out`.
    /// wanted  indices into info().attributes; positions always come
    /// throws  Error{malformed, io}, naming the file and the place
    virtual void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const = 0;

    /// Reads the first points of a batch, at most `most`; fewer, or none, where they cannot be reached without what lies before them.
    /// Formats that can do it for less than the whole batch do.
    virtual void read_first(uint64_t index, uint64_t most, std::span<const int> wanted, PointBatch& out) const;
};

}  // namespace strata
