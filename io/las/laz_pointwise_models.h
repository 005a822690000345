#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/las/laz_returns.h"
#include "io/las/laz_shared_models.h"

// Version 2 of what is in points of formats 0 to 5 alone.

namespace strata::las {

/// The first 20 bytes of a record, as they are.
struct Point10 {
    int32_t x, y, z;
    uint16_t intensity;
    uint8_t returns;  // bits 0-2 return number, 3-5 number of returns, 6 scan direction, 7 edge
    uint8_t classification, scan_angle, user_data;
    uint16_t point_source;
};
static_assert(sizeof(Point10) == 20);

inline int32_t wrapping_sum(int32_t a, int32_t b) { return int32_t(uint32_t(a) + uint32_t(b)); }
inline int32_t wrapping_difference(int32_t a, int32_t b) { return int32_t(uint32_t(a) - uint32_t(b)); }

/// Version 2 of the point: returns choose the models.
template <typename Coder>
class Point10Models {
public:
    void restart(const Point10& first) {
        changes_.restart();
        intensities_.restart();
        for (auto& model : scan_angles_) model.restart();
        point_sources_.restart();
        x_.restart();
        y_.restart();
        z_.restart();
        returns_.restart();
        classifications_.restart();
        user_data_.restart();
        x_steps_ = {};
        y_steps_ = {};
        last_intensity_ = {};
        last_z_ = {};
        last_ = first;
        last_.intensity = 0;
    }

    [[gnu::always_inline]] const Point10& code(Coder& coder, const Point10& told = {}) {
        const uint32_t changed = coder.symbol(changes_, Coder::kEncodes ? changes_to(told) : 0);
        if (changed & 32) last_.returns = uint8_t(coder.symbol(returns_[last_.returns], told.returns));
        const unsigned r = last_.returns & 7, n = last_.returns >> 3 & 7;
        const size_t kind = return_class_16(n, r), depth = return_depth(n, r), single = n == 1;
        if (changed & 16)
            last_intensity_[kind] = uint16_t(intensities_.code(coder, last_intensity_[kind], std::min<size_t>(kind, 3), told.intensity));
        last_.intensity = changed ? last_intensity_[kind] : last_.intensity;
        if (changed & 8) last_.classification = uint8_t(coder.symbol(classifications_[last_.classification], told.classification));
        if (changed & 4)
            last_.scan_angle = uint8_t(last_.scan_angle + coder.symbol(scan_angles_[last_.returns >> 6 & 1], uint8_t(told.scan_angle - last_.scan_angle)));
        if (changed & 2) last_.user_data = uint8_t(coder.symbol(user_data_[last_.user_data], told.user_data));
        if (changed & 1) last_.point_source = uint16_t(point_sources_.code(coder, last_.point_source, 0, told.point_source));

        const int32_t step_x = x_.code(coder, x_steps_[kind].median(), single, wrapping_difference(told.x, last_.x));
        x_steps_[kind].add(step_x);
        last_.x = wrapping_sum(last_.x, step_x);
        const int32_t step_y =
            y_.code(coder, y_steps_[kind].median(), single + width_context(x_.width(), 20), wrapping_difference(told.y, last_.y));
        y_steps_[kind].add(step_y);
        last_.y = wrapping_sum(last_.y, step_y);
        const uint32_t width = (x_.width() + y_.width()) / 2;
        last_z_[depth] = last_.z = z_.code(coder, last_z_[depth], single + width_context(width, 18), told.z);
        return last_;
    }

private:
    // Which fields differ from the last point, the intensity from the last one of its class of returns.
    uint32_t changes_to(const Point10& next) const {
        const size_t kind = return_class_16(next.returns >> 3 & 7, next.returns & 7);
        return uint32_t(next.returns != last_.returns) << 5 | uint32_t(next.intensity != last_intensity_[kind]) << 4 |
               uint32_t(next.classification != last_.classification) << 3 | uint32_t(next.scan_angle != last_.scan_angle) << 2 |
               uint32_t(next.user_data != last_.user_data) << 1 | uint32_t(next.point_source != last_.point_source);
    }

    typename Coder::template Symbols<64> changes_;
    IntegerModels<Coder, 16, 4> intensities_;
    std::array<typename Coder::template Symbols<256>, 2> scan_angles_;
    IntegerModels<Coder, 16, 1> point_sources_;
    IntegerModels<Coder, 32, 2> x_;
    IntegerModels<Coder, 32, 22> y_;
    IntegerModels<Coder, 32, 20> z_;
    ModelBank<Coder, 256> returns_, classifications_, user_data_;
    std::array<StepMedian, 16> x_steps_, y_steps_;
    std::array<uint16_t, 16> last_intensity_{};
    std::array<int32_t, 8> last_z_{};
    Point10 last_{};
};

/// Version 2 of extra bytes: each as its step from the point before.
template <typename Coder>
class ExtraBytesModels {
public:
    void restart(size_t count) {
        models_.resize(count);
        for (auto& model : models_) model.restart();
    }
    [[gnu::always_inline]] uint8_t code(Coder& coder, uint8_t last, size_t index, uint8_t told = 0) {
        return uint8_t(last + coder.symbol(models_[index], uint8_t(told - last)));
    }

private:
    std::vector<typename Coder::template Symbols<256>> models_;
};

}  // namespace strata::las
