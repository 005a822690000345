#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/box.h"
#include "core/math/quantization.h"
#include "io/byte_source.h"

namespace strata::las {

/// What a reader makes of a file that is cut short or damaged.
enum class Damage {
    refuse,   // an error
    salvage,  // a line in the notes, and what can be read of the rest
};

/// A variable length record, ordinary or extended: who it is and where its payload lies.
struct VariableRecord {
    std::string user_id;
    uint16_t record_id = 0;
    uint64_t offset = 0;  // of the payload, bytes
    uint64_t size = 0;    // of the payload, bytes
    bool is(std::string_view user, uint16_t record) const { return user_id == user && record_id == record; }
};

/// The header block of a LAS or LAZ file with its list of variable length records, checked against the file's size.
struct Header {
    int minor_version = 0;  // of 1.x
    uint16_t global_encoding = 0;
    int point_format = 0;      // 0 to 10
    bool compressed = false;   // LAZ: the point data is not a list of records
    uint16_t record_size = 0;  // bytes of a point, extra bytes included
    uint64_t points = 0;
    uint64_t stated_points = 0;  // by the file; more than `points` where it is cut short and salvaged
    uint64_t point_offset = 0;   // bytes
    Quantization quantization;
    Box3d bounds;  // as the file states it
    std::vector<uint64_t> points_by_return;  // as the file states it, from return 1 on; 5 or 15 of them
    std::vector<VariableRecord> records;
    std::vector<std::string> notes;
};

/// Reads the header and the places of all records; nothing else of the file. After it, every number in the result is safe
/// to use: the points of an uncompressed file lie within it, and so does each record.
/// throws  Error{malformed, unsupported, io}: file, place, expectation
Header read_header(const ByteSource& source, Damage damage = Damage::refuse);

/// The payload of a record. throws Error{malformed} when it is larger than `most`
std::vector<std::byte> read_record(const ByteSource& source, const VariableRecord& record, uint64_t most);

}  // namespace strata::las
