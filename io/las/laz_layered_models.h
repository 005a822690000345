#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "core/error.h"
#include "io/las/laz_shared_models.h"

namespace strata::las {

// What the layers of point formats 6 to 10 are coded with, field by field. laz_layered_points.h says how layers hang together.

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
    /// The last value of the channel, or what its models will begin from.
    const auto& last_value(size_t channel) { return contexts_[used_[channel] ? channel : current_].get().value; }

private:
    std::array<Lazy<Context>, kChannels> contexts_;
    std::array<bool, kChannels> used_{};
    size_t current_ = 0;
};

/// The last value of a field in a scanner channel, and the models that the next one is coded with.
template <typename Value, typename Models>
struct FieldContext {
    Value value{};
    Models models;

    void restart(const Value& last) {
        value = last;
        models.restart();
    }
};

/// What the first layer holds, and what it says of others: of these an encoder alone knows the values here.
struct Position {
    int32_t x = 0, y = 0;
    uint8_t r = 0, n = 0;
    uint16_t scan_angle = 0, point_source = 0;
    uint64_t gps_time = 0;
};

template <typename Coder>
struct PositionContext {
    Position value;
    bool time_changed = false;
    std::array<typename Coder::template Symbols<128>, 8> changes;
    typename Coder::template Symbols<3> channels;
    std::array<typename Coder::template Symbols<16>, 16> return_counts, return_numbers;
    typename Coder::template Symbols<13> return_numbers_same_time;
    IntegerModels<Coder, 32, 2> x;
    IntegerModels<Coder, 32, 22> y;
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

template <typename Coder>
struct ZContext {
    int32_t value = 0;
    std::array<int32_t, 8> by_depth{};
    IntegerModels<Coder, 32, 20> models;

    void restart(int32_t last) {
        value = last;
        by_depth.fill(last);
        models.restart();
    }
    [[gnu::always_inline]] int32_t code(Coder& coder, const TileNotes& notes, size_t i, int32_t told) {
        int32_t& last = by_depth[notes.depth[i]];
        return last = value = models.code(coder, last, notes.z_context[i], told);
    }
};

template <typename Coder>
struct ClassificationContext : FieldContext<uint8_t, ModelBank<Coder, 256>> {
    [[gnu::always_inline]] uint8_t code(Coder& coder, const TileNotes& notes, size_t i, uint8_t told) {
        return this->value = uint8_t(coder.symbol(this->models[uint8_t((this->value & 31) << 1 | (notes.place[i] == 3))], told));
    }
};

// The flags are bits 0-3 classification flags, 4 scan direction, 5 edge of flight line.
template <typename Coder>
struct FlagsContext : FieldContext<uint8_t, ModelBank<Coder, 64>> {
    [[gnu::always_inline]] uint8_t code(Coder& coder, const TileNotes&, size_t, uint8_t told) {
        return this->value = uint8_t(coder.symbol(this->models[this->value], told));
    }
};

template <typename Coder>
struct IntensityContext {
    uint16_t value = 0;
    std::array<uint16_t, 8> by_place{};
    IntegerModels<Coder, 16, 4> models;

    void restart(uint16_t last) {
        value = last;
        by_place.fill(last);
        models.restart();
    }
    [[gnu::always_inline]] uint16_t code(Coder& coder, const TileNotes& notes, size_t i, uint16_t told) {
        uint16_t& last = by_place[size_t(notes.place[i] << 1 | notes.time_changed[i])];
        return last = value = uint16_t(models.code(coder, last, notes.place[i], told));
    }
};

template <typename Coder>
struct ScanAngleContext : FieldContext<uint16_t, IntegerModels<Coder, 16, 2>> {
    [[gnu::always_inline]] uint16_t code(Coder& coder, const TileNotes& notes, size_t i, uint16_t told) {
        if (notes.angle_changed[i]) this->value = uint16_t(this->models.code(coder, this->value, notes.time_changed[i], told));
        return this->value;
    }
};

template <typename Coder>
struct UserDataContext : FieldContext<uint8_t, ModelBank<Coder, 256>> {
    [[gnu::always_inline]] uint8_t code(Coder& coder, const TileNotes&, size_t, uint8_t told) {
        return this->value = uint8_t(coder.symbol(this->models[this->value / 4], told));
    }
};

template <typename Coder>
struct PointSourceContext : FieldContext<uint16_t, IntegerModels<Coder, 16, 1>> {
    [[gnu::always_inline]] uint16_t code(Coder& coder, const TileNotes& notes, size_t i, uint16_t told) {
        if (notes.source_changed[i]) this->value = uint16_t(this->models.code(coder, this->value, 0, told));
        return this->value;
    }
};

template <typename Coder>
struct GpsTimeContext {
    uint64_t value = 0;
    bool ok = true;
    GpsTimeModels<Coder, false> models;

    void restart(uint64_t last) {
        value = last;
        ok = true;
        models.restart(last);
    }
    [[gnu::always_inline]] uint64_t code(Coder& coder, const TileNotes& notes, size_t i, uint64_t told) {
        if (notes.time_changed[i]) {
            value = models.code(coder, ok, told);
            if (!ok) [[unlikely]]
                throw Error(ErrorKind::malformed, "GPS times that no encoder writes");
        }
        return value;
    }
};

// The contexts of items behind the point code from a last value that may be another channel's.

template <typename Coder>
struct RgbContext : FieldContext<Rgb, RgbModels<Coder>> {
    [[gnu::always_inline]] Rgb code(Coder& coder, const Rgb& last, const Rgb& told) { return this->models.code(coder, last, told); }
};

template <typename Coder>
struct NirContext {
    uint16_t value = 0;
    typename Coder::template Symbols<4> changes;
    std::array<typename Coder::template Symbols<256>, 2> differences;

    void restart(uint16_t last) {
        value = last;
        changes.restart();
        for (auto& model : differences) model.restart();
    }
    [[gnu::always_inline]] uint16_t code(Coder& coder, uint16_t last, uint16_t told) {
        const uint32_t differ = uint32_t(last ^ told);
        const uint32_t changed = coder.symbol(changes, uint32_t((differ & 0xFF) != 0) | uint32_t(differ > 0xFF) << 1);
        uint8_t lower = uint8_t(last), upper = uint8_t(last >> 8);
        if (changed & 1) lower = uint8_t(lower + coder.symbol(differences[0], uint8_t(told - last)));
        if (changed & 2) upper = uint8_t(upper + coder.symbol(differences[1], uint8_t((told >> 8) - (last >> 8))));
        return uint16_t(upper << 8 | lower);
    }
};

template <typename Coder>
struct WavePacketContext : FieldContext<WavePacket, WavePacketModels<Coder>> {
    [[gnu::always_inline]] WavePacket code(Coder& coder, const WavePacket& last, const WavePacket& told) { return this->models.code(coder, last, told); }
};

template <typename Coder>
struct ExtraByteContext : FieldContext<uint8_t, typename Coder::template Symbols<256>> {
    [[gnu::always_inline]] uint8_t code(Coder& coder, uint8_t last, uint8_t told) { return uint8_t(last + coder.symbol(this->models, uint8_t(told - last))); }
};

}  // namespace strata::las
