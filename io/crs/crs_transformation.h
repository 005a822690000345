#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// PROJ's way from one coordinate reference system to another; x is the one to the east, degrees are degrees.
class CrsTransformation {
public:
    /// throws  Error{usage}: PROJ cannot read a text; Error{unsupported}: there is no way; Error{io}: there is no proj.db
    CrsTransformation(const std::string& from, const std::string& to);
    ~CrsTransformation();
    CrsTransformation(const CrsTransformation&) = delete;
    CrsTransformation& operator=(const CrsTransformation&) = delete;

    /// Transforms points in place; one that PROJ cannot transform becomes infinite. Safe to call from several threads at once.
    void apply(std::span<double> x, std::span<double> y, std::span<double> z) const;

    /// How the point is transformed: PROJ may take another way elsewhere.
    struct Way {
        std::string name;       // "Inverse of UTM zone 15N + NAD83 to WGS 84 (1)"
        double accuracy = 0.0;  // meters; 0: exact by definition; negative: nobody knows
        bool heights_unmoved = false;  // between two height systems, for want of a grid
        std::string complaint;  // why it cannot be; empty: it can, or PROJ does not say
    };
    Way way_at(const Vec3d& place) const;

private:
    class Worker;
    class Lent;

    std::string from_, to_;
    bool ballpark_ = false;  // datums that nobody relates, or grids that are not here: PROJ takes them for the same
    // PROJ's objects serve one thread at a time: as many are made as threads ever meet here.
    mutable std::mutex mutex_;
    mutable std::vector<std::unique_ptr<Worker>> idle_;
};

}  // namespace strata
