// Points of formats 0 to 5: one stream of symbols for all fields of a point, one point after the other.
#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "core/error.h"
#include "io/las/byte_window.h"
#include "io/las/las_layout.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_returns.h"
#include "io/las/laz_shared_models.h"

namespace strata::las {
namespace {

/// The first 20 bytes of a record, as they are.
struct Point10 {
    int32_t x, y, z;
    uint16_t intensity;
    uint8_t returns;  // bits 0-2 return number, 3-5 number of returns, 6 scan direction, 7 edge
    uint8_t classification, scan_angle, user_data;
    uint16_t point_source;
};
static_assert(sizeof(Point10) == 20);

int32_t sum(int32_t a, int32_t b) { return int32_t(uint32_t(a) + uint32_t(b)); }

// Version 2: returns choose the models.
class Point10Models2 {
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

    [[gnu::always_inline]] const Point10& decode(ArithmeticDecoder& decoder) {
        const uint32_t changed = decoder.symbol(changes_);
        if (changed & 32) last_.returns = uint8_t(decoder.symbol(returns_[last_.returns]));
        const unsigned r = last_.returns & 7, n = last_.returns >> 3 & 7;
        const size_t kind = return_class_16(n, r), depth = return_depth(n, r), single = n == 1;
        if (changed & 16) last_intensity_[kind] = uint16_t(intensities_.decode(decoder, last_intensity_[kind], std::min<size_t>(kind, 3)));
        last_.intensity = changed ? last_intensity_[kind] : last_.intensity;
        if (changed & 8) last_.classification = uint8_t(decoder.symbol(classifications_[last_.classification]));
        if (changed & 4) last_.scan_angle = uint8_t(last_.scan_angle + decoder.symbol(scan_angles_[last_.returns >> 6 & 1]));
        if (changed & 2) last_.user_data = uint8_t(decoder.symbol(user_data_[last_.user_data]));
        if (changed & 1) last_.point_source = uint16_t(point_sources_.decode(decoder, last_.point_source, 0));

        const int32_t step_x = x_.decode(decoder, x_steps_[kind].median(), single);
        x_steps_[kind].add(step_x);
        last_.x = sum(last_.x, step_x);
        const int32_t step_y = y_.decode(decoder, y_steps_[kind].median(), single + width_context(x_.width(), 20));
        y_steps_[kind].add(step_y);
        last_.y = sum(last_.y, step_y);
        const uint32_t width = (x_.width() + y_.width()) / 2;
        last_z_[depth] = last_.z = z_.decode(decoder, last_z_[depth], single + width_context(width, 18));
        return last_;
    }

private:
    SymbolModel<64> changes_;
    IntegerDecompressor<16, 4> intensities_;
    std::array<SymbolModel<256>, 2> scan_angles_;
    IntegerDecompressor<16, 1> point_sources_;
    IntegerDecompressor<32, 2> x_;
    IntegerDecompressor<32, 22> y_;
    IntegerDecompressor<32, 20> z_;
    ModelBank<256> returns_, classifications_, user_data_;
    std::array<StepMedian, 16> x_steps_, y_steps_;
    std::array<uint16_t, 16> last_intensity_{};
    std::array<int32_t, 8> last_z_{};
    Point10 last_{};
};

// Version 1: the three steps before predict the next.
class Point10Models1 {
public:
    void restart(const Point10& first) {
        x_.restart();
        y_.restart();
        z_.restart();
        intensities_.restart();
        scan_angles_.restart();
        point_sources_.restart();
        changes_.restart();
        returns_.restart();
        classifications_.restart();
        user_data_.restart();
        x_steps_ = y_steps_ = {};
        oldest_ = 0;
        last_ = first;
    }

    const Point10& decode(ArithmeticDecoder& decoder) {
        const int32_t step_x = x_.decode(decoder, median(x_steps_), 0);
        last_.x = sum(last_.x, step_x);
        const int32_t step_y = y_.decode(decoder, median(y_steps_), std::min(x_.width(), 19u));
        last_.y = sum(last_.y, step_y);
        const uint32_t width = (x_.width() + y_.width()) / 2;
        last_.z = z_.decode(decoder, last_.z, std::min(width, 19u));
        x_steps_[oldest_] = step_x;
        y_steps_[oldest_] = step_y;
        oldest_ = (oldest_ + 1) % 3;

        const uint32_t changed = decoder.symbol(changes_);
        if (changed & 32) last_.intensity = uint16_t(intensities_.decode(decoder, last_.intensity, 0));
        if (changed & 16) last_.returns = uint8_t(decoder.symbol(returns_[last_.returns]));
        if (changed & 8) last_.classification = uint8_t(decoder.symbol(classifications_[last_.classification]));
        if (changed & 4) last_.scan_angle = uint8_t(scan_angles_.decode(decoder, last_.scan_angle, width < 3));
        if (changed & 2) last_.user_data = uint8_t(decoder.symbol(user_data_[last_.user_data]));
        if (changed & 1) last_.point_source = uint16_t(point_sources_.decode(decoder, last_.point_source, 0));
        return last_;
    }

private:
    static int32_t median(const std::array<int32_t, 3>& v) { return std::max(std::min(v[0], v[1]), std::min(std::max(v[0], v[1]), v[2])); }

    IntegerDecompressor<32, 1> x_;
    IntegerDecompressor<32, 20> y_, z_;
    IntegerDecompressor<16, 1> intensities_;
    IntegerDecompressor<8, 2> scan_angles_;
    IntegerDecompressor<16, 1> point_sources_;
    SymbolModel<64> changes_;
    ModelBank<256> returns_, classifications_, user_data_;
    std::array<int32_t, 3> x_steps_{}, y_steps_{};
    size_t oldest_ = 0;
    Point10 last_{};
};

class GpsTimeModels1 {
public:
    void restart(uint64_t time) {
        multiples_.restart();
        after_zero_.restart();
        integers_.restart();
        time_ = time;
        difference_ = 0;
        extremes_ = 0;
    }

    uint64_t decode(ArithmeticDecoder& decoder, bool&) {
        if (difference_ == 0) {
            const uint32_t code = decoder.symbol(after_zero_);
            if (code == 1) {
                difference_ = integers_.decode(decoder, 0, 0);
                step(difference_);
            } else if (code == 2) {
                time_ = decoder.raw_bits_64();
            }
            return time_;
        }
        const int code = int(decoder.symbol(multiples_));
        if (code == kRepeat) return time_;
        if (code == kFull) return time_ = decoder.raw_bits_64();
        const auto multiple = [&](int of) { return int32_t(uint32_t(of) * uint32_t(difference_)); };
        if (code == 1) {
            difference_ = integers_.decode(decoder, difference_, 1);
            extremes_ = 0;
            step(difference_);
            return time_;
        }
        const int32_t difference = code == 0   ? integers_.decode(decoder, difference_ / 4, 2)
                                   : code < 10 ? integers_.decode(decoder, multiple(code), 3)
                                   : code < 50 ? integers_.decode(decoder, multiple(code), 4)
                                               : integers_.decode(decoder, multiple(code), 5);
        if ((code == 0 || code == kLargest) && ++extremes_ > 3) {
            difference_ = difference;
            extremes_ = 0;
        }
        step(difference);
        return time_;
    }

private:
    static constexpr int kLargest = 509, kFull = 510, kRepeat = 511;

    void step(int32_t difference) { time_ += uint64_t(int64_t(difference)); }

    SymbolModel<512> multiples_;
    SymbolModel<3> after_zero_;
    IntegerDecompressor<32, 6> integers_;
    uint64_t time_ = 0;
    int32_t difference_ = 0;
    int extremes_ = 0;
};

class RgbModels1 {
public:
    void restart() {
        changes_.restart();
        bytes_.restart();
    }
    Rgb decode(ArithmeticDecoder& decoder, const Rgb& last) {
        const uint32_t changed = decoder.symbol(changes_);
        Rgb rgb;
        for (size_t c = 0; c < 3; ++c) {
            int lower = last[c] & 0xFF, upper = last[c] >> 8;
            if (changed >> (2 * c) & 1) lower = bytes_.decode(decoder, lower, 2 * c);
            if (changed >> (2 * c + 1) & 1) upper = bytes_.decode(decoder, upper, 2 * c + 1);
            rgb[c] = uint16_t(upper << 8 | lower);
        }
        return rgb;
    }

private:
    SymbolModel<64> changes_;
    IntegerDecompressor<8, 6> bytes_;
};

class ExtraBytesModels1 {
public:
    void restart(size_t count) { bytes_.restart(count); }
    uint8_t decode(ArithmeticDecoder& decoder, uint8_t last, size_t index) { return uint8_t(bytes_.decode(decoder, last, index)); }

private:
    IntegerDecompressor<8, 0> bytes_;
};

class ExtraBytesModels2 {
public:
    void restart(size_t count) {
        models_.resize(count);
        for (auto& model : models_) model.restart();
    }
    uint8_t decode(ArithmeticDecoder& decoder, uint8_t last, size_t index) { return uint8_t(last + decoder.symbol(models_[index])); }

private:
    std::vector<SymbolModel<256>> models_;
};

struct Version1 {
    using Point = Point10Models1;
    using GpsTime = GpsTimeModels1;
    using Color = RgbModels1;
    using ExtraBytes = ExtraBytesModels1;
};
struct Version2 {
    using Point = Point10Models2;
    using GpsTime = GpsTimeModels<true>;
    using Color = RgbModels;
    using ExtraBytes = ExtraBytesModels2;
};

template <typename Version>
class PointwiseDecoder : public LazDecoder {
public:
    PointwiseDecoder(const Header& header, bool exact_end)
        : layout_(point_layout(header.point_format)), record_size_(header.record_size), exact_end_(exact_end) {
        extra_bytes_.resize(record_size_ - layout_.size);
    }

    std::unique_ptr<LazDecoder> clone() const override { return std::make_unique<PointwiseDecoder>(*this); }

    void begin(const ByteSource& source, const LazChunk& chunk) override {
        if (chunk.size < record_size_ + 4)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset) + ": " + std::to_string(record_size_ + 4) +
                                                  " bytes needed for its first point, " + std::to_string(chunk.size) + " left");
        // A point is at most some 60 symbols and its extra bytes.
        window_.open(source, chunk.offset, chunk.offset + chunk.size, kBytesPerSymbol * (64 + extra_bytes_.size()) + kBytesAhead + record_size_);
        open_end_ = chunk.open_end;
        const std::byte* const record = window_.begin();
        Point10 point;
        std::memcpy(&point, record, sizeof point);
        point_.restart(point);
        if (layout_.gps_time) {
            uint64_t time;
            std::memcpy(&time, record + layout_.gps_time, sizeof time);
            gps_time_.restart(time);
        }
        if (layout_.rgb) {
            std::memcpy(rgb_.data(), record + layout_.rgb, sizeof rgb_);
            color_.restart();
        }
        if (layout_.wave) {
            packet_ = WavePacketModels::Packet::load(record + layout_.wave);
            packets_.restart();
        }
        if (!extra_bytes_.empty()) {
            std::memcpy(extra_bytes_.data(), record + layout_.size, extra_bytes_.size());
            extra_models_.restart(extra_bytes_.size());
        }
        at_first_ = true;
        decoder_ = ArithmeticDecoder(record + record_size_);
        next_ = record_size_ + 4;
        check(decoder_.ok());
    }

    void decode(size_t count, std::byte* record) override {
        if (count == 0) return;
        if (at_first_) {
            std::memcpy(record, window_.begin(), record_size_);
            record += record_size_;
            --count;
            at_first_ = false;
        }
        ArithmeticDecoder decoder = decoder_;
        decoder.set_next(window_.begin() + next_);
        const std::byte* limit = window_.limit();
        bool ok = true;
        for (size_t i = 0; i < count; ++i, record += record_size_) {
            if (decoder.next() > limit) [[unlikely]] {
                decoder.set_next(window_.advance(decoder.next()));
                limit = window_.limit();
            }
            const Point10& point = point_.decode(decoder);
            std::memcpy(record, &point, sizeof point);
            if (layout_.gps_time) {
                const uint64_t time = gps_time_.decode(decoder, ok);
                std::memcpy(record + layout_.gps_time, &time, sizeof time);
            }
            if (layout_.rgb) {
                rgb_ = color_.decode(decoder, rgb_);
                std::memcpy(record + layout_.rgb, rgb_.data(), sizeof rgb_);
            }
            if (layout_.wave) {
                packet_ = packets_.decode(decoder, packet_);
                packet_.store(record + layout_.wave);
            }
            if (!extra_bytes_.empty()) decode_extra_bytes(decoder, record + layout_.size);
        }
        next_ = size_t(decoder.next() - window_.begin());
        decoder_ = decoder;
        window_.check(decoder.next());
        check(ok && decoder.ok());
    }

    uint64_t finish() override {
        const uint64_t end = window_.offset_of(window_.begin() + next_);
        if (exact_end_ && !open_end_ && end != window_.end())
            throw Error(ErrorKind::malformed, "byte " + std::to_string(end) + ": its points end here, its bytes at " + std::to_string(window_.end()));
        return end;
    }

private:
    void check(bool ok) const {
        if (!ok)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(window_.offset_of(window_.begin() + next_)) +
                                                  ": bytes before this one are not compressed points");
    }

    void decode_extra_bytes(ArithmeticDecoder& decoder, std::byte* out) {
        for (size_t i = 0; i < extra_bytes_.size(); ++i) extra_bytes_[i] = extra_models_.decode(decoder, extra_bytes_[i], i);
        std::memcpy(out, extra_bytes_.data(), extra_bytes_.size());
    }

    PointLayout layout_;
    size_t record_size_;
    bool exact_end_, open_end_ = false;

    ByteWindow window_;
    size_t next_ = 0;  // byte of the window that decoder_ takes next
    bool at_first_ = false;
    ArithmeticDecoder decoder_;
    typename Version::Point point_;
    typename Version::GpsTime gps_time_;
    typename Version::Color color_;
    Rgb rgb_{};
    WavePacketModels packets_;
    WavePacketModels::Packet packet_;
    typename Version::ExtraBytes extra_models_;
    std::vector<uint8_t> extra_bytes_;
};

}  // namespace

std::unique_ptr<LazDecoder> make_pointwise_decoder(const Header& header, const LazHeader& laz) {
    if (laz.items.front().version == 1) return std::make_unique<PointwiseDecoder<Version1>>(header, laz.chunked);
    return std::make_unique<PointwiseDecoder<Version2>>(header, laz.chunked);
}

}  // namespace strata::las
