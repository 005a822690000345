#include "io/copc/copc_writer.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/idle_pool.h"
#include "io/copc/copc_hierarchy_writer.h"
#include "io/crs/crs_text.h"
#include "io/las/las_header_writer.h"
#include "io/las/las_record.h"
#include "io/las/laz_encoder.h"

namespace strata {
namespace {

constexpr size_t kInfoBytes = 160;
constexpr size_t kInfoOffset = las::header_bytes(4) + las::kVlrHeaderBytes;  // its record is the first
constexpr uint64_t kLargestVlr = std::numeric_limits<uint16_t>::max();
constexpr uint16_t kWktRecord = 2112;

// Of the point formats of COPC.
constexpr size_t kReturnByte = 14, kTimeByte = 22;

// What a thread encodes with.
struct Encoder {
    std::unique_ptr<las::LazEncoder> laz;
    std::vector<std::byte> packed, records, sorted;
    std::vector<std::pair<double, uint32_t>> times;  // of the points, and their places
    double least_time = std::numeric_limits<double>::infinity(), most_time = -least_time;  // the finite ones of all points it had

    // Brings the records into the order in which they were measured: neighbors in time are neighbors on the ground, returns of one
    // pulse come together, and times make small steps. That takes 15 to 37 % less room than the builder's order by cells.
    void sort_by_time(size_t record_size) {
        times.resize(records.size() / record_size);
        for (size_t i = 0; i < times.size(); ++i) {
            double time;
            std::memcpy(&time, records.data() + i * record_size + kTimeByte, sizeof time);
            times[i] = {std::isnan(time) ? std::numeric_limits<double>::infinity() : time, uint32_t(i)};
        }
        std::sort(times.begin(), times.end());
        const auto is_finite = [](const auto& time) { return std::isfinite(time.first); };
        if (const auto first = std::find_if(times.begin(), times.end(), is_finite); first != times.end()) {
            least_time = std::min(least_time, first->first);
            most_time = std::max(most_time, std::find_if(times.rbegin(), times.rend(), is_finite)->first);
        }
        sorted.resize(records.size());
        for (size_t i = 0; i < times.size(); ++i)
            std::memcpy(sorted.data() + i * record_size, records.data() + times[i].second * record_size, record_size);
        records.swap(sorted);
    }
};

class CopcWriter : public NodeWriter {
public:
    CopcWriter(const std::string& path, const CopcWriteSettings& settings) : settings_(settings), file_(path, settings.overwrite) {}

    void begin(const BuiltCloud& cloud) override {
        cloud_ = cloud;
        wkt_ = wkt1_of_crs(cloud.crs);
        if (wkt_.empty() && !cloud.crs.empty())
            notes_.push_back("the coordinate reference system has no WKT 1, which COPC asks for" +
                             std::string(cloud.crs_records.empty() ? ", and is left out: " : "; its GeoTIFF keys are kept: ") + crs_name(cloud.crs));
        fields_.emplace(las::point_format_for(cloud.attributes, true), cloud.attributes);
        has_time_ = find_attribute(cloud_.attributes, attribute_name::kGpsTime) >= 0;
        const std::vector<std::byte> head = head_bytes({});
        file_.write(head);
        file_.write(std::vector<std::byte>(sizeof(uint64_t)));  // where the chunk table will be
    }

    void encode(std::span<const std::byte> records, uint32_t points, std::vector<std::byte>& out) const override {
        if (points == 0) return;
        std::unique_ptr<Encoder> encoder = encoders_.take(
            [&] { return std::make_unique<Encoder>(Encoder{.laz = las::make_laz_encoder(fields_->point_format(), fields_->record_size())}); });
        if (cloud_.coarsening_bits > 0) records = source_quanta(records, points, encoder->packed);
        encoder->records.resize(size_t(points) * fields_->record_size());
        fields_->encode(records, cloud_.min_quanta, encoder->records);
        if (has_time_) encoder->sort_by_time(fields_->record_size());
        count_returns(encoder->records);
        encoder->laz->encode(encoder->records, out);
        encoders_.give_back(std::move(encoder));
    }

    void append(std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) override {
        const uint64_t begin = file_.size();
        file_.write(bytes);
        for (BuiltNode node : nodes) {
            if (node.points > 0) {
                // The table gives each chunk's place by the sizes of those before it.
                if (node.byte_size > std::numeric_limits<int32_t>::max())
                    throw Error(ErrorKind::limit, file_.path() + ": a node of " + std::to_string(node.byte_size) + " bytes; COPC's pages hold 2^31 - 1");
                if (node.points > uint32_t(std::numeric_limits<int32_t>::max()))  // 2^31 equal ones, which no node can share
                    throw Error(ErrorKind::limit, file_.path() + ": a node of " + std::to_string(node.points) + " points; COPC's pages hold 2^31 - 1");
                assert(begin + node.byte_offset == chunks_end_ || chunks_.empty());
                chunks_end_ = begin + node.byte_offset + node.byte_size;
                chunks_.push_back({node.points, uint32_t(node.byte_size)});
            }
            node.byte_offset += begin;
            nodes_.push_back(node);
        }
    }

    void finish() override {
        find_gps_range();
        const uint64_t table_offset = file_.size();
        file_.write(las::encode_chunk_table(chunks_, true));
        Ending ending{.offset = file_.size()};
        ending.pages = copc::write_hierarchy(std::move(nodes_), ending.offset + las::kEvlrHeaderBytes);
        std::vector<std::byte> record;
        las::append_extended_record_header(record, "copc", 1000, "EPT Hierarchy", ending.pages.bytes.size());
        record.insert(record.end(), ending.pages.bytes.begin(), ending.pages.bytes.end());
        if (wkt_is_extended()) {
            las::append_extended_record_header(record, "LASF_Projection", kWktRecord, "WKT of the coordinate system", wkt_payload().size());
            record.insert(record.end(), wkt_payload().begin(), wkt_payload().end());
        }
        file_.write(record);
        std::vector<std::byte> head = head_bytes(ending);
        head.resize(head.size() + sizeof table_offset);
        std::memcpy(head.data() + head.size() - sizeof table_offset, &table_offset, sizeof table_offset);
        file_.write_at(0, head);
        output_bytes_ = file_.size();
        file_.commit(settings_.durability);
    }

    uint64_t output_bytes() const override { return output_bytes_; }
    std::vector<std::string> notes() const override {
        std::vector<std::string> all = notes_;
        if (fields_) all.insert(all.end(), fields_->notes().begin(), fields_->notes().end());
        return all;
    }

private:
    // What comes behind the points.
    struct Ending {
        uint64_t offset = 0;  // of the first extended record
        copc::HierarchyPages pages;
    };

    void find_gps_range() {
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (const std::unique_ptr<Encoder>& encoder : encoders_.idle()) {
            least = std::min(least, encoder->least_time);
            most = std::max(most, encoder->most_time);
        }
        if (least <= most) gps_range_ = {least, most};
    }

    std::span<const std::byte> wkt_payload() const { return std::as_bytes(std::span(wkt_.c_str(), wkt_.size() + 1)); }  // ends with a zero
    bool wkt_is_extended() const { return wkt_payload().size() > kLargestVlr; }

    std::vector<std::byte> info_payload(const Ending& ending) const {
        const Vec3d corner = cloud_.source_quantization.world_from_quanta(cloud_.min_quanta);
        const double half = 0.5 * cloud_.cube_side;
        const double numbers[] = {corner.x() + half, corner.y() + half, corner.z() + half, half, cloud_.spacing};
        const uint64_t places[] = {ending.pages.root_offset, ending.pages.root_bytes};
        std::vector<std::byte> payload(kInfoBytes);
        std::memcpy(payload.data(), numbers, sizeof numbers);
        std::memcpy(payload.data() + 40, places, sizeof places);
        std::memcpy(payload.data() + 56, gps_range_.data(), sizeof gps_range_);
        return payload;
    }

    bool has_adjusted_time() const { return cloud_.adjusted_gps_time.value_or(las::looks_adjusted(gps_range_[0], gps_range_[1])); }

    // The header block and the records before the points. Its size is the same whatever has been written yet.
    std::vector<std::byte> head_bytes(const Ending& ending) const {
        std::vector<std::byte> records;
        uint32_t count = 0;
        const auto append = [&](std::string_view user_id, uint16_t record_id, std::string_view description, std::span<const std::byte> payload) {
            las::append_record(records, user_id, record_id, description, payload);
            ++count;
        };
        append("copc", 1, "COPC info", info_payload(ending));
        append("laszip encoded", 22204, "LAZ chunks of any size", las::laszip_record(fields_->point_format(), fields_->record_size(), las::kVariableChunks));
        if (const std::vector<std::byte> extra = fields_->extra_bytes_record(cloud_.attribute_min, cloud_.attribute_max); !extra.empty())
            append("LASF_Spec", 4, "extra bytes", extra);
        if (!wkt_.empty() && !wkt_is_extended()) append("LASF_Projection", kWktRecord, "WKT of the coordinate system", wkt_payload());
        if (wkt_.empty())
            for (const CrsRecord& keys : cloud_.crs_records) append("LASF_Projection", keys.id, "GeoTIFF keys", keys.bytes);
        las::HeaderValues values = {
            .global_encoding = uint16_t(las::kWktBit | (has_adjusted_time() ? las::kAdjustedTimeBit : 0)),
            .point_offset = uint32_t(las::header_bytes(4) + records.size()),
            .records = count,
            .point_format = fields_->point_format(),
            .compressed = true,
            .record_size = uint16_t(fields_->record_size()),
            .quantization = cloud_.source_quantization,
            .points = cloud_.points,
            .extended_offset = ending.offset,
            .extended_records = wkt_is_extended() ? 2u : 1u};
        for (size_t axis = 0; axis < 3; ++axis) {
            values.least[axis] = cloud_.min_quanta[Eigen::Index(axis)];
            values.most[axis] = cloud_.max_quanta[Eigen::Index(axis)];
        }
        for (size_t i = 0; i < values.points_by_return.size(); ++i) values.points_by_return[i] = points_by_return_[i + 1];
        std::vector<std::byte> head = las::header_block(values);
        head.insert(head.end(), records.begin(), records.end());
        return head;
    }

    // The source's own quanta, as far as an extent of more than 31 bits left them.
    std::span<const std::byte> source_quanta(std::span<const std::byte> records, uint32_t points, std::vector<std::byte>& out) const {
        out.assign(records.begin(), records.end());
        const size_t size = records.size() / points;
        for (size_t at = 0; at < out.size(); at += size) {
            std::array<uint32_t, 3> quanta;
            std::memcpy(quanta.data(), out.data() + at, sizeof quanta);
            for (size_t axis = 0; axis < 3; ++axis) {
                const int64_t most = int64_t(cloud_.max_quanta[Eigen::Index(axis)]) - cloud_.min_quanta[Eigen::Index(axis)];  // a half was rounded up
                quanta[axis] = uint32_t(std::min(int64_t(quanta[axis]) << cloud_.coarsening_bits, most));
            }
            std::memcpy(out.data() + at, quanta.data(), sizeof quanta);
        }
        return out;
    }

    void count_returns(std::span<const std::byte> records) const {
        std::array<uint64_t, 16> counts{};
        for (size_t at = kReturnByte; at < records.size(); at += fields_->record_size()) ++counts[size_t(records[at] & std::byte(15))];
        for (size_t i = 0; i < counts.size(); ++i)
            if (counts[i] > 0) points_by_return_[i] += counts[i];
    }

    CopcWriteSettings settings_;
    OutputFile file_;
    BuiltCloud cloud_;
    std::vector<std::string> notes_;
    std::optional<las::RecordFields> fields_;
    bool has_time_ = false;
    std::array<double, 2> gps_range_{};
    std::string wkt_;  // empty: nothing is known of the coordinate system, or it has no WKT
    mutable IdlePool<Encoder> encoders_;
    mutable std::array<std::atomic<uint64_t>, 16> points_by_return_{};
    std::vector<las::LazTableEntry> chunks_;  // in the order of the file
    uint64_t chunks_end_ = 0;
    std::vector<BuiltNode> nodes_;
    uint64_t output_bytes_ = 0;
};

}  // namespace

std::unique_ptr<NodeWriter> make_copc_writer(const std::string& path, const CopcWriteSettings& settings) {
    return std::make_unique<CopcWriter>(path, settings);
}

}  // namespace strata
