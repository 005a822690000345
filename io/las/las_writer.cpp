#include "io/las/las_writer.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/parallel.h"
#include "io/las/las_header_writer.h"
#include "io/las/las_layout.h"

namespace strata {
namespace {

constexpr uint16_t kWktRecord = 2112, kExtraBytesRecord = 4, kLaszipRecord = 22204;
constexpr std::string_view kWktDescription = "WKT of the coordinate system";
constexpr uint64_t kMostOldPoints = std::numeric_limits<uint32_t>::max();  // of LAS 1.0 to 1.3
constexpr size_t kMostRecordBytes = std::numeric_limits<uint16_t>::max();

// The text ends with a zero.
std::span<const std::byte> wkt_payload(const std::string& wkt) { return std::as_bytes(std::span<const char>(wkt.c_str(), wkt.size() + 1)); }

// WKT came with 1.4, as did the point formats from 6 on. Readers of older versions that find it beside GeoTIFF keys take either.
int minor_version_for(int point_format, bool needs_wkt, uint64_t expected_points) {
    return point_format >= 6 || needs_wkt || expected_points > kMostOldPoints ? 4 : 2;
}

double lesser(double a, double b) { return std::isnan(a) || b < a ? b : a; }
double greater(double a, double b) { return std::isnan(a) || b > a ? b : a; }

}  // namespace

LasWriter::Totals::Totals(const std::vector<Attribute>& attributes) {
    least.fill(std::numeric_limits<int32_t>::max());
    most.fill(std::numeric_limits<int32_t>::min());
    for (const Attribute& attribute : attributes)
        extra_least.emplace_back(size_t(attribute.components), std::numeric_limits<double>::quiet_NaN());
    extra_most = extra_least;
}

void LasWriter::Totals::add(const Totals& other) {
    points += other.points;
    for (size_t i = 0; i < by_return.size(); ++i) by_return[i] += other.by_return[i];
    for (size_t axis = 0; axis < 3; ++axis) {
        least[axis] = std::min(least[axis], other.least[axis]);
        most[axis] = std::max(most[axis], other.most[axis]);
    }
    gps_least = std::min(gps_least, other.gps_least);
    gps_most = std::max(gps_most, other.gps_most);
    for (size_t a = 0; a < extra_least.size(); ++a)
        for (size_t c = 0; c < extra_least[a].size(); ++c) {
            extra_least[a][c] = lesser(extra_least[a][c], other.extra_least[a][c]);
            extra_most[a][c] = greater(extra_most[a][c], other.extra_most[a][c]);
        }
}

LasWriter::LasWriter(const std::string& path, const LasWriterSettings& settings, uint64_t expected_points)
    : settings_(settings),
      fields_(settings.point_format, settings.attributes),
      has_keys_(settings.point_format < 6 && !settings.crs_records.empty()),
      wkt_is_extended_(settings.crs_wkt.size() + 1 > kMostRecordBytes),
      has_wkt_(!settings.crs_wkt.empty() && !(has_keys_ && wkt_is_extended_)),
      minor_version_(minor_version_for(settings.point_format, has_wkt_ && !has_keys_, expected_points)),
      file_(path, settings.overwrite),
      totals_(settings.attributes) {
    const std::vector<std::byte> head = header();
    point_offset_ = head.size();
    if (expected_points > (std::numeric_limits<uint64_t>::max() >> 1) / fields_.record_size())
        throw Error(ErrorKind::limit, path + ": " + std::to_string(expected_points) + " points do not fit into any file");
    if (expected_points > 0 && !settings_.compressed) file_.reserve(head.size() + expected_points * fields_.record_size());
    file_.write(head);
    if (settings_.compressed) chunks_.emplace(file_, settings_.point_format, fields_.record_size(), settings_.threads);
}

std::vector<std::byte> LasWriter::header() const {
    std::vector<std::byte> records;
    uint32_t count = 0;
    const auto append = [&](std::string_view user, uint16_t id, std::string_view description, std::span<const std::byte> payload) {
        las::append_record(records, user, id, description, payload);
        ++count;
    };
    if (has_keys_)
        for (const CrsRecord& record : settings_.crs_records) append("LASF_Projection", record.id, "GeoTIFF keys", record.bytes);
    if (has_wkt_ && !wkt_is_extended_) append("LASF_Projection", kWktRecord, kWktDescription, wkt_payload(settings_.crs_wkt));
    const std::vector<std::byte> extra = fields_.extra_bytes_record(totals_.extra_least, totals_.extra_most);
    if (!extra.empty()) append("LASF_Spec", kExtraBytesRecord, "extra bytes", extra);
    if (settings_.compressed)
        append("laszip encoded", kLaszipRecord, "by strata",
               las::laszip_record(settings_.point_format, fields_.record_size(), las::LazChunkWriter::kChunkPoints));

    // The WKT bit must be set for point formats from 6 on, with or without a WKT (section 2.4, global encoding).
    const bool wkt_bit = (has_wkt_ && minor_version_ == 4) || settings_.point_format >= 6;
    const bool adjusted_bit = settings_.adjusted_gps_time.value_or(las::looks_adjusted(totals_.gps_least, totals_.gps_most));
    const las::HeaderValues values = {
        .minor_version = minor_version_,
        .global_encoding = uint16_t((wkt_bit ? las::kWktBit : 0) | (adjusted_bit ? las::kAdjustedTimeBit : 0)),
        .system_identifier = settings_.system_identifier,
        .generating_software = settings_.generating_software,
        .creation_day = settings_.creation_day,
        .creation_year = settings_.creation_year,
        .point_offset = uint32_t(las::header_bytes(minor_version_) + records.size()),
        .records = count,
        .point_format = settings_.point_format,
        .compressed = settings_.compressed,
        .record_size = uint16_t(fields_.record_size()),
        .quantization = settings_.quantization,
        .points = totals_.points,
        .points_by_return = totals_.by_return,
        .least = totals_.least,
        .most = totals_.most,
        .extended_offset = extended_offset_,
        .extended_records = extended_offset_ > 0 ? 1u : 0u};
    std::vector<std::byte> bytes = las::header_block(values);
    bytes.insert(bytes.end(), records.begin(), records.end());
    return bytes;
}

LasWriter::Totals LasWriter::measure(const PointBatch& batch, std::span<const std::byte> records) const {
    Totals totals(settings_.attributes);
    totals.points = batch.size;
    const std::array<const std::vector<int32_t>*, 3> axes = {&batch.x, &batch.y, &batch.z};
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto [least, most] = std::minmax_element(axes[axis]->begin(), axes[axis]->begin() + ptrdiff_t(batch.size));
        totals.least[axis] = *least;
        totals.most[axis] = *most;
    }
    const las::PointLayout layout = las::point_layout(settings_.point_format);
    const uint8_t return_bits = layout.extended ? 15 : 7;
    std::array<uint64_t, 16> by_return{};
    for (size_t at = 0; at < records.size(); at += fields_.record_size()) {
        ++by_return[uint8_t(records[at + 14]) & return_bits];
        if (layout.gps_time == 0 || settings_.adjusted_gps_time) continue;
        const double time = load_scalar(ScalarType::float64, records.data() + at + layout.gps_time);
        totals.gps_least = std::min(totals.gps_least, time);
        totals.gps_most = std::max(totals.gps_most, time);
    }
    std::copy(by_return.begin() + 1, by_return.end(), totals.by_return.begin());
    for (const size_t a : fields_.extra_attributes()) {
        const Attribute& attribute = settings_.attributes[a];
        const size_t size = scalar_size(attribute.type), components = size_t(attribute.components);
        const std::vector<std::byte>& column = batch.columns[a];
        for (size_t i = 0; i * size < column.size(); ++i) {
            const double value = load_scalar(attribute.type, column.data() + i * size);
            if (std::isnan(value) || value == attribute.no_data) continue;
            totals.extra_least[a][i % components] = lesser(totals.extra_least[a][i % components], value);
            totals.extra_most[a][i % components] = greater(totals.extra_most[a][i % components], value);
        }
    }
    return totals;
}

void LasWriter::write(std::span<const PointBatch> batches) {
    const size_t record_size = fields_.record_size();
    std::vector<size_t> first = {0};
    for (const PointBatch& batch : batches) first.push_back(first.back() + batch.size * record_size);
    if (first.back() == 0) return;
    if (minor_version_ < 4 && totals_.points + first.back() / record_size > kMostOldPoints)
        throw Error(ErrorKind::limit,
                    file_.path() + ": LAS 1.2 holds " + std::to_string(kMostOldPoints) + " points, and there are more than were expected");
    records_.resize(first.back());
    const uint64_t begin = point_offset_ + totals_.points * record_size;  // where not compressed
    std::vector<Totals> totals(batches.size(), Totals({}));
    parallel_blocks(settings_.threads, batches.size(), 1, [&](size_t from, size_t to) {
        for (size_t i = from; i < to; ++i) {
            if (batches[i].size == 0) continue;
            const std::span<std::byte> records = std::span(records_).subspan(first[i], first[i + 1] - first[i]);
            fields_.encode(batches[i], 0, records);
            totals[i] = measure(batches[i], records);
            if (!chunks_) file_.write_at(begin + first[i], records);
        }
    });
    for (size_t i = 0; i < batches.size(); ++i)
        if (batches[i].size > 0) totals_.add(totals[i]);
    if (chunks_) chunks_->write(records_);
}

void LasWriter::finish(Durability durability) {
    if (chunks_) chunks_->finish();
    if (has_wkt_ && wkt_is_extended_) {
        extended_offset_ = file_.size();
        std::vector<std::byte> record;
        const std::span<const std::byte> payload = wkt_payload(settings_.crs_wkt);
        las::append_extended_record_header(record, "LASF_Projection", kWktRecord, kWktDescription, payload.size());
        record.insert(record.end(), payload.begin(), payload.end());
        file_.write(record);
    }
    file_.write_at(0, header());
    file_.commit(durability);
}

}  // namespace strata
