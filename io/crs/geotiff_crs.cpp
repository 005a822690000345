#include "io/crs/geotiff_crs.h"

#include <geotiff/geo_normalize.h>
#include <geotiff/geo_simpletags.h>
#include <proj.h>
#include <proj_experimental.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>

#include "io/crs/proj_objects.h"

namespace strata {
namespace {

// OGC GeoTIFF 1.1, annex B.
enum Key : uint16_t {
    kModelType = 1024, kCitation = 1026,
    kGeodeticCrs = 2048, kGeodeticCitation = 2049, kAngularUnit = 2054, kTowgs84 = 2062,
    kProjectedCrs = 3072, kProjectedCitation = 3073, kProjection = 3074, kMethod = 3075, kLinearUnit = 3076,
    kStandardParallel1 = 3078, kStandardParallel2 = 3079, kOriginLongitude = 3080, kOriginLatitude = 3081, kFalseEasting = 3082,
    kFalseNorthing = 3083, kFalseOriginLongitude = 3084, kFalseOriginLatitude = 3085, kCenterLongitude = 3088, kCenterLatitude = 3089,
    kScaleAtOrigin = 3092, kScaleAtCenter = 3093, kAzimuth = 3094, kPoleLongitude = 3095, kRectifiedAngle = 3096,
    kVerticalCrs = 4096, kVerticalCitation = 4097, kVerticalUnit = 4099,
};
constexpr uint16_t kDirectoryTag = 34735, kDoublesTag = 34736, kTextsTag = 34737;
constexpr uint16_t kUserDefined = 32767;
constexpr uint16_t kGeographicModel = 2;

// What libgeotiff is given: keys of these numbers, each with one value of its type in its place.
constexpr std::array<uint16_t, 13> kCodeKeys = {1024, 1025, 2048, 2050, 2051, 2052, 2054, 2056, 2060, 3072, 3074, 3075, 3076};
bool is_number_key(uint16_t id) { return id == 2055 || (id >= 2057 && id <= 2059) || id == 2061 || (id >= 3077 && id <= 3096); }
constexpr double kGreatestNumber = 1e9;  // of a parameter: degrees, meters, feet

struct GeoKey {
    uint16_t id, location, count, value;
};

std::vector<GeoKey> parse_keys(ByteReader reader) {
    reader.skip(6);  // versions of the directory
    const uint16_t count = reader.read<uint16_t>();
    if (count > reader.left() / sizeof(GeoKey))
        reader.fail(std::to_string(count) + " GeoTIFF keys, there is room for " + std::to_string(reader.left() / sizeof(GeoKey)));
    std::vector<GeoKey> keys(count);
    for (GeoKey& key : keys)
        key = {reader.read<uint16_t>(), reader.read<uint16_t>(), reader.read<uint16_t>(), reader.read<uint16_t>()};
    return keys;
}

// The keys of one file, by number. The first of a number counts.
class GeoKeys {
public:
    GeoKeys(std::vector<GeoKey> keys, std::span<const std::byte> doubles, std::span<const std::byte> texts)
        : keys_(std::move(keys)), texts_(texts), doubles_(doubles.size() / sizeof(double)) {
        if (!doubles_.empty()) std::memcpy(doubles_.data(), doubles.data(), doubles_.size() * sizeof(double));
    }

    const std::vector<GeoKey>& all() const { return keys_; }
    const std::vector<double>& doubles() const { return doubles_; }

    const GeoKey* find(uint16_t id) const {
        const auto found = std::find_if(keys_.begin(), keys_.end(), [&](const GeoKey& key) { return key.id == id; });
        return found == keys_.end() ? nullptr : &*found;
    }
    // 0: the key is not there, or says "undefined".
    uint16_t code(uint16_t id) const {
        const GeoKey* const key = find(id);
        return key && key->location == 0 ? key->value : uint16_t{0};
    }
    std::vector<double> numbers(uint16_t id) const {
        const GeoKey* const key = find(id);
        if (!key || !holds_numbers(*key)) return {};
        return {doubles_.begin() + key->value, doubles_.begin() + key->value + key->count};
    }
    bool holds_numbers(const GeoKey& key) const {
        return key.location == kDoublesTag && key.value <= doubles_.size() && key.count <= doubles_.size() - key.value;
    }
    // A name without the '|' that ends it, and without what only stands for one.
    std::string text(uint16_t id) const {
        const GeoKey* const key = find(id);
        if (!key || key->location != kTextsTag || key->value > texts_.size() || key->count > texts_.size() - key->value) return {};
        std::string text = text_before_nul(texts_.subspan(key->value, key->count));
        while (!text.empty() && (text.back() == '|' || text.back() == ' ' || text.back() == '\n' || text.back() == '\r')) text.pop_back();
        const bool says = std::any_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
        return says ? text : std::string();
    }
    std::string citation() const {
        for (const uint16_t id : {kProjectedCitation, kCitation, kGeodeticCitation})
            if (std::string name = text(id); !name.empty()) return name;
        return {};
    }

private:
    std::vector<GeoKey> keys_;
    std::span<const std::byte> texts_;
    std::vector<double> doubles_;
};

std::string epsg(uint16_t code) { return "EPSG:" + std::to_string(code); }

ProjObject crs_of_code(const ProjContext& context, uint16_t code) {
    return ProjObject(proj_create_from_database(context.get(), "EPSG", std::to_string(code).c_str(), PJ_CATEGORY_CRS, 0, nullptr));
}

struct Unit {
    std::string name;
    double factor;  // meters or radians
};

// kind  "linear" or "angular"
std::optional<Unit> unit_of_code(const ProjContext& context, uint16_t code, const char* kind) {
    const char *name = nullptr, *category = nullptr;
    double factor = 0.0;
    if (code == 0 || code == kUserDefined ||
        !proj_uom_get_info_from_database(context.get(), "EPSG", std::to_string(code).c_str(), &name, &factor, &category) ||
        std::strcmp(category, kind) != 0)
        return std::nullopt;
    return Unit{name, factor};
}

// Meters in a unit of the first axis; 0: it is no length.
double axis_meters(const ProjContext& context, const PJ* crs) {
    const ProjObject system(proj_crs_get_coordinate_system(context.get(), crs));
    double factor = 0.0;
    const char* unit_code = nullptr;
    if (!system || !proj_cs_get_axis_info(context.get(), system.get(), 0, nullptr, nullptr, nullptr, &factor, nullptr, nullptr, &unit_code))
        return 0.0;
    return factor;
}

ProjObject with_unit(const ProjContext& context, const PJ* crs, const Unit& unit, uint16_t code) {
    return ProjObject(
        proj_crs_alter_cs_linear_unit(context.get(), crs, unit.name.c_str(), unit.factor, "EPSG", std::to_string(code).c_str()));
}

// The keys as libgeotiff normalizes them: defaults, synonyms and lengths in meters are its business.
std::optional<GTIFDefn> normalized(const ProjContext& context, const GeoKeys& keys) {
    std::vector<uint16_t> directory = {1, 1, 0, 0};
    std::vector<double> doubles;
    std::vector<uint16_t> seen;
    for (const GeoKey& key : keys.all()) {
        if (std::find(seen.begin(), seen.end(), key.id) != seen.end()) continue;
        const bool is_code = std::find(kCodeKeys.begin(), kCodeKeys.end(), key.id) != kCodeKeys.end() && key.location == 0 && key.count == 1;
        const bool is_number = is_number_key(key.id) && keys.holds_numbers(key) && key.count == 1;
        if (!is_code && !is_number) continue;
        seen.push_back(key.id);
        if (is_code) {
            directory.insert(directory.end(), {key.id, 0, 1, key.value});
            continue;
        }
        const double number = keys.doubles()[key.value];
        if (!(std::abs(number) <= kGreatestNumber)) return std::nullopt;
        directory.insert(directory.end(), {key.id, kDoublesTag, 1, uint16_t(doubles.size())});
        doubles.push_back(number);
    }
    const uint16_t angle = keys.code(kAngularUnit);  // libgeotiff asks for it in a way that prints
    if (seen.empty() || (angle != 0 && angle != kUserDefined && !unit_of_code(context, angle, "angular"))) return std::nullopt;
    directory[3] = uint16_t(seen.size());

    const std::unique_ptr<ST_TIFF, void (*)(ST_TIFF*)> tags(ST_Create(), ST_Destroy);
    ST_SetKey(tags.get(), kDirectoryTag, int(directory.size()), STT_SHORT, directory.data());
    if (!doubles.empty()) ST_SetKey(tags.get(), kDoublesTag, int(doubles.size()), STT_DOUBLE, doubles.data());
    const std::unique_ptr<GTIF, void (*)(GTIF*)> gtif(GTIFNewSimpleTags(tags.get()), GTIFFree);
    if (!gtif) return std::nullopt;
    GTIFAttachPROJContext(gtif.get(), context.get());
    GTIFDefn definition;
    if (!GTIFGetDefn(gtif.get(), &definition)) return std::nullopt;
    return definition;
}

std::string parameter(const char* name, double value) {
    char text[64];
    std::snprintf(text, sizeof text, " +%s=%.15g", name, value);
    return text;
}

// A projection method of GeoTIFF in PROJ's words: what names each parameter there.
struct Method {
    int code;
    const char* projection;
    const char* parameters;  // with blanks between; "lat_1=lat_0": takes the value of another
};
constexpr Method kMethods[] = {
    {1, "tmerc", "lat_0 lon_0 k"},
    {3, "omerc +no_uoff", "lat_0 lonc k alpha gamma"},
    {7, "merc", "lon_0"},
    {8, "lcc", "lat_1 lat_2 lat_0 lon_0"},
    {9, "lcc", "lat_1=lat_0 lat_0 lon_0 k"},
    {10, "laea", "lat_0 lon_0"},
    {11, "aea", "lat_1 lat_2 lat_0 lon_0"},
    {16, "sterea", "lat_0 lon_0 k"},
    {18, "cass", "lat_0 lon_0"},
    {22, "poly", "lat_0 lon_0"},
    {27, "tmerc +axis=wsu", "lat_0 lon_0 k"},
    {9815, "omerc", "lat_0 lonc k alpha gamma"},
};

// Under which keys libgeotiff has the value of a parameter.
std::optional<double> parameter_value(const GTIFDefn& definition, std::string_view name) {
    struct Names {
        std::string_view name;
        std::array<int, 4> ids;
    };
    constexpr Names kNames[] = {
        {"lat_0", {kOriginLatitude, kFalseOriginLatitude, kCenterLatitude, -1}},
        {"lon_0", {kOriginLongitude, kFalseOriginLongitude, kCenterLongitude, kPoleLongitude}},
        {"lonc", {kCenterLongitude, kOriginLongitude, -1, -1}},
        {"lat_1", {kStandardParallel1, -1, -1, -1}},
        {"lat_2", {kStandardParallel2, -1, -1, -1}},
        {"k", {kScaleAtOrigin, kScaleAtCenter, -1, -1}},
        {"alpha", {kAzimuth, -1, -1, -1}},
        {"gamma", {kRectifiedAngle, -1, -1, -1}},
        {"x_0", {kFalseEasting, 3086, 3090, -1}},
        {"y_0", {kFalseNorthing, 3087, 3091, -1}},
    };
    for (const Names& names : kNames) {
        if (names.name != name) continue;
        for (int i = 0; i < definition.nParms; ++i)
            if (std::find(names.ids.begin(), names.ids.end(), definition.ProjParmId[i]) != names.ids.end()) return definition.ProjParm[i];
    }
    return std::nullopt;
}

// "+proj=lcc +lat_1=..." of the projection alone, in degrees and meters; empty: there is no such method, or a parameter is missing.
std::string projection_text(const GTIFDefn& definition) {
    const Method* const method = std::find_if(std::begin(kMethods), std::end(kMethods), [&](const Method& m) { return m.code == definition.CTProjection; });
    if (method == std::end(kMethods)) return {};
    std::string text = std::string("+proj=") + method->projection;
    const std::string_view parameters = method->parameters;
    for (size_t begin = 0; begin < parameters.size();) {
        const size_t end = std::min(parameters.find(' ', begin), parameters.size());
        const std::string word(parameters.substr(begin, end - begin));
        begin = end + 1;
        const size_t equals = word.find('=');
        const std::optional<double> value = parameter_value(definition, equals == std::string::npos ? word : word.substr(equals + 1));
        if (!value) return {};
        text += parameter(word.substr(0, equals).c_str(), *value);
    }
    if (method->code == 7) {  // a Mercator is scaled at the equator, or by the parallel that is true
        const std::optional<double> parallel = parameter_value(definition, "lat_1"), scale = parameter_value(definition, "k");
        if (const std::optional<double> latitude = parameter_value(definition, "lat_0"); latitude && *latitude != 0.0) return {};
        text += parallel ? parameter("lat_ts", *parallel) : parameter("k", scale.value_or(1.0));
    }
    return text + parameter("x_0", parameter_value(definition, "x_0").value_or(0.0)) + parameter("y_0", parameter_value(definition, "y_0").value_or(0.0));
}

// The base system where the keys name a known one: its own code, or that of its datum (EPSG numbers these 2000 apart).
ProjObject known_base(const ProjContext& context, const GTIFDefn& definition) {
    const auto is_geographic = [](const ProjObject& crs) { return crs && proj_get_type(crs.get()) == PJ_TYPE_GEOGRAPHIC_2D_CRS; };
    if (definition.GCS > 0 && definition.GCS != kUserDefined)
        if (ProjObject base = crs_of_code(context, uint16_t(definition.GCS)); is_geographic(base)) return base;
    if (definition.Datum < 6001 || definition.Datum > 6999) return nullptr;
    ProjObject base = crs_of_code(context, uint16_t(definition.Datum - 2000));
    if (!is_geographic(base)) return nullptr;
    ProjObject datum(proj_crs_get_datum(context.get(), base.get()));
    if (!datum) datum.reset(proj_crs_get_datum_ensemble(context.get(), base.get()));
    const char* const code = datum ? proj_get_id_code(datum.get(), 0) : nullptr;
    return code && std::to_string(definition.Datum) == code ? std::move(base) : nullptr;
}

// The ellipsoid, the meridian and the shift to WGS 84 in PROJ's words; empty: they are no numbers of an ellipsoid.
std::string figure_text(const GTIFDefn& definition, const std::vector<double>& towgs84) {
    const double a = definition.SemiMajor, b = definition.SemiMinor;
    if (!(a > 1.0 && a <= kGreatestNumber && b > 0.5 * a && b <= a)) return {};
    std::string text = parameter("a", a);
    if (b == a) {
        text += parameter("b", b);
    } else {
        char flattening[64];  // twelve digits: the rest is what the division by 1 - 1/f left of it
        std::snprintf(flattening, sizeof flattening, " +rf=%.12g", a / (a - b));
        text += flattening;
    }
    if (definition.PMLongToGreenwich != 0.0) text += parameter("pm", definition.PMLongToGreenwich);
    const bool shifts = std::any_of(towgs84.begin(), towgs84.end(), [](double value) { return value != 0.0; });
    if (!shifts || (towgs84.size() != 3 && towgs84.size() != 7)) return text;
    text += " +towgs84=";
    for (size_t i = 0; i < towgs84.size(); ++i) {
        if (!(std::abs(towgs84[i]) <= kGreatestNumber)) return {};
        char number[32];
        std::snprintf(number, sizeof number, "%s%.15g", i ? "," : "", towgs84[i]);
        text += number;
    }
    return text;
}

// The system whose projection or datum is described by parameters. null: cannot be translated
ProjObject crs_of_parameters(const ProjContext& context, const GeoKeys& keys, bool projected) {
    if (!context.has_database()) return nullptr;  // libgeotiff would take what it does not know for meters
    const uint16_t unit_code = keys.code(kLinearUnit);
    const std::optional<Unit> unit = unit_of_code(context, unit_code, "linear");
    if (projected && unit_code != 0 && unit_code != kUserDefined && !unit) return nullptr;
    const std::optional<GTIFDefn> definition = normalized(context, keys);
    // Angles in grads come differently from different versions of libgeotiff.
    if (!definition || (projected && definition->UOMAngleInDegrees != 1.0)) return nullptr;
    ProjObject base = known_base(context, *definition);
    if (!projected && base) return base;
    const std::string projection = projected ? projection_text(*definition) : "+proj=longlat";
    std::string figure = base ? " +ellps=GRS80" : figure_text(*definition, keys.numbers(kTowgs84));
    if (projection.empty() || figure.empty()) return nullptr;
    ProjObject crs = crs_object(context, projection + figure + " +no_defs");
    if (crs && base) crs.reset(proj_crs_alter_geodetic_crs(context.get(), crs.get(), base.get()));
    if (crs && projected && definition->UOMLengthInMeters != 1.0) {
        if (unit)
            crs = with_unit(context, crs.get(), *unit, unit_code);
        else if (definition->UOMLengthInMeters > 0.0)
            crs.reset(proj_crs_alter_cs_linear_unit(context.get(), crs.get(), "unknown", definition->UOMLengthInMeters, nullptr, nullptr));
        else
            return nullptr;
    }
    const std::string name = projected ? keys.citation() : keys.text(kGeodeticCitation);
    if (crs && !name.empty())
        if (ProjObject named(proj_alter_name(context.get(), crs.get(), name.c_str())); named) crs = std::move(named);
    return crs;
}

// GeoTIFF 1.0 had numbers of its own for heights: those of datums, and of ellipsoids.
uint16_t vertical_code(const GeoKeys& keys) {
    const uint16_t code = keys.code(kVerticalCrs);
    if (code >= 5101 && code <= 5106) return uint16_t(code + 600);  // 5103, the datum NAVD88: EPSG:5703
    if (code >= 5001 && code <= 5033) return 0;                     // above the ellipsoid: as without a vertical part
    return code == kUserDefined ? uint16_t{0} : code;
}

// One part of a system: its code where that says all, and PROJ's object where PROJ knows it.
struct Part {
    std::string code;
    ProjObject object;
    bool own = false;  // not what the code says
};

Part horizontal_part(const ProjContext& context, const GeoKeys& keys, std::vector<std::string>& notes) {
    Part part;
    const uint16_t projected = keys.code(kProjectedCrs), geodetic = keys.code(kGeodeticCrs);
    const bool has_projection = keys.code(kProjection) != 0 || keys.code(kMethod) != 0;
    const bool by_parameters = projected == kUserDefined || (projected == 0 && has_projection && keys.code(kModelType) != kGeographicModel);
    const uint16_t code = projected != 0 ? projected : geodetic;
    if (by_parameters || code == kUserDefined) {
        part.own = true;
        part.object = crs_of_parameters(context, keys, by_parameters);
        if (!part.object)
            notes.push_back(context.has_database() ? "the coordinate reference system that its GeoTIFF keys describe is not translated: no more than its name is known"
                                                   : "the coordinate reference system of its GeoTIFF keys is not translated without PROJ's database, proj.db: no more than its name is known");
        return part;
    }
    if (code == 0) return part;
    part.code = epsg(code);
    part.object = crs_of_code(context, code);
    if (!part.object) {
        notes.push_back(context.has_database() ? "PROJ knows no " + part.code + ", which its GeoTIFF keys name"
                                               : part.code + " of its GeoTIFF keys is taken unseen: PROJ's database, proj.db, is not found");
        return part;
    }
    const uint16_t unit_code = keys.code(kLinearUnit);
    const std::optional<Unit> unit = projected != 0 ? unit_of_code(context, unit_code, "linear") : std::nullopt;
    const double meters = axis_meters(context, part.object.get());
    if (unit && meters > 0.0 && std::abs(unit->factor / meters - 1.0) > 1e-9) {
        if (ProjObject altered = with_unit(context, part.object.get(), *unit, unit_code)) {
            part.object = std::move(altered);
            part.own = true;
            notes.push_back("its GeoTIFF keys say " + part.code + " in units of " + unit->name + ": they are taken at their word");
        }
    }
    return part;
}

Part vertical_part(const ProjContext& context, const GeoKeys& keys, std::vector<std::string>& notes) {
    Part part;
    const uint16_t code = vertical_code(keys);
    if (code == 0) {
        if (const std::string name = keys.text(kVerticalCitation); !name.empty() && name != "unknown" && keys.code(kVerticalCrs) % kUserDefined == 0)
            notes.push_back("heights are said to be '" + name + "', which has no code and is left out");
        return part;
    }
    part.object = crs_of_code(context, code);
    if (!part.object && !context.has_database()) {  // the horizontal part has said so
        part.code = std::to_string(code);
        return part;
    }
    if (!part.object || proj_get_type(part.object.get()) != PJ_TYPE_VERTICAL_CRS) {
        part.object.reset();
        notes.push_back("PROJ knows no vertical system " + epsg(code) + ", which its GeoTIFF keys name: it is left out");
        return part;
    }
    part.code = std::to_string(code);
    const uint16_t unit_code = keys.code(kVerticalUnit);
    const std::optional<Unit> unit = unit_of_code(context, unit_code, "linear");
    if (unit && std::abs(unit->factor / axis_meters(context, part.object.get()) - 1.0) > 1e-9) {
        if (ProjObject altered = with_unit(context, part.object.get(), *unit, unit_code)) {
            part.object = std::move(altered);
            part.own = true;
        }
    }
    return part;
}

}  // namespace

std::string crs_of_geotiff_keys(ByteReader directory, std::span<const std::byte> doubles, std::span<const std::byte> texts,
                                std::vector<std::string>& notes) {
    const GeoKeys keys(parse_keys(std::move(directory)), doubles, texts);
    const ProjContext context;
    const Part plane = horizontal_part(context, keys, notes);
    if (plane.code.empty() && !plane.object) return keys.citation();
    const Part height = vertical_part(context, keys, notes);
    const bool has_height = !height.code.empty();
    if (!plane.own && !height.own) return has_height ? plane.code + "+" + height.code : plane.code;
    if (!plane.object) return plane.code;  // heights alone make no system, and PROJ knows no more
    std::string wkt;
    if (!has_height) {
        wkt = wkt1_of(context, plane.object.get());
    } else if (plane.object && height.object) {
        const std::string name = std::string(proj_get_name(plane.object.get())) + " + " + proj_get_name(height.object.get());
        const ProjObject both(proj_create_compound_crs(context.get(), name.c_str(), plane.object.get(), height.object.get()));
        if (both) wkt = wkt1_of(context, both.get());
    }
    if (wkt.empty() && has_height) {
        notes.push_back("the heights of its GeoTIFF keys do not join their horizontal system: they are left out");
        wkt = wkt1_of(context, plane.object.get());
    }
    if (!wkt.empty()) return wkt;
    notes.push_back("the coordinate reference system of its GeoTIFF keys does not fit WKT: no more than its name is known");
    return keys.citation();
}

}  // namespace strata
