#pragma once

#include <optional>
#include <string>

namespace strata {

/// What is worth saying of a coordinate reference system.
struct CrsDescription {
    std::string id;    // "EPSG:25832", "EPSG:2949+5713"; empty: it has none
    std::string name;  // "ETRS89 / UTM zone 32N", "NAD83(CSRS) / MTM zone 7 + CGVD28 height"
    std::string unit;  // of x and y: "metre", "US survey foot", "degree"
    double unit_meters = 0.0;  // 0: the unit is an angle
    std::string vertical_unit;  // of z; empty: nothing is said of heights
    double vertical_meters = 0.0;
    bool earth_centered = false;  // x, y and z from the center of the earth
};

/// The texts below are what CloudInfo::crs holds: "EPSG:n", "EPSG:h+v", WKT, PROJ strings; a citation means nothing here.
/// Empty results: PROJ cannot read the text, or its database is missing.
std::optional<CrsDescription> describe_crs(const std::string& crs);

/// A few words for messages: "EPSG:25832 ETRS89 / UTM zone 32N", or the beginning of a text that PROJ cannot read.
std::string crs_name(const std::string& crs);

/// Whether the text begins as OGC WKT 1 does.
bool is_wkt1(const std::string& crs);

/// OGC WKT 1, as LAS 1.4 and COPC ask for it. Text that is WKT 1 stays as it is, whether PROJ can read it or not.
std::string wkt1_of_crs(const std::string& crs);

/// throws  Error{usage}: it is no system that PROJ can read; Error{io}: proj.db is missing
void check_crs(const std::string& crs);

/// Whether two texts mean one system, the order of latitude and longitude apart. Equal texts do.
bool same_crs(const std::string& a, const std::string& b);

}  // namespace strata
