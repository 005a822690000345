#pragma once

#include <cstdint>

namespace strata {

/// Vertices stay this far from the ends of their edge, as a part of it, so that no triangle degenerates.
inline constexpr double kLeastCut = 0x1p-10;

/// What was done to vertices near samples.
struct CutStatistics {
    uint64_t clamped = 0;
    double largest_shift = 0.0;  // cells

    void add(const CutStatistics& other) {
        clamped += other.clamped;
        if (other.largest_shift > largest_shift) largest_shift = other.largest_shift;
    }
};

/// Where the isovalue lies between samples a and b of which one is inside, from 0 at a to 1 at b: the middle, where one is not finite.
inline double cut_edge(double a, double b, double isovalue, CutStatistics& statistics) {
    const double rise = b - a;  // of two floats: never overflows
    const double t = (isovalue - a) / rise;
    const bool finite = rise - rise == 0.0;
    const double above = t > kLeastCut ? t : kLeastCut;
    const double clamped = above < 1.0 - kLeastCut ? above : 1.0 - kLeastCut;
    const double moved = clamped > t ? clamped - t : t - clamped;
    const double shift = finite ? moved : 0.0;
    statistics.clamped += shift > 0.0;
    statistics.largest_shift = shift > statistics.largest_shift ? shift : statistics.largest_shift;
    return finite ? clamped : 0.5;
}

}  // namespace strata
