#include "core/simulate/scan_cloud.h"

#include <numeric>

#include "core/simulate/waves.h"

namespace strata {
namespace {

constexpr double kGroundLevel = 480.0;  // metres above the sea, of the scene's z = 0

enum Column : size_t { kIntensity, kReturnNumber, kReturnCount, kFlags, kClassification, kScanAngle, kSourceId, kGpsTime, kRgb };

constexpr uint8_t kScanForwardBit = 1 << 6, kLineEdgeBit = 1 << 7;

}  // namespace

Vec3d scan_origin() { return {548'000.0, 5'328'000.0, kGroundLevel}; }

Quantization scan_quantization() { return {.scale = Vec3d::Constant(0.001), .offset = Vec3d(548'000.0, 5'328'000.0, 0.0)}; }

std::string_view scan_crs() {
    return R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],)"
           R"(AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],)"
           R"(AUTHORITY["EPSG","4326"]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],)"
           R"(PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]],)"
           R"(AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG","32632"]])";
}

std::vector<Attribute> scan_attributes() {
    const auto named = [](std::string_view name, ScalarType type, int components = 1) {
        Attribute attribute;
        attribute.name = name;
        attribute.type = type;
        attribute.components = components;
        return attribute;
    };
    return {named(attribute_name::kIntensity, ScalarType::uint16),          named(attribute_name::kReturnNumber, ScalarType::uint8),
            named(attribute_name::kNumberOfReturns, ScalarType::uint8),     named(attribute_name::kClassificationFlags, ScalarType::uint8),
            named(attribute_name::kClassification, ScalarType::uint8),      named(attribute_name::kScanAngle, ScalarType::int16),
            named(attribute_name::kPointSourceId, ScalarType::uint16),      named(attribute_name::kGpsTime, ScalarType::float64),
            named(attribute_name::kRgb, ScalarType::uint16, 3)};
}

void fill_scan_batch(std::span<const ScanPoint> points, PointBatch& batch) {
    static const std::vector<Attribute> attributes = scan_attributes();
    std::vector<int> all(attributes.size());
    std::iota(all.begin(), all.end(), 0);
    resize_batch(batch, points.size(), attributes, all);
    const auto intensity = batch.column<uint16_t>(kIntensity), source = batch.column<uint16_t>(kSourceId), rgb = batch.column<uint16_t>(kRgb);
    const auto number = batch.column<uint8_t>(kReturnNumber), count = batch.column<uint8_t>(kReturnCount);
    const auto flags = batch.column<uint8_t>(kFlags), classification = batch.column<uint8_t>(kClassification);
    const auto angle = batch.column<int16_t>(kScanAngle);
    const auto time = batch.column<double>(kGpsTime);
    const auto quantum = [](double metres) { return int32_t(floor_to_int(metres * 1000.0 + 0.5)); };
    for (size_t i = 0; i < points.size(); ++i) {
        const ScanPoint& p = points[i];
        batch.x[i] = quantum(p.position.x());
        batch.y[i] = quantum(p.position.y());
        batch.z[i] = quantum(p.position.z() + kGroundLevel);
        intensity[i] = p.intensity;
        number[i] = p.return_number;
        count[i] = p.return_count;
        flags[i] = uint8_t((p.scan_forward ? kScanForwardBit : 0) | (p.line_edge ? kLineEdgeBit : 0));
        classification[i] = p.classification;
        angle[i] = p.scan_angle;
        source[i] = p.source_id;
        time[i] = p.gps_time;
        rgb[3 * i] = p.red;
        rgb[3 * i + 1] = p.green;
        rgb[3 * i + 2] = p.blue;
    }
}

}  // namespace strata
