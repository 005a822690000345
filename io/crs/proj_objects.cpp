#include "io/crs/proj_objects.h"

#include <proj.h>

#include <algorithm>

#include "core/error.h"

namespace strata {
namespace {

void keep_message(void* kept, int, const char* message) {
    std::string& line = *static_cast<std::string*>(kept);
    line = message;
    std::replace(line.begin(), line.end(), '\n', ' ');
}

bool is_upper(char c) { return (c >= 'A' && c <= 'Z') || c == '_'; }

// PROJCS[...] or PROJCRS(...): WKT begins with a word in capitals and a bracket.
bool looks_like_wkt(const std::string& text) {
    const size_t bracket = size_t(std::find_if_not(text.begin(), text.end(), is_upper) - text.begin());
    return bracket > 0 && bracket < text.size() && (text[bracket] == '[' || text[bracket] == '(');
}

// EPSG:25832, ESRI:102008, EPSG:2949+5713.
bool looks_like_code(const std::string& text) {
    const size_t colon = text.find(':');
    const auto is_word = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
    return colon != std::string::npos && colon > 0 && colon + 1 < text.size() && text.size() < 64 &&
           std::all_of(text.begin(), text.begin() + std::ptrdiff_t(colon), is_word) &&
           std::all_of(text.begin() + std::ptrdiff_t(colon) + 1, text.end(), [&](unsigned char c) { return is_word(c) || c == '+' || c == ':'; });
}

}  // namespace

ProjContext::ProjContext() : context_(proj_context_create()) {
    if (context_ == nullptr) throw Error(ErrorKind::limit, "PROJ cannot start");
    proj_log_func(context_, &message_, keep_message);
}

ProjContext::~ProjContext() { proj_context_destroy(context_); }

bool ProjContext::has_database() const { return proj_context_get_database_path(context_) != nullptr; }

void ProjDeleter::operator()(PJconsts* object) const { proj_destroy(object); }

ProjObject crs_object(const ProjContext& context, const std::string& text) {
    std::string definition = text;
    if (text.starts_with("+proj=") || text.starts_with("+init=")) {
        if (text.find("+type=crs") == std::string::npos) definition += " +type=crs";
    } else if (!looks_like_wkt(text) && !looks_like_code(text) && !text.starts_with('{') && !text.starts_with("urn:")) {
        return nullptr;
    }
    ProjObject object(proj_create(context.get(), definition.c_str()));
    if (object && !proj_is_crs(object.get())) object.reset();
    return object;
}

ProjObject require_crs(const ProjContext& context, const std::string& text) {
    ProjObject crs = crs_object(context, text);
    if (crs) return crs;
    if (!context.has_database()) throw Error(ErrorKind::io, "PROJ's database, proj.db, is not found; PROJ_DATA says in which folder it is");
    constexpr size_t kLongest = 60;
    throw Error(ErrorKind::usage, "'" + (text.size() <= kLongest ? text : text.substr(0, kLongest) + "...") +
                                      "' is no coordinate reference system that PROJ knows; EPSG:n, EPSG:n+m with heights, WKT or a PROJ string is expected");
}

std::string wkt1_of(const ProjContext& context, const PJconsts* crs) {
    // LAS files say ellipsoidal heights as a vertical part by the name of Ellipsoid.
    const char* const options[] = {"MULTILINE=NO", "ALLOW_ELLIPSOIDAL_HEIGHT_AS_VERTICAL_CRS=YES", nullptr};
    const char* const wkt = proj_as_wkt(context.get(), crs, PJ_WKT1_GDAL, options);
    return wkt ? wkt : "";
}

}  // namespace strata
