#include "io/crs/crs_transformation.h"

#include <proj.h>
#include <proj_experimental.h>

#include <cmath>

#include "core/error.h"
#include "io/crs/crs_text.h"
#include "io/crs/proj_objects.h"

namespace strata {
namespace {

bool is_bound(const PJ* crs) { return crs != nullptr && proj_get_type(crs) == PJ_TYPE_BOUND_CRS; }

// A compound system whose horizontal part has a transformation to WGS 84 bolted on (WKT 1 with TOWGS84), with the east first:
// proj_normalize_for_visualization does not look behind the bolts and would leave the north in x. Others are returned as they are.
ProjObject with_east_first(const ProjContext& context, ProjObject crs) {
    if (!crs || proj_get_type(crs.get()) != PJ_TYPE_COMPOUND_CRS) return crs;
    pj_ctx* const c = context.get();
    const ProjObject plane(proj_crs_get_sub_crs(c, crs.get(), 0)), height(proj_crs_get_sub_crs(c, crs.get(), 1));
    if (!is_bound(plane.get())) return crs;
    const ProjObject base(proj_get_source_crs(c, plane.get())), hub(proj_get_target_crs(c, plane.get())), shift(proj_crs_get_coordoperation(c, plane.get()));
    const ProjObject eastward(base ? proj_normalize_for_visualization(c, base.get()) : nullptr);
    if (!eastward || !hub || !shift || !height) return nullptr;
    const ProjObject bound(proj_crs_create_bound_crs(c, eastward.get(), hub.get(), shift.get()));
    return ProjObject(bound ? proj_create_compound_crs(c, proj_get_name(crs.get()), bound.get(), height.get()) : nullptr);
}

}  // namespace

class CrsTransformation::Worker {
public:
    Worker(const std::string& from, const std::string& to, bool ballpark) {
        const ProjObject source = with_east_first(context_, require_crs(context_, from)), target = with_east_first(context_, require_crs(context_, to));
        if (!source || !target) return;  // no way, rather than one with x and y mixed up
        const char* const options[] = {ballpark ? "ALLOW_BALLPARK=YES" : "ALLOW_BALLPARK=NO", nullptr};
        const ProjObject way(proj_create_crs_to_crs_from_pj(context_.get(), source.get(), target.get(), nullptr, options));
        if (way) way_.reset(proj_normalize_for_visualization(context_.get(), way.get()));
    }

    bool exists() const { return way_ != nullptr; }
    PJ* way() const { return way_.get(); }
    const ProjContext& context() const { return context_; }

private:
    ProjContext context_;
    ProjObject way_;  // of context_, and destroyed before it
};

// A worker for the time of a call.
class CrsTransformation::Lent {
public:
    explicit Lent(const CrsTransformation& owner) : owner_(owner) {
        {
            const std::lock_guard lock(owner_.mutex_);
            if (!owner_.idle_.empty()) {
                worker_ = std::move(owner_.idle_.back());
                owner_.idle_.pop_back();
            }
        }
        if (!worker_) worker_ = std::make_unique<Worker>(owner_.from_, owner_.to_, owner_.ballpark_);
    }
    ~Lent() {
        const std::lock_guard lock(owner_.mutex_);
        owner_.idle_.push_back(std::move(worker_));
    }
    Worker* operator->() const { return worker_.get(); }

private:
    const CrsTransformation& owner_;
    std::unique_ptr<Worker> worker_;
};

CrsTransformation::CrsTransformation(const std::string& from, const std::string& to) : from_(from), to_(to) {
    auto worker = std::make_unique<Worker>(from_, to_, false);
    if (!worker->exists()) {
        ballpark_ = true;
        worker = std::make_unique<Worker>(from_, to_, true);
    }
    if (!worker->exists()) throw Error(ErrorKind::unsupported, "PROJ knows no way from " + crs_name(from) + " to " + crs_name(to));
    idle_.push_back(std::move(worker));
}

CrsTransformation::~CrsTransformation() = default;

void CrsTransformation::apply(std::span<double> x, std::span<double> y, std::span<double> z) const {
    const Lent worker(*this);
    proj_errno_reset(worker->way());
    proj_trans_generic(worker->way(), PJ_FWD, x.data(), sizeof(double), x.size(), y.data(), sizeof(double), y.size(), z.data(), sizeof(double), z.size(),
                       nullptr, 0, 0);
}

CrsTransformation::Way CrsTransformation::way_at(const Vec3d& place) const {
    const Lent worker(*this);
    pj_ctx* const context = worker->context().get();
    proj_errno_reset(worker->way());
    const PJ_COORD there = proj_trans(worker->way(), PJ_FWD, proj_coord(place.x(), place.y(), place.z(), HUGE_VAL));
    Way way;
    if (there.xyz.x == HUGE_VAL) {
        const int number = proj_errno(worker->way());
        const char* const text = number != 0 ? proj_context_errno_string(context, number) : nullptr;
        way.complaint = text ? text : "";
    }
    // Of several ways PROJ takes the best for each place.
    const ProjObject used(proj_trans_get_last_used_operation(worker->way()));
    if (!used) return way;
    way.name = proj_get_name(used.get()) ? proj_get_name(used.get()) : "";
    way.accuracy = proj_coordoperation_get_accuracy(context, used.get());
    way.heights_unmoved = way.name.find("ballpark vertical transformation") != std::string::npos;
    return way;
}

}  // namespace strata
