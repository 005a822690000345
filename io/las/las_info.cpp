#include "io/las/las_info.h"

#include "io/las/las_crs.h"
#include "io/las/las_header_writer.h"
#include "io/las/las_layout.h"

namespace strata::las {

CloudInfo cloud_info(const ByteSource& source, const Header& header, const Columns& columns, const std::string& container, std::vector<std::string> notes) {
    CloudInfo info;
    info.format = container + " 1." + std::to_string(header.minor_version) + ", point format " + std::to_string(header.point_format);
    info.points = header.points;
    info.bounds = header.bounds;
    info.quantization = header.quantization;
    info.attributes = columns.attributes();
    info.notes = std::move(notes);
    read_crs(source, header, info);
    const PointLayout layout = point_layout(header.point_format);
    if (layout.gps_time) info.adjusted_gps_time = (header.global_encoding & kAdjustedTimeBit) != 0;
    if (layout.wave) info.notes.push_back("wave packets are left out");
    return info;
}

}  // namespace strata::las
