#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>

/// What points of formats 0 to 5 become among those of formats 6 to 10.
/// source  LAS 1.4 R15, tables 9, 13 and 17
namespace strata::las {

constexpr double kScanAngleStep = 0.006;  // degrees

inline int16_t angle_of_rank(int8_t rank) { return int16_t(std::lround(rank / kScanAngleStep)); }

// Class 12 of the older formats says overlap and nothing else of the point; the newer ones have a flag for it and reserve the class.
inline uint8_t promoted_class(uint8_t old_class) { return old_class == 12 ? 1 : old_class; }
inline uint8_t flags_of_class(uint8_t old_class) { return old_class == 12 ? 8 : 0; }

constexpr std::string_view kPromotionNote =
    "scan angles of whole degrees become steps of 0.006, class 12 becomes class 1 with the overlap flag";

}  // namespace strata::las
