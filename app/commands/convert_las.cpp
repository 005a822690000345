// What strata convert does for plain LAS and LAZ: the points in the order of the inputs, a few batches at a time.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "app/commands/convert_output.h"
#include "core/cloud/point_rounds.h"
#include "core/error.h"
#include "io/crs/crs_text.h"
#include "io/las/las_record.h"
#include "io/las/las_writer.h"

namespace strata {
namespace {

// A quarter of --memory is for what the readers need beside the points themselves.
uint64_t round_points(const ConvertRequest& request, const CloudInfo& info, size_t record_bytes) {
    uint64_t column_bytes = 12;
    for (const Attribute& attribute : info.attributes) column_bytes += attribute.size_bytes();
    const uint64_t encoded_bytes = 2 * record_bytes;  // the records, and what becomes of them at worst
    return points_of_round(request.threads, request.memory_bytes / 4 * 3, column_bytes + encoded_bytes);
}

class LasOutput : public ConvertOutput {
public:
    explicit LasOutput(const ConvertRequest& request) : request_(request) { check_output_path(request.output, request.overwrite); }

    ConvertReport write(const PointSource& source, ProgressLine& progress, nlohmann::ordered_json& json) override {
        const CloudInfo& info = source.info();
        const int point_format = las::point_format_for(info.attributes, false);
        ConvertReport report{.worst_rounding = info.worst_rounding};
        // As it is where it is the WKT 1 that LAS asks for; else in PROJ's words, unless keys say it.
        const bool keeps_keys = point_format < 6 && !info.crs_records.empty();
        const std::string wkt = is_wkt1(info.crs) ? info.crs : keeps_keys ? std::string() : wkt1_of_crs(info.crs);
        if (wkt.empty() && !keeps_keys) {
            if (!info.crs.empty())
                report.notes.push_back("the coordinate reference system has no WKT and is left out: " + crs_name(info.crs));
            else if (!info.crs_records.empty())
                report.notes.push_back("the GeoTIFF keys say no system that has a WKT, which point format " + std::to_string(point_format) +
                                       " asks for, and are left out");
        }
        LasWriter writer(request_.output,
                         {.point_format = point_format,
                          .compressed = request_.format == "laz",
                          .quantization = info.quantization,
                          .crs_records = info.crs_records,
                          .crs_wkt = wkt,
                          .attributes = info.attributes,
                          .generating_software = "strata convert",
                          .adjusted_gps_time = info.adjusted_gps_time,
                          .threads = request_.threads,
                          .overwrite = request_.overwrite},
                         info.points);
        report.notes.insert(report.notes.end(), writer.notes().begin(), writer.notes().end());
        read_in_rounds(source, request_.threads, round_points(request_, info, writer.record_bytes()),
                       [&](std::span<const PointBatch> batches) {
                           writer.write(batches);
                           progress.update("writing", writer.points(), info.points);
                       });
        writer.finish(request_.durability);
        json["point_format"] = point_format;
        report.points_read = report.points_written = writer.points();
        report.output_bytes = writer.size_bytes();
        report.shape = "in point format " + std::to_string(point_format);
        return report;
    }

private:
    ConvertRequest request_;
};

}  // namespace

std::unique_ptr<ConvertOutput> make_las_output(const ConvertRequest& request, const Options& options) {
    for (const char* const flag : {"--encoding", "--quality", "--normals", "--viewpoint", "--density"})
        if (options.given(flag))
            throw Error(ErrorKind::usage, std::string(flag) + ": is not for " + request.format + ", whose points stay as they are");
    return std::make_unique<LasOutput>(request);
}

}  // namespace strata
