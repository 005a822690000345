#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "core/error.h"
#include "io/las/las_layout.h"
#include "io/las/laz_layered_models.h"
#include "io/las/laz_returns.h"

// Points of formats 6 to 10: a stream of symbols for each field, so that fields nobody asked for need not be read.
// The first layer, returns and x and y, says which channel each point belongs to and whether time, scan angle and source
// change; what the other layers need of that is noted a tile at a time, and one or two of them at once code the tile in a loop of
// their own.

namespace strata::las {

// Where fields lie in the record.
inline constexpr size_t kX = 0, kY = 4, kZ = 8, kIntensity = 12, kReturns = 14, kFlags = 15, kClassification = 16, kUserData = 17, kScanAngle = 18,
                        kPointSource = 20, kGpsTime = 22;

/// The order of the layers in a chunk; one for each item behind the point follows, and for each extra byte.
enum LayerIndex { kPositions, kZs, kClassifications, kFlagsLayer, kIntensities, kScanAngles, kUserDatas, kPointSources, kGpsTimes, kItems };

inline size_t layer_count(const PointLayout& layout, size_t record_size) {
    return kItems + (layout.nir ? 2u : layout.rgb ? 1u : 0u) + (layout.wave ? 1 : 0) + (record_size - layout.size);
}

/// Whether an encoder says that the GPS time changed. The reference encoder compares doubles, to which not-a-number is never the
/// same; but to it -0 and 0 are, and one would come back for the other.
inline bool time_changes(uint64_t last, uint64_t next) {
    constexpr uint64_t kInfinity = 0x7FF0000000000000;
    return int(last != next) | int((next & ~(uint64_t{1} << 63)) > kInfinity);
}

/// The flags that are coded together, of the record's byte.
inline uint8_t flags_of(uint8_t record_byte) { return uint8_t((record_byte & 0x0F) | (record_byte >> 6) << 4); }
inline uint8_t record_byte_of(uint8_t flags, uint8_t channel) { return uint8_t((flags & 0x0F) | channel << 4 | (flags >> 4) << 6); }

template <typename T>
T load_field(const std::byte* at) {
    if constexpr (std::is_same_v<T, WavePacket>) {
        return WavePacket::load(at);
    } else {
        T value;
        std::memcpy(&value, at, sizeof value);
        return value;
    }
}
template <typename T>
void store_field(std::byte* at, const T& value) {
    if constexpr (std::is_same_v<T, WavePacket>)
        value.store(at);
    else
        std::memcpy(at, &value, sizeof value);
}

/// The records of a chunk from the second on, tile by tile, to or from its layers.
/// Layer::Coder codes; a Layer has `active` (else its field is that of the first point in all records, or not asked for), enter(points),
/// which gives the coder for that many, check(coder) before each point and leave(coder) behind the last.
template <typename Layer>
class LayeredPoints {
public:
    using Coder = typename Layer::Coder;
    static constexpr bool kEncodes = Coder::kEncodes;
    using Byte = std::conditional_t<kEncodes, const std::byte, std::byte>;

    /// keeps_channels: items of version 4.
    LayeredPoints(const PointLayout& layout, size_t record_size, bool keeps_channels)
        : layers(layer_count(layout, record_size)),
          layout_(layout),
          record_size_(record_size),
          keeps_channels_(keeps_channels),
          extra_bytes_(record_size - layout.size) {}

    std::vector<Layer> layers;

    /// Begins a chunk with its first record. Which layers are active must be known.
    void restart(const std::byte* first) {
        const uint8_t flags = load_field<uint8_t>(first + kFlags);
        const size_t channel = flags >> 4 & 3;
        channel_flags_ = flags;
        positions_.restart(channel, position_of(first));
        const auto restart = [&](size_t layer, auto& models, const auto& value) {
            if (layers[layer].active) models.restart(channel, value);
        };
        restart(kZs, zs_, load_field<int32_t>(first + kZ));
        restart(kClassifications, classifications_, load_field<uint8_t>(first + kClassification));
        restart(kFlagsLayer, flags_, flags_of(flags));
        restart(kIntensities, intensities_, load_field<uint16_t>(first + kIntensity));
        restart(kScanAngles, scan_angles_, load_field<uint16_t>(first + kScanAngle));
        restart(kUserDatas, user_data_, load_field<uint8_t>(first + kUserData));
        restart(kPointSources, point_sources_, load_field<uint16_t>(first + kPointSource));
        restart(kGpsTimes, gps_times_, load_field<uint64_t>(first + kGpsTime));
        size_t layer = kItems;
        if (layout_.rgb) restart(layer++, rgbs_, load_field<Rgb>(first + layout_.rgb));
        if (layout_.nir) restart(layer++, nirs_, load_field<uint16_t>(first + layout_.nir));
        if (layout_.wave) restart(layer++, wave_packets_, load_field<WavePacket>(first + layout_.wave));
        for (size_t i = 0; i < extra_bytes_.size(); ++i) restart(layer++, extra_bytes_[i], load_field<uint8_t>(first + layout_.size + i));
    }

    /// The next `size` records, at most kTilePoints. A decoder writes the fields of active layers and leaves the others.
    void code_tile(size_t size, Byte* records) {
        notes_.size = size;
        code_positions(records);
        code_both(field(kZs, zs_, records + kZ), field(kIntensities, intensities_, records + kIntensity));
        code_both(field(kClassifications, classifications_, records + kClassification), field(kFlagsLayer, flags_, records + kFlags));
        code_both(field(kScanAngles, scan_angles_, records + kScanAngle), field(kUserDatas, user_data_, records + kUserData));
        code_one(field(kPointSources, point_sources_, records + kPointSource));
        const auto gps_times = field(kGpsTimes, gps_times_, records + kGpsTime);
        size_t layer = kItems;
        if (layout_.rgb)
            code_both(gps_times, item(layer++, rgbs_, records + layout_.rgb));
        else
            code_one(gps_times);
        if (layout_.nir) code_one(item(layer++, nirs_, records + layout_.nir));
        if (layout_.wave) code_one(item(layer++, wave_packets_, records + layout_.wave));
        for (size_t i = 0; i < extra_bytes_.size(); ++i) code_one(item(layer++, extra_bytes_[i], records + layout_.size + i));
    }

private:
    static Position position_of(const std::byte* record) {
        const uint8_t returns = load_field<uint8_t>(record + kReturns);
        return {load_field<int32_t>(record + kX),           load_field<int32_t>(record + kY),
                uint8_t(returns & 15),                      uint8_t(returns >> 4),
                load_field<uint16_t>(record + kScanAngle),  load_field<uint16_t>(record + kPointSource),
                load_field<uint64_t>(record + kGpsTime)};
    }

    // Bits 0 and 1: the return number's step is 0, 1, -1, another; 2 to 5: what else changed since the last point of the channel.
    static uint32_t changes_of(const Position& last, const Position& next) {
        constexpr std::array<uint8_t, 16> kReturnStep = {0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 2};
        return kReturnStep[(next.r - last.r) & 15] | uint32_t(next.n != last.n) << 2 |
               uint32_t(next.scan_angle != last.scan_angle) << 3 | uint32_t(time_changes(last.gps_time, next.gps_time)) << 4 |
               uint32_t(next.point_source != last.point_source) << 5;
    }

    void code_positions(Byte* record) {
        Layer& layer = layers[kPositions];
        Coder coder = layer.enter(notes_.size);
        PositionContext<Coder>* context = &positions_.current();
        uint8_t channel = channel_flags_ >> 4 & 3;
        for (size_t i = 0; i < notes_.size; ++i, record += record_size_) {
            layer.check(coder);
            const unsigned last_r = context->value.r, last_n = context->value.n;
            const size_t kind = size_t(last_r == 1) | size_t(last_r >= last_n) << 1 | size_t(context->time_changed) << 2;
            Position told;
            uint32_t changed = 0, channel_step = 0;
            if constexpr (kEncodes) {
                told = position_of(record);
                const uint8_t next = load_field<uint8_t>(record + kFlags) >> 4 & 3;
                channel_step = uint32_t(next - channel - 1) & 3;
                changed = next == channel ? changes_of(context->value, told) : changes_of(positions_.last_value(next), told) | 64;
            }
            changed = coder.symbol(context->changes[kind], changed);
            uint8_t item_channel = keeps_channels_ ? channel : 0;
            if (changed & 64) [[unlikely]] {
                channel = uint8_t((channel + coder.symbol(context->channels, channel_step) + 1) & 3);
                context = &positions_.move_to(channel);
                item_channel = channel;
            }
            Position& value = context->value;
            const bool time_changed = changed & 16;
            context->time_changed = time_changed;
            if (changed & 4) value.n = uint8_t(coder.symbol(context->return_counts[value.n], told.n));
            switch (changed & 3) {
                case 0: break;
                case 1: value.r = (value.r + 1) & 15; break;
                case 2: value.r = (value.r + 15) & 15; break;
                default:
                    value.r = uint8_t(time_changed ? coder.symbol(context->return_numbers[value.r], told.r)
                                                   : (value.r + coder.symbol(context->return_numbers_same_time, (told.r - value.r - 2u) & 15) + 2) & 15);
            }
            const unsigned r = value.r, n = value.n;
            const size_t steps = return_class_6(n, r) << 1 | size_t(time_changed), single = n == 1;
            const auto difference = [](int32_t a, int32_t b) { return int32_t(uint32_t(a) - uint32_t(b)); };
            const int32_t step_x = context->x.code(coder, context->x_steps[steps].median(), single, difference(told.x, value.x));
            context->x_steps[steps].add(step_x);
            value.x = int32_t(uint32_t(value.x) + uint32_t(step_x));
            const int32_t step_y =
                context->y.code(coder, context->y_steps[steps].median(), single + width_context(context->x.width(), 20), difference(told.y, value.y));
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
            if constexpr (kEncodes) {
                value = told;
            } else {
                store_field(record + kX, value.x);
                store_field(record + kY, value.y);
                store_field(record + kReturns, uint8_t(n << 4 | r));
                store_field(record + kFlags, uint8_t((channel_flags_ & ~0x30) | channel << 4));
            }
        }
        channel_flags_ = uint8_t((channel_flags_ & ~0x30) | channel << 4);
        layer.leave(coder);
    }

    /// A layer on its way through a tile.
    template <typename Context>
    struct FieldPass {
        using Value = decltype(Context::value);
        static constexpr bool kIsFlags = std::is_same_v<Context, FlagsContext<Coder>>;

        LayeredPoints& points;
        Layer& layer;
        ChannelModels<Context>& models;
        Byte* at;
        Coder coder;
        Context* context;

        [[gnu::always_inline]] void step(size_t i) {
            const TileNotes& notes = points.notes_;
            layer.check(coder);
            if (!models.is_current(notes.channel[i])) [[unlikely]]
                context = &models.move_to(notes.channel[i]);
            if constexpr (kEncodes && kIsFlags)
                context->code(coder, notes, i, flags_of(load_field<uint8_t>(at)));
            else if constexpr (kEncodes)
                context->code(coder, notes, i, load_field<Value>(at));
            else if constexpr (kIsFlags)
                store_field(at, record_byte_of(context->code(coder, notes, i, {}), notes.channel[i]));
            else
                store_field(at, context->code(coder, notes, i, {}));
            at += points.record_size_;
        }
    };

    /// The same for an item behind the point. Up to version 3, models are chosen by the channel only at points where it changes,
    /// and are those of channel 0 at all others; and a channel that is met again goes on from the last value of the channel
    /// before, and leaves its own there.
    template <typename Context>
    struct ItemPass {
        using Value = decltype(Context::value);

        LayeredPoints& points;
        Layer& layer;
        ChannelModels<Context>& models;
        Byte* at;
        Coder coder;
        Context* context;

        [[gnu::always_inline]] void step(size_t i) {
            layer.check(coder);
            Context* holder = context;
            const size_t channel = points.notes_.item_channel[i];
            if (!models.is_current(channel)) [[unlikely]] {
                const bool met_again = models.is_used(channel);
                context = &models.move_to(channel);
                if (!met_again || points.keeps_channels_) holder = context;
            }
            if constexpr (kEncodes) {
                const Value told = load_field<Value>(at);
                context->code(coder, holder->value, told);
                holder->value = told;
            } else {
                holder->value = context->code(coder, holder->value, {});
                store_field(at, holder->value);
            }
            at += points.record_size_;
        }
    };

    /// A layer that may be inactive, and where its first value is in the tile.
    template <template <typename> typename Pass, typename Context>
    struct Field {
        LayeredPoints& points;
        Layer& layer;
        ChannelModels<Context>& models;
        Byte* at;

        Pass<Context> enter() const { return {points, layer, models, at, layer.enter(points.notes_.size), &models.current()}; }
    };
    template <typename Context>
    Field<FieldPass, Context> field(size_t index, ChannelModels<Context>& models, Byte* at) {
        return {*this, layers[index], models, at};
    }
    template <typename Context>
    Field<ItemPass, Context> item(size_t index, ChannelModels<Context>& models, Byte* at) {
        return {*this, layers[index], models, at};
    }

    template <typename A>
    void code_one(const A& a) {
        if (a.layer.active) run(a.enter());
    }
    // Each symbol of a layer waits for the one before it; those of another layer do not.
    template <typename A, typename B>
    void code_both(const A& a, const B& b) {
        if (a.layer.active && b.layer.active) {
            run(a.enter(), b.enter());
        } else {
            code_one(a);
            code_one(b);
        }
    }
    template <typename... Passes>
    void run(Passes... passes) {
        for (size_t i = 0; i < notes_.size; ++i) (passes.step(i), ...);
        (passes.layer.leave(passes.coder), ...);
    }

    PointLayout layout_;
    size_t record_size_;
    bool keeps_channels_;
    TileNotes notes_;
    uint8_t channel_flags_ = 0;  // the first point's flags with the last point's channel

    ChannelModels<PositionContext<Coder>> positions_;
    ChannelModels<ZContext<Coder>> zs_;
    ChannelModels<ClassificationContext<Coder>> classifications_;
    ChannelModels<FlagsContext<Coder>> flags_;
    ChannelModels<IntensityContext<Coder>> intensities_;
    ChannelModels<ScanAngleContext<Coder>> scan_angles_;
    ChannelModels<UserDataContext<Coder>> user_data_;
    ChannelModels<PointSourceContext<Coder>> point_sources_;
    ChannelModels<GpsTimeContext<Coder>> gps_times_;
    ChannelModels<RgbContext<Coder>> rgbs_;
    ChannelModels<NirContext<Coder>> nirs_;
    ChannelModels<WavePacketContext<Coder>> wave_packets_;
    std::vector<ChannelModels<ExtraByteContext<Coder>>> extra_bytes_;
};

}  // namespace strata::las
