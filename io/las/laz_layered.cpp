// Points of formats 6 to 10: a stream of symbols for each field, so that fields nobody asked for are not even read.
// The first layer, returns and x and y, says which channel each point belongs to and whether time, scan angle and source
// change; what the other layers need of that is noted a tile at a time, and each layer decodes the tile in a loop of its own.
#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>
#include <string>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/las_layout.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_layered_models.h"
#include "io/las/laz_returns.h"
#include "io/las/laz_shared_models.h"

namespace strata::las {
namespace {

// What a layer's decoder may run ahead within one point: GPS time switches sequence four times, then begins one.
constexpr size_t kMargin = kBytesPerSymbol * 64 + kBytesAhead;

// Where fields lie in the record.
constexpr size_t kX = 0, kY = 4, kZ = 8, kIntensity = 12, kReturns = 14, kFlags = 15, kClassification = 16, kUserData = 17, kScanAngle = 18,
                 kPointSource = 20, kGpsTime = 22;

/// The bytes of a layer and how far they are decoded.
struct Layer {
    ArithmeticDecoder decoder;
    const std::byte* end = nullptr;
    bool active = false;  // asked for, and not the same for all points of the chunk

    void check(const ArithmeticDecoder& at) const {
        if (at.next() > end) [[unlikely]]
            throw Error(ErrorKind::malformed, "the compressed points go on where the bytes of a layer end");
    }
    /// Keeps where the decoder is, behind the last point of a tile.
    void leave(const ArithmeticDecoder& at) {
        check(at);
        if (!at.ok()) throw Error(ErrorKind::malformed, "the bytes of a layer are not compressed points");
        decoder = at;
    }
};

template <typename T>
void store(std::byte* at, const T& value) {
    std::memcpy(at, &value, sizeof value);
}
void store(std::byte* at, const WavePacketModels::Packet& packet) { packet.store(at); }
void store(std::byte* at, const Rgb& rgb) { std::memcpy(at, rgb.data(), sizeof rgb); }

template <typename T>
T load(const std::byte* at) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return value;
}

uint8_t flags_of(uint8_t record_byte) { return uint8_t((record_byte & 0x0F) | (record_byte >> 6) << 4); }

class LayeredDecoder : public LazDecoder {
public:
    LayeredDecoder(const Header& header, const LazHeader& laz, const LazSelection& selection)
        : layout_(point_layout(header.point_format)),
          record_size_(header.record_size),
          keeps_channels_(laz.items.front().version == 4),
          selection_(selection),
          extra_bytes_(record_size_ - layout_.size) {
        layers_.resize(9 + (layout_.nir ? 2u : layout_.rgb ? 1u : 0u) + (layout_.wave ? 1 : 0) + extra_bytes_.size());
    }

    std::unique_ptr<LazDecoder> clone() const override { return std::make_unique<LayeredDecoder>(*this); }

    void begin(const ByteSource& source, const LazChunk& chunk) override {
        offset_ = chunk.offset;
        first_.resize(record_size_);
        const uint64_t head_size = record_size_ + 4 + 4 * uint64_t(layers_.size());
        if (chunk.size < head_size)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset) + ": " + std::to_string(head_size) +
                                                  " bytes needed for its first point and the sizes of its layers, " + std::to_string(chunk.size) + " left");
        std::vector<std::byte> head(head_size);
        source.read(chunk.offset, head);
        std::copy_n(head.begin(), record_size_, first_.begin());
        ByteReader reader(std::span<const std::byte>(head).subspan(record_size_), "layers", chunk.offset + record_size_);
        const uint32_t points = reader.read<uint32_t>();
        if (points != chunk.points)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset + record_size_) + ": it says that it has " + std::to_string(points) +
                                                  " points, " + std::to_string(chunk.points) + " are expected");
        std::vector<uint32_t> sizes(layers_.size());
        for (uint32_t& size : sizes) size = reader.read<uint32_t>();
        const uint64_t sum = std::accumulate(sizes.begin(), sizes.end(), uint64_t{0});
        if (chunk.open_end ? sum > chunk.size - head_size : sum != chunk.size - head_size)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset + record_size_ + 4) + ": its layers have " + std::to_string(sum) +
                                                  " bytes, there are " + std::to_string(chunk.size - head_size));
        end_ = chunk.offset + head_size + sum;
        read_layers(source, chunk.offset + head_size, sizes);
        restart_models();
        at_first_ = true;
    }

    void decode(size_t count, std::byte* records) override {
        if (count > 0 && at_first_) {
            std::copy(first_.begin(), first_.end(), records);
            records += record_size_;
            --count;
            at_first_ = false;
        }
        try {
            for (size_t size; count > 0; count -= size, records += size * record_size_) {
                size = std::min(count, kTilePoints);
                decode_tile(size, records);
            }
        } catch (const Error& error) {
            throw error.within("byte " + std::to_string(offset_));
        }
    }

    uint64_t finish() override { return end_; }

private:
    enum LayerIndex { kPositions, kZs, kClassifications, kFlagsLayer, kIntensities, kScanAngles, kUserDatas, kPointSources, kGpsTimes, kItems };

    // Which layers are asked for, in their order.
    std::vector<bool> wanted_layers() const {
        std::vector<bool> wanted = {true, true};
        const auto ask = [&](size_t offset, size_t size) { wanted.push_back(selection_.has(offset, size)); };
        ask(kClassification, 1);
        ask(kFlags, 1);
        ask(kIntensity, 2);
        ask(kScanAngle, 2);
        ask(kUserData, 1);
        ask(kPointSource, 2);
        ask(kGpsTime, 8);
        if (layout_.rgb) ask(layout_.rgb, 6);
        if (layout_.nir) ask(layout_.nir, 2);
        if (layout_.wave) ask(layout_.wave, WavePacketModels::kBytes);
        for (size_t i = 0; i < extra_bytes_.size(); ++i) ask(layout_.size + i, 1);
        return wanted;
    }

    void read_layers(const ByteSource& source, uint64_t offset, const std::vector<uint32_t>& sizes) {
        const std::vector<bool> wanted = wanted_layers();
        uint64_t room = kMargin;
        for (size_t i = 0; i < sizes.size(); ++i) room += wanted[i] ? sizes[i] : 0;
        const auto bytes = std::make_shared<std::vector<std::byte>>(room);
        std::vector<ByteRange> ranges;
        size_t at = 0;
        for (size_t i = 0; i < sizes.size(); ++i) {
            layers_[i].active = wanted[i] && sizes[i] > 0;
            if (layers_[i].active) {
                ranges.push_back({offset, std::span(*bytes).subspan(at, sizes[i])});
                layers_[i].end = bytes->data() + at + sizes[i];
                at += sizes[i];
            }
            offset += sizes[i];
        }
        source.read_many(ranges);
        size_t range = 0;
        for (Layer& layer : layers_)
            if (layer.active) layer.decoder = ArithmeticDecoder(ranges[range++].out.data());
        bytes_ = bytes;
    }

    void restart_models() {
        const std::byte* const first = first_.data();
        const uint8_t returns = load<uint8_t>(first + kReturns), flags = load<uint8_t>(first + kFlags);
        const size_t channel = flags >> 4 & 3;
        channel_flags_ = flags;
        positions_.restart(channel, {load<int32_t>(first + kX), load<int32_t>(first + kY), uint8_t(returns & 15), uint8_t(returns >> 4)});
        const auto restart = [&](size_t layer, auto& models, const auto& value) {
            if (layers_[layer].active) models.restart(channel, value);
        };
        restart(kZs, zs_, load<int32_t>(first + kZ));
        restart(kClassifications, classifications_, load<uint8_t>(first + kClassification));
        restart(kFlagsLayer, flags_, flags_of(flags));
        restart(kIntensities, intensities_, load<uint16_t>(first + kIntensity));
        restart(kScanAngles, scan_angles_, load<uint16_t>(first + kScanAngle));
        restart(kUserDatas, user_data_, load<uint8_t>(first + kUserData));
        restart(kPointSources, point_sources_, load<uint16_t>(first + kPointSource));
        restart(kGpsTimes, gps_times_, load<uint64_t>(first + kGpsTime));
        size_t layer = kItems;
        if (layout_.rgb) restart(layer++, rgbs_, load<Rgb>(first + layout_.rgb));
        if (layout_.nir) restart(layer++, nirs_, load<uint16_t>(first + layout_.nir));
        if (layout_.wave) restart(layer++, wave_packets_, WavePacketModels::Packet::load(first + layout_.wave));
        for (size_t i = 0; i < extra_bytes_.size(); ++i) restart(layer++, extra_bytes_[i], load<uint8_t>(first + layout_.size + i));
    }

    void decode_tile(size_t size, std::byte* records) {
        // Fields whose layers do not change, or are not asked for, are those of the first point.
        for (size_t i = 0; i < size; ++i) std::memcpy(records + i * record_size_, first_.data(), record_size_);
        notes_.size = size;
        decode_positions(records);
        decode_field(kZs, zs_, records + kZ);
        decode_field(kClassifications, classifications_, records + kClassification);
        decode_flags(records + kFlags);
        decode_field(kIntensities, intensities_, records + kIntensity);
        decode_field(kScanAngles, scan_angles_, records + kScanAngle);
        decode_field(kUserDatas, user_data_, records + kUserData);
        decode_field(kPointSources, point_sources_, records + kPointSource);
        decode_field(kGpsTimes, gps_times_, records + kGpsTime);
        size_t layer = kItems;
        if (layout_.rgb) decode_item(layer++, rgbs_, records + layout_.rgb);
        if (layout_.nir) decode_item(layer++, nirs_, records + layout_.nir);
        if (layout_.wave) decode_item(layer++, wave_packets_, records + layout_.wave);
        for (size_t i = 0; i < extra_bytes_.size(); ++i) decode_item(layer++, extra_bytes_[i], records + layout_.size + i);
    }

    void decode_positions(std::byte* record) {
        Layer& layer = layers_[kPositions];
        if (!layer.active) throw Error(ErrorKind::malformed, "its first layer, of x and y, has no bytes");
        ArithmeticDecoder decoder = layer.decoder;
        PositionContext* context = &positions_.current();
        uint8_t channel = channel_flags_ >> 4 & 3;
        for (size_t i = 0; i < notes_.size; ++i, record += record_size_) {
            layer.check(decoder);
            const unsigned last_r = context->value.r, last_n = context->value.n;
            const size_t kind = size_t(last_r == 1) | size_t(last_r >= last_n) << 1 | size_t(context->time_changed) << 2;
            const uint32_t changed = decoder.symbol(context->changes[kind]);
            uint8_t item_channel = keeps_channels_ ? channel : 0;
            if (changed & 64) [[unlikely]] {
                channel = uint8_t((channel + decoder.symbol(context->channels) + 1) & 3);
                context = &positions_.move_to(channel);
                item_channel = channel;
            }
            Position& value = context->value;
            const bool time_changed = changed & 16;
            context->time_changed = time_changed;
            if (changed & 4) value.n = uint8_t(decoder.symbol(context->return_counts[value.n]));
            switch (changed & 3) {
                case 0: break;
                case 1: value.r = (value.r + 1) & 15; break;
                case 2: value.r = (value.r + 15) & 15; break;
                default:
                    value.r = uint8_t(time_changed ? decoder.symbol(context->return_numbers[value.r])
                                                   : (value.r + decoder.symbol(context->return_numbers_same_time) + 2) & 15);
            }
            const unsigned r = value.r, n = value.n;
            const size_t steps = return_class_6(n, r) << 1 | size_t(time_changed), single = n == 1;
            const int32_t step_x = context->x.decode(decoder, context->x_steps[steps].median(), single);
            context->x_steps[steps].add(step_x);
            value.x = int32_t(uint32_t(value.x) + uint32_t(step_x));
            const int32_t step_y = context->y.decode(decoder, context->y_steps[steps].median(), single + width_context(context->x.width(), 20));
            context->y_steps[steps].add(step_y);
            value.y = int32_t(uint32_t(value.y) + uint32_t(step_y));

            notes_.channel[i] = channel;
            notes_.item_channel[i] = item_channel;
            notes_.depth[i] = uint8_t(return_depth(n, r));
            notes_.z_context[i] = uint8_t(single + width_context((context->x.width() + context->y.width()) / 2, 18));
            notes_.place[i] = uint8_t(size_t(r >= n) | size_t(r == 1) << 1);
            notes_.time_changed[i] = time_changed;
            notes_.angle_changed[i] = changed >> 3 & 1;
            notes_.source_changed[i] = changed >> 5 & 1;
            store(record + kX, value.x);
            store(record + kY, value.y);
            store(record + kReturns, uint8_t(n << 4 | r));
            store(record + kFlags, uint8_t((channel_flags_ & ~0x30) | channel << 4));
        }
        channel_flags_ = uint8_t((channel_flags_ & ~0x30) | channel << 4);
        layer.leave(decoder);
    }

    template <typename Context, typename Use>
    void for_each_value(size_t index, ChannelModels<Context>& models, Use use) {
        Layer& layer = layers_[index];
        if (!layer.active) return;
        ArithmeticDecoder decoder = layer.decoder;
        Context* context = &models.current();
        for (size_t i = 0; i < notes_.size; ++i) {
            layer.check(decoder);
            if (!models.is_current(notes_.channel[i])) [[unlikely]]
                context = &models.move_to(notes_.channel[i]);
            use(i, context->decode(decoder, notes_, i));
        }
        layer.leave(decoder);
    }

    template <typename Context>
    void decode_field(size_t index, ChannelModels<Context>& models, std::byte* field) {
        for_each_value(index, models, [&](size_t i, auto value) { store(field + i * record_size_, value); });
    }

    void decode_flags(std::byte* field) {
        for_each_value(kFlagsLayer, flags_, [&](size_t i, uint8_t value) {
            store(field + i * record_size_, uint8_t((value & 0x0F) | notes_.channel[i] << 4 | (value >> 4) << 6));
        });
    }

    // Up to version 3, models are chosen by the channel only at points where it changes, and are those of channel 0 at all
    // others; and a channel that is met again goes on from the last value of the channel before, and leaves its own there.
    template <typename Context>
    void decode_item(size_t index, ChannelModels<Context>& models, std::byte* field) {
        Layer& layer = layers_[index];
        if (!layer.active) return;
        ArithmeticDecoder decoder = layer.decoder;
        Context* context = &models.current();
        for (size_t i = 0; i < notes_.size; ++i) {
            layer.check(decoder);
            Context* holder = context;
            const size_t channel = notes_.item_channel[i];
            if (!models.is_current(channel)) [[unlikely]] {
                const bool met_again = models.is_used(channel);
                context = &models.move_to(channel);
                if (!met_again || keeps_channels_) holder = context;
            }
            holder->value = context->decode(decoder, holder->value);
            store(field + i * record_size_, holder->value);
        }
        layer.leave(decoder);
    }

    PointLayout layout_;
    size_t record_size_;
    bool keeps_channels_;  // version 4
    LazSelection selection_;

    uint64_t offset_ = 0, end_ = 0;  // of the chunk, bytes
    std::vector<std::byte> first_;   // record
    bool at_first_ = false;
    std::shared_ptr<const std::vector<std::byte>> bytes_;  // of the layers asked for, and a margin of zeros
    std::vector<Layer> layers_;
    TileNotes notes_;
    uint8_t channel_flags_ = 0;  // the first point's flags with the last point's channel

    ChannelModels<PositionContext> positions_;
    ChannelModels<ZContext> zs_;
    ChannelModels<ClassificationContext> classifications_;
    ChannelModels<FlagsContext> flags_;
    ChannelModels<IntensityContext> intensities_;
    ChannelModels<ScanAngleContext> scan_angles_;
    ChannelModels<UserDataContext> user_data_;
    ChannelModels<PointSourceContext> point_sources_;
    ChannelModels<GpsTimeContext> gps_times_;
    ChannelModels<RgbContext> rgbs_;
    ChannelModels<NirContext> nirs_;
    ChannelModels<WavePacketContext> wave_packets_;
    std::vector<ChannelModels<ExtraByteContext>> extra_bytes_;
};

}  // namespace

std::unique_ptr<LazDecoder> make_layered_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection) {
    return std::make_unique<LayeredDecoder>(header, laz, selection);
}

std::unique_ptr<LazDecoder> make_laz_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection) {
    return laz.layered ? make_layered_decoder(header, laz, selection) : make_pointwise_decoder(header, laz);
}

}  // namespace strata::las
