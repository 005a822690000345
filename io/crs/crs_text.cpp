#include "io/crs/crs_text.h"

#include <proj.h>

#include <algorithm>
#include <array>
#include <vector>

#include "io/crs/proj_objects.h"

namespace strata {
namespace {

std::string text_or_empty(const char* text) { return text ? text : ""; }

std::string id_of(const PJ* object) {
    const std::string authority = text_or_empty(proj_get_id_auth_name(object, 0)), code = text_or_empty(proj_get_id_code(object, 0));
    return authority.empty() || code.empty() ? "" : authority + ":" + code;
}

struct Axis {
    std::string direction, unit;
    double factor = 0.0;  // meters or radians
};

std::vector<Axis> axes_of(const ProjContext& context, const PJ* crs) {
    const ProjObject system(proj_crs_get_coordinate_system(context.get(), crs));
    std::vector<Axis> axes;
    if (!system) return axes;
    const int count = proj_cs_get_axis_count(context.get(), system.get());
    for (int i = 0; i < count; ++i) {
        const char *direction = nullptr, *unit = nullptr;
        double factor = 0.0;
        if (proj_cs_get_axis_info(context.get(), system.get(), i, nullptr, nullptr, &direction, &factor, &unit, nullptr, nullptr))
            axes.push_back({text_or_empty(direction), text_or_empty(unit), factor});
    }
    return axes;
}

bool is_geographic(const PJ* crs) {
    const PJ_TYPE type = proj_get_type(crs);
    return type == PJ_TYPE_GEOGRAPHIC_2D_CRS || type == PJ_TYPE_GEOGRAPHIC_3D_CRS;
}

// A system with a transformation to WGS 84 bolted on (WKT 1 with TOWGS84) is described by the system itself.
ProjObject unbound(const ProjContext& context, ProjObject crs) {
    while (crs && proj_get_type(crs.get()) == PJ_TYPE_BOUND_CRS) crs.reset(proj_get_source_crs(context.get(), crs.get()));
    return crs;
}

ProjObject part(const ProjContext& context, const PJ* compound, int index) {
    return unbound(context, ProjObject(proj_crs_get_sub_crs(context.get(), compound, index)));
}

}  // namespace

std::optional<CrsDescription> describe_crs(const std::string& crs) {
    if (crs.empty()) return std::nullopt;
    const ProjContext context;
    const ProjObject whole = unbound(context, crs_object(context, crs));
    if (!whole) return std::nullopt;
    CrsDescription description{.id = id_of(whole.get()), .name = text_or_empty(proj_get_name(whole.get()))};
    ProjObject horizontal, vertical;
    if (proj_get_type(whole.get()) == PJ_TYPE_COMPOUND_CRS) {
        horizontal = part(context, whole.get(), 0);
        vertical = part(context, whole.get(), 1);
    }
    const PJ* const plane = horizontal ? horizontal.get() : whole.get();
    std::vector<Axis> axes = axes_of(context, plane);
    // WKT of a local system may name no unit; PROJ then takes it for meters, and we for unknown.
    if (proj_get_type(plane) == PJ_TYPE_ENGINEERING_CRS && crs.find("UNIT") == std::string::npos) axes.clear();
    if (!axes.empty()) description.unit = axes[0].unit;
    if (!axes.empty() && !is_geographic(plane)) description.unit_meters = axes[0].factor;
    if (axes.size() == 3) {
        description.vertical_unit = axes[2].unit;
        description.vertical_meters = axes[2].factor;
    }
    description.earth_centered = proj_get_type(plane) == PJ_TYPE_GEOCENTRIC_CRS;
    if (vertical) {
        const std::vector<Axis> up = axes_of(context, vertical.get());
        if (!up.empty()) {
            description.vertical_unit = up[0].unit;
            description.vertical_meters = up[0].factor;
        }
        const std::string first = id_of(plane), second = id_of(vertical.get());
        const size_t colon = second.find(':');
        // Only codes of one authority can be joined.
        if (description.id.empty() && !first.empty() && !second.empty() && first.compare(0, colon + 1, second, 0, colon + 1) == 0)
            description.id = first + "+" + second.substr(colon + 1);
    }
    return description;
}

std::string crs_name(const std::string& crs) {
    if (const std::optional<CrsDescription> description = describe_crs(crs); description && !description->name.empty())
        return description->id.empty() ? description->name : description->id + " " + description->name;
    constexpr size_t kLongest = 60;
    return crs.size() <= kLongest ? crs : crs.substr(0, kLongest) + "...";
}

bool is_wkt1(const std::string& crs) {
    constexpr std::array kKinds = {"PROJCS", "GEOGCS", "GEOCCS", "COMPD_CS", "LOCAL_CS"};
    return std::any_of(kKinds.begin(), kKinds.end(), [&](const std::string kind) { return crs.starts_with(kind + "[") || crs.starts_with(kind + "("); });
}

std::string wkt1_of_crs(const std::string& crs) {
    if (crs.empty() || is_wkt1(crs)) return crs;
    const ProjContext context;
    const ProjObject object = crs_object(context, crs);
    return object ? wkt1_of(context, object.get()) : std::string();
}

void check_crs(const std::string& crs) {
    const ProjContext context;
    (void)require_crs(context, crs);
}

bool same_crs(const std::string& a, const std::string& b) {
    if (a == b) return true;
    if (a.empty() || b.empty()) return false;
    const ProjContext context;
    // x is the one to the east in all that we read, whatever order a system is defined in.
    const auto eastward = [&](const std::string& text) {
        const ProjObject crs = unbound(context, crs_object(context, text));
        return ProjObject(crs ? proj_normalize_for_visualization(context.get(), crs.get()) : nullptr);
    };
    const ProjObject first = eastward(a), second = eastward(b);
    return first && second && proj_is_equivalent_to_with_ctx(context.get(), first.get(), second.get(), PJ_COMP_EQUIVALENT) != 0;
}

}  // namespace strata
