#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "core/error.h"
#include "io/las/laz_shared_models.h"

namespace strata::las {

// What the layers of point formats 6 to 10 are decoded with, field by field. laz_layered.cpp says how layers hang together.

inline constexpr size_t kTilePoints = 512;  // their notes and records stay in the first cache levels
inline constexpr size_t kChannels = 4;      // scanner channels

/// What the first layer says of each point of a tile.
struct TileNotes {
    size_t size = 0;
    std::array<uint8_t, kTilePoints> channel;       // of the point
    std::array<uint8_t, kTilePoints> item_channel;  // whose models color, wave packets and extra bytes use
    std::array<uint8_t, kTilePoints> depth;         // of the return
    std::array<uint8_t, kTilePoints> z_context;
    std::array<uint8_t, kTilePoints> place;  // of the return: 1 last + 2 first
    std::array<uint8_t, kTilePoints> time_changed, angle_changed, source_changed;
};

/// A value of its own, made when it is first used: copied with its owner.
template <typename T>
class Lazy {
public:
    Lazy() = default;
    Lazy(const Lazy& other) : value_(other.value_ ? std::make_unique<T>(*other.value_) : nullptr) {}
    Lazy& operator=(const Lazy&) = delete;
    T& get() {
        if (!value_) value_ = std::make_unique<T>();
        return *value_;
    }

private:
    std::unique_ptr<T> value_;
};

/// The models of a layer, a set a scanner channel. A channel's models begin where it is first met, from the last value of
/// the channel before. Context has `value`, the last one, and restart(value).
template <typename Context>
class ChannelModels {
public:
    void restart(size_t channel, const decltype(Context::value)& value) {
        used_ = {};
        current_ = channel;
        used_[channel] = true;
        contexts_[channel].get().restart(value);
    }
    Context& current() { return contexts_[current_].get(); }
    bool is_current(size_t channel) const { return channel == current_; }

    Context& move_to(size_t channel) {
        if (!used_[channel]) {
            const auto value = current().value;
            used_[channel] = true;
            contexts_[channel].get().restart(value);
        }
        current_ = channel;
        return current();
    }
    bool is_used(size_t channel) const { return used_[channel]; }

private:
    std::array<Lazy<Context>, kChannels> contexts_;
    std::array<bool, kChannels> used_{};
    size_t current_ = 0;
};

/// The last value of a field in a scanner channel, and the models that the next one is decoded with.
template <typename Value, typename Models>
struct FieldContext {
    Value value{};
    Models models;

    void restart(const Value& last) {
        value = last;
        models.restart();
    }
};

struct Position {
    int32_t x = 0, y = 0;
    uint8_t r = 0, n = 0;
};

struct PositionContext {
    Position value;
    bool time_changed = false;
    std::array<SymbolModel<128>, 8> changes;
    SymbolModel<3> channels;
    std::array<SymbolModel<16>, 16> return_counts, return_numbers;
    SymbolModel<13> return_numbers_same_time;
    IntegerDecompressor<32, 2> x;
    IntegerDecompressor<32, 22> y;
    std::array<StepMedian, 12> x_steps, y_steps;

    void restart(const Position& last) {
        value = last;
        time_changed = false;
        for (auto& model : changes) model.restart();
        channels.restart();
        for (auto& model : return_counts) model.restart();
        for (auto& model : return_numbers) model.restart();
        return_numbers_same_time.restart();
        x.restart();
        y.restart();
        x_steps = y_steps = {};
    }
};

struct ZContext {
    int32_t value = 0;
    std::array<int32_t, 8> by_depth{};
    IntegerDecompressor<32, 20> models;

    void restart(int32_t last) {
        value = last;
        by_depth.fill(last);
        models.restart();
    }
    int32_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        int32_t& last = by_depth[notes.depth[i]];
        return last = value = models.decode(decoder, last, notes.z_context[i]);
    }
};

struct ClassificationContext : FieldContext<uint8_t, ModelBank<256>> {
    uint8_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        return value = uint8_t(decoder.symbol(models[uint8_t((value & 31) << 1 | (notes.place[i] == 3))]));
    }
};

// The flags are bits 0-3 classification flags, 4 scan direction, 5 edge of flight line.
struct FlagsContext : FieldContext<uint8_t, ModelBank<64>> {
    uint8_t decode(ArithmeticDecoder& decoder, const TileNotes&, size_t) { return value = uint8_t(decoder.symbol(models[value])); }
};

struct IntensityContext {
    uint16_t value = 0;
    std::array<uint16_t, 8> by_place{};
    IntegerDecompressor<16, 4> models;

    void restart(uint16_t last) {
        value = last;
        by_place.fill(last);
        models.restart();
    }
    uint16_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        uint16_t& last = by_place[size_t(notes.place[i] << 1 | notes.time_changed[i])];
        return last = value = uint16_t(models.decode(decoder, last, notes.place[i]));
    }
};

struct ScanAngleContext : FieldContext<uint16_t, IntegerDecompressor<16, 2>> {
    uint16_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        if (notes.angle_changed[i]) value = uint16_t(models.decode(decoder, value, notes.time_changed[i]));
        return value;
    }
};

struct UserDataContext : FieldContext<uint8_t, ModelBank<256>> {
    uint8_t decode(ArithmeticDecoder& decoder, const TileNotes&, size_t) { return value = uint8_t(decoder.symbol(models[value / 4])); }
};

struct PointSourceContext : FieldContext<uint16_t, IntegerDecompressor<16, 1>> {
    uint16_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        if (notes.source_changed[i]) value = uint16_t(models.decode(decoder, value, 0));
        return value;
    }
};

struct GpsTimeContext {
    uint64_t value = 0;
    bool ok = true;
    GpsTimeModels<false> models;

    void restart(uint64_t last) {
        value = last;
        ok = true;
        models.restart(last);
    }
    uint64_t decode(ArithmeticDecoder& decoder, const TileNotes& notes, size_t i) {
        if (notes.time_changed[i]) {
            value = models.decode(decoder, ok);
            if (!ok) [[unlikely]]
                throw Error(ErrorKind::malformed, "GPS times that no encoder writes");
        }
        return value;
    }
};

// The contexts of items behind the point decode from a last value that may be another channel's.

struct RgbContext : FieldContext<Rgb, RgbModels> {
    Rgb decode(ArithmeticDecoder& decoder, const Rgb& last) { return models.decode(decoder, last); }
};

struct NirContext {
    uint16_t value = 0;
    SymbolModel<4> changes;
    std::array<SymbolModel<256>, 2> differences;

    void restart(uint16_t last) {
        value = last;
        changes.restart();
        for (auto& model : differences) model.restart();
    }
    uint16_t decode(ArithmeticDecoder& decoder, uint16_t last) {
        const uint32_t changed = decoder.symbol(changes);
        uint8_t lower = uint8_t(last), upper = uint8_t(last >> 8);
        if (changed & 1) lower = uint8_t(lower + decoder.symbol(differences[0]));
        if (changed & 2) upper = uint8_t(upper + decoder.symbol(differences[1]));
        return uint16_t(upper << 8 | lower);
    }
};

struct WavePacketContext : FieldContext<WavePacketModels::Packet, WavePacketModels> {
    WavePacketModels::Packet decode(ArithmeticDecoder& decoder, const WavePacketModels::Packet& last) { return models.decode(decoder, last); }
};

struct ExtraByteContext : FieldContext<uint8_t, SymbolModel<256>> {
    uint8_t decode(ArithmeticDecoder& decoder, uint8_t last) { return uint8_t(last + decoder.symbol(models)); }
};

}  // namespace strata::las
