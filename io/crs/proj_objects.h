#pragma once

#include <memory>
#include <string>

struct PJconsts;  // PROJ's PJ
struct pj_ctx;    // PROJ's PJ_CONTEXT

namespace strata {

/// What one thread works with PROJ in. PROJ's messages are kept rather than printed.
class ProjContext {
public:
    ProjContext();
    ~ProjContext();
    ProjContext(const ProjContext&) = delete;
    ProjContext& operator=(const ProjContext&) = delete;

    pj_ctx* get() const { return context_; }
    bool has_database() const;  // without proj.db no code has a meaning
    /// The last that PROJ said, as one line; empty: nothing.
    const std::string& message() const { return message_; }

private:
    pj_ctx* context_;
    std::string message_;
};

struct ProjDeleter {
    void operator()(PJconsts* object) const;
};
using ProjObject = std::unique_ptr<PJconsts, ProjDeleter>;

/// The coordinate reference system that a text stands for: "EPSG:n", "EPSG:h+v", WKT of any kind, PROJJSON, a URN or a PROJ
/// string ("+proj=..."). Names, such as a citation, stand for none: PROJ would guess.
/// returns null where there is none; the context has the reason
ProjObject crs_object(const ProjContext& context, const std::string& text);

/// The same, for a text that must be one.
/// throws  Error{usage}: PROJ cannot read it; Error{io}: there is no database to look it up in
ProjObject require_crs(const ProjContext& context, const std::string& text);

/// OGC WKT 1 on one line; empty where that version cannot say it.
std::string wkt1_of(const ProjContext& context, const PJconsts* crs);

}  // namespace strata
