// Points of formats 0 to 5: one stream of symbols for all fields of a point, one point after the other.
#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "core/error.h"
#include "io/las/arithmetic_decoder.h"
#include "io/las/byte_window.h"
#include "io/las/las_layout.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_pointwise_models.h"

namespace strata::las {
namespace {

template <int MostSymbols>
using Symbols = ArithmeticDecoder::Symbols<MostSymbols>;
template <int Bits, size_t Contexts>
using Integers = IntegerModels<ArithmeticDecoder, Bits, Contexts>;

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

    const Point10& code(ArithmeticDecoder& decoder) {
        const int32_t step_x = x_.code(decoder, median(x_steps_), 0);
        last_.x = wrapping_sum(last_.x, step_x);
        const int32_t step_y = y_.code(decoder, median(y_steps_), std::min(x_.width(), 19u));
        last_.y = wrapping_sum(last_.y, step_y);
        const uint32_t width = (x_.width() + y_.width()) / 2;
        last_.z = z_.code(decoder, last_.z, std::min(width, 19u));
        x_steps_[oldest_] = step_x;
        y_steps_[oldest_] = step_y;
        oldest_ = (oldest_ + 1) % 3;

        const uint32_t changed = decoder.symbol(changes_);
        if (changed & 32) last_.intensity = uint16_t(intensities_.code(decoder, last_.intensity, 0));
        if (changed & 16) last_.returns = uint8_t(decoder.symbol(returns_[last_.returns]));
        if (changed & 8) last_.classification = uint8_t(decoder.symbol(classifications_[last_.classification]));
        if (changed & 4) last_.scan_angle = uint8_t(scan_angles_.code(decoder, last_.scan_angle, width < 3));
        if (changed & 2) last_.user_data = uint8_t(decoder.symbol(user_data_[last_.user_data]));
        if (changed & 1) last_.point_source = uint16_t(point_sources_.code(decoder, last_.point_source, 0));
        return last_;
    }

private:
    static int32_t median(const std::array<int32_t, 3>& v) { return std::max(std::min(v[0], v[1]), std::min(std::max(v[0], v[1]), v[2])); }

    Integers<32, 1> x_;
    Integers<32, 20> y_, z_;
    Integers<16, 1> intensities_;
    Integers<8, 2> scan_angles_;
    Integers<16, 1> point_sources_;
    Symbols<64> changes_;
    ModelBank<ArithmeticDecoder, 256> returns_, classifications_, user_data_;
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

    uint64_t code(ArithmeticDecoder& decoder, bool&) {
        if (difference_ == 0) {
            const uint32_t code = decoder.symbol(after_zero_);
            if (code == 1) {
                difference_ = integers_.code(decoder, 0, 0);
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
            difference_ = integers_.code(decoder, difference_, 1);
            extremes_ = 0;
            step(difference_);
            return time_;
        }
        const int32_t difference = code == 0   ? integers_.code(decoder, difference_ / 4, 2)
                                   : code < 10 ? integers_.code(decoder, multiple(code), 3)
                                   : code < 50 ? integers_.code(decoder, multiple(code), 4)
                                               : integers_.code(decoder, multiple(code), 5);
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

    Symbols<512> multiples_;
    Symbols<3> after_zero_;
    Integers<32, 6> integers_;
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
    Rgb code(ArithmeticDecoder& decoder, const Rgb& last) {
        const uint32_t changed = decoder.symbol(changes_);
        Rgb rgb;
        for (size_t c = 0; c < 3; ++c) {
            int lower = last[c] & 0xFF, upper = last[c] >> 8;
            if (changed >> (2 * c) & 1) lower = bytes_.code(decoder, lower, 2 * c);
            if (changed >> (2 * c + 1) & 1) upper = bytes_.code(decoder, upper, 2 * c + 1);
            rgb[c] = uint16_t(upper << 8 | lower);
        }
        return rgb;
    }

private:
    Symbols<64> changes_;
    Integers<8, 6> bytes_;
};

class ExtraBytesModels1 {
public:
    void restart(size_t count) { bytes_.restart(count); }
    uint8_t code(ArithmeticDecoder& decoder, uint8_t last, size_t index) { return uint8_t(bytes_.code(decoder, last, index)); }

private:
    Integers<8, 0> bytes_;
};

struct Version1 {
    using Point = Point10Models1;
    using GpsTime = GpsTimeModels1;
    using Color = RgbModels1;
    using ExtraBytes = ExtraBytesModels1;
};
struct Version2 {
    using Point = Point10Models<ArithmeticDecoder>;
    using GpsTime = GpsTimeModels<ArithmeticDecoder, true>;
    using Color = RgbModels<ArithmeticDecoder>;
    using ExtraBytes = ExtraBytesModels<ArithmeticDecoder>;
};

template <typename Version>
class PointwiseDecoder : public LazDecoder {
public:
    PointwiseDecoder(const Header& header, bool exact_end)
        : layout_(point_layout(header.point_format)), record_size_(header.record_size), exact_end_(exact_end) {
        extra_bytes_.resize(record_size_ - layout_.size);
    }

    std::unique_ptr<LazDecoder> clone() const override { return std::make_unique<PointwiseDecoder>(*this); }

    void prefetch(const ByteSource& source, const LazChunk& chunk) const override { source.prefetch(chunk.offset, chunk.likely_bytes(chunk.size)); }

    void begin(const ByteSource& source, const LazChunk& chunk) override {
        if (chunk.size < record_size_ + 4)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset) + ": " + std::to_string(record_size_ + 4) +
                                                  " bytes needed for its first point, " + std::to_string(chunk.size) + " left");
        // A point is at most some 60 symbols and its extra bytes.
        window_.open(source, chunk.offset, chunk.offset + chunk.size, kBytesPerSymbol * (64 + extra_bytes_.size()) + kBytesAhead + record_size_,
                     chunk.likely_bytes(chunk.size));
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
            packet_ = WavePacket::load(record + layout_.wave);
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
            const Point10& point = point_.code(decoder);
            std::memcpy(record, &point, sizeof point);
            if (layout_.gps_time) {
                const uint64_t time = gps_time_.code(decoder, ok);
                std::memcpy(record + layout_.gps_time, &time, sizeof time);
            }
            if (layout_.rgb) {
                rgb_ = color_.code(decoder, rgb_);
                std::memcpy(record + layout_.rgb, rgb_.data(), sizeof rgb_);
            }
            if (layout_.wave) {
                packet_ = packets_.code(decoder, packet_);
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
        for (size_t i = 0; i < extra_bytes_.size(); ++i) extra_bytes_[i] = extra_models_.code(decoder, extra_bytes_[i], i);
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
    WavePacketModels<ArithmeticDecoder> packets_;
    WavePacket packet_;
    typename Version::ExtraBytes extra_models_;
    std::vector<uint8_t> extra_bytes_;
};

}  // namespace

std::unique_ptr<LazDecoder> make_pointwise_decoder(const Header& header, const LazHeader& laz) {
    if (laz.items.front().version == 1) return std::make_unique<PointwiseDecoder<Version1>>(header, laz.chunked);
    return std::make_unique<PointwiseDecoder<Version2>>(header, laz.chunked);
}

}  // namespace strata::las
