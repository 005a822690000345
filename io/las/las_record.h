#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "core/math/vec.h"

namespace strata::las {

/// The point format that holds these attributes with the least loss.
/// extended  only 6, 7 (color) or 8 (near infrared); else attributes that came from formats 0 to 5, which a scan angle rank
///           tells, stay in 0 to 3
int point_format_for(const std::vector<Attribute>& attributes, bool extended);

struct RecordField;

/// Puts `count` values that lie `stride` bytes apart into the same field of as many records, which are zeros there.
/// throws  Error{unsupported}: a value that the field cannot hold
using CopyField = void (*)(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records,
                           size_t record_size);

/// How one attribute gets into the records.
struct RecordField {
    std::string name;
    int point_format = 0;
    CopyField copy = nullptr;
    size_t record_offset = 0;  // bytes
    ScalarType type = ScalarType::uint8;
    int components = 1;
    ScalarType stored = ScalarType::uint8;    // of the attribute; converted first where it is not `type`
    size_t attribute = 0, packed_offset = 0;  // its index, and the byte of a packed record

    size_t size_bytes() const { return scalar_size(type) * size_t(components); }
    size_t stored_bytes() const { return scalar_size(stored) * size_t(components); }
};

/// How the attributes of a cloud become point records: the inverse of Columns. What the format has no field for becomes
/// extra bytes. Attributes of formats 0 to 5 are promoted where the format is 6 or later: scan angles of whole degrees
/// become steps of 0.006, and class 12 becomes class 1 with the overlap flag.
/// source  LAS 1.4 R15, section 2.6 (records), tables 9 and 17 (classes), table 24 (extra bytes)
class RecordFields {
public:
    /// throws  Error{limit}: a record, or the description of its extra bytes, would be longer than 65535 bytes
    RecordFields(int point_format, const std::vector<Attribute>& attributes);

    int point_format() const { return point_format_; }
    /// Bytes of a record, extra bytes included.
    size_t record_size() const { return record_size_; }
    /// What the records say otherwise than the attributes do; a line each.
    const std::vector<std::string>& notes() const { return notes_; }
    /// Indices of the attributes that become extra bytes, in the order of the record.
    const std::vector<size_t>& extra_attributes() const { return extra_attributes_; }
    /// The payload of LASF_Spec 4, 192 bytes an entry; empty where there are no extra bytes. An attribute of several components
    /// takes an entry each, name[0], name[1], ...: arrays are deprecated, and read_extra_bytes joins these.
    /// least, most  [attribute][component] stored values of the points; empty, NaN or least > most: not said
    std::vector<std::byte> extra_bytes_record(std::span<const std::vector<double>> least = {},
                                              std::span<const std::vector<double>> most = {}) const;

    /// Columns to records. The batch holds the attributes given to the constructor; an empty column stands for zeros.
    /// first    row of the batch that the first record is made of
    /// records  [count * record_size()]
    /// throws   Error{unsupported}: a value that its field cannot hold, such as return number 16
    void encode(const PointBatch& batch, size_t first, std::span<std::byte> records) const;
    /// The same from packed records, such as the octree builder's: int32 x, y, z, then the attributes in order.
    /// packed  [count * (12 + bytes of all attributes)]
    /// shift   added to the positions, modulo 2^32
    void encode(std::span<const std::byte> packed, const Vec3i& shift, std::span<std::byte> records) const;

private:
    struct ExtraEntry {
        std::string name;
        size_t attribute;
        int component;
        uint8_t data_type, options;
    };

    void add_extra(const Attribute& attribute, RecordField field);
    void begin_records(std::byte* records, size_t count) const;
    void put(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records) const;

    int point_format_;
    size_t record_size_ = 0, packed_size_ = 0;
    uint8_t returns_ = 0;  // the byte of returns, as far as no attribute says it
    std::vector<Attribute> attributes_;
    std::vector<RecordField> fields_;
    std::vector<size_t> extra_attributes_;
    std::vector<ExtraEntry> entries_;
    std::vector<std::string> notes_;
};

}  // namespace strata::las
