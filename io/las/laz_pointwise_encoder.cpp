// Points of formats 0 to 5 to bytes: one stream of symbols for all fields of a point, one point after the other.
#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>

#include "io/las/arithmetic_encoder.h"
#include "io/las/coded_bytes.h"
#include "io/las/las_layout.h"
#include "io/las/laz_encoder.h"
#include "io/las/laz_pointwise_models.h"

namespace strata::las {
namespace {

constexpr size_t kTilePoints = 256;  // between two looks at the room

// What a point takes at most, without extra bytes: some 20 symbols and, with a wave packet, 14 integers.
constexpr size_t kMostPointBytes = 24 * kBytesPerSymbol + 14 * kMostIntegerBytes;

template <typename T>
T load(const std::byte* at) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return value;
}

class PointwiseEncoder : public LazEncoder {
public:
    PointwiseEncoder(const PointLayout& layout, size_t record_size)
        : layout_(layout), record_size_(record_size), extra_bytes_(record_size - layout.size) {}

    void encode(std::span<const std::byte> records, std::vector<std::byte>& out) override {
        const std::byte* const first = records.data();
        const size_t count = records.size() / record_size_;
        assert(count > 0 && records.size() % record_size_ == 0);
        restart(first);
        ArithmeticEncoder encoder = bytes_.begin();
        for (size_t done = 1, size; done < count; done += size) {
            size = std::min(count - done, kTilePoints);
            bytes_.make_room(encoder, size * (kMostPointBytes + extra_bytes_ * kBytesPerSymbol));
            encode_tile(encoder, size, first + done * record_size_);
        }
        const std::span<const std::byte> coded = bytes_.finish(encoder);
        out.insert(out.end(), first, first + record_size_);
        out.insert(out.end(), coded.begin(), coded.end());
    }

private:
    void restart(const std::byte* first) {
        point_.restart(load<Point10>(first));
        if (layout_.gps_time) gps_time_.restart(load<uint64_t>(first + layout_.gps_time));
        if (layout_.rgb) color_.restart();
        if (layout_.wave) packets_.restart();
        if (extra_bytes_ > 0) extra_models_.restart(extra_bytes_);
    }

    // Each record behind the one that it is predicted from.
    void encode_tile(ArithmeticEncoder& to, size_t size, const std::byte* record) {
        ArithmeticEncoder encoder = to;
        [[maybe_unused]] bool ok = true;
        for (size_t i = 0; i < size; ++i, record += record_size_) {
            const std::byte* const last = record - record_size_;
            point_.code(encoder, load<Point10>(record));
            if (layout_.gps_time) gps_time_.code(encoder, ok, load<uint64_t>(record + layout_.gps_time));
            if (layout_.rgb) color_.code(encoder, load<Rgb>(last + layout_.rgb), load<Rgb>(record + layout_.rgb));
            if (layout_.wave) {
                ArithmeticEncoder apart = encoder;  // so that no call has the encoder's address: it stays in registers
                packets_.code(apart, WavePacket::load(last + layout_.wave), WavePacket::load(record + layout_.wave));
                encoder = apart;
            }
            for (size_t b = 0; b < extra_bytes_; ++b) {
                const size_t at = layout_.size + b;
                extra_models_.code(encoder, load<uint8_t>(last + at), b, load<uint8_t>(record + at));
            }
        }
        to = encoder;
    }

    PointLayout layout_;
    size_t record_size_;
    size_t extra_bytes_;
    CodedBytes bytes_;
    Point10Models<ArithmeticEncoder> point_;
    GpsTimeModels<ArithmeticEncoder, true> gps_time_;
    RgbModels<ArithmeticEncoder> color_;
    WavePacketModels<ArithmeticEncoder> packets_;
    ExtraBytesModels<ArithmeticEncoder> extra_models_;
};

}  // namespace

std::unique_ptr<LazEncoder> make_pointwise_encoder(int point_format, size_t record_size) {
    return std::make_unique<PointwiseEncoder>(point_layout(point_format), record_size);
}

}  // namespace strata::las
