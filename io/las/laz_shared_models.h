#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "io/las/arithmetic_decoder.h"
#include "io/las/integer_decompressor.h"

// What the pointwise items of version 2 and the layered items have in common.

namespace strata::las {

/// A coordinate's usual step: the median of five steps, of which each new one drives out, in turns, the largest or the
/// smallest; the turn changes when a step falls on the far side of the median.
class StepMedian {
public:
    int32_t median() const { return steps_[2]; }

    void add(int32_t step) {
        const int32_t* const kept = steps_.data() + (drop_smallest_ ? 1 : 0);
        const std::array<int32_t, 4> old = {kept[0], kept[1], kept[2], kept[3]};
        drop_smallest_ = drop_smallest_ ? step > steps_[2] : step >= steps_[2];
        steps_[0] = std::min(step, old[0]);
        for (size_t i = 1; i < 4; ++i) steps_[i] = std::max(old[i - 1], std::min(step, old[i]));
        steps_[4] = std::max(old[3], step);
    }

private:
    std::array<int32_t, 5> steps_{};  // ascending
    bool drop_smallest_ = false;
};

/// Models of which one is chosen by a value that seldom takes many: each is made when it is first needed.
template <int Symbols>
class ModelBank {
public:
    using Model = SymbolModel<Symbols>;

    void restart() {
        used_ = 0;
        slots_.fill(0);
    }
    Model& operator[](uint8_t index) {
        uint16_t slot = slots_[index];
        if (slot == 0) [[unlikely]] {
            slots_[index] = slot = ++used_;
            if (models_.size() < used_) models_.emplace_back();
            models_[slot - 1u].restart();
        }
        return models_[slot - 1u];
    }

private:
    std::array<uint16_t, 256> slots_{};  // 1 + place in models_; 0: none
    uint16_t used_ = 0;
    std::vector<Model> models_;
};

/// The context of y's and z's correction, from the bits that those before it needed.
constexpr size_t width_context(uint32_t width, uint32_t most) { return width < most ? width & ~1u : most; }

/// GPS times as multiples of the last difference, in up to four interleaved sequences. They are the bits of a double, taken
/// as an integer. `HasRepeat`: a code says that the time is that of the point before (version 2); layered points say so elsewhere.
template <bool HasRepeat>
class GpsTimeModels {
public:
    void restart(uint64_t time) {
        multiples_.restart();
        after_zero_.restart();
        integers_.restart();
        sequences_ = {};
        sequences_[0].time = time;
        current_ = newest_ = 0;
    }
    uint64_t time() const { return sequences_[current_].time; }

    /// Returns the next time, or that of before with *ok = false where no encoder would go on switching sequences.
    uint64_t decode(ArithmeticDecoder& decoder, bool& ok) {
        // An encoder switches at most once a point.
        for (int tries = 0; tries < kMostSwitches; ++tries) {
            Sequence& sequence = sequences_[current_];
            const int to_switch = sequence.difference == 0 ? decode_after_zero(decoder, sequence) : decode_multiple(decoder, sequence);
            if (to_switch == 0) return time();
            current_ = (current_ + uint32_t(to_switch)) & 3;
        }
        ok = false;
        return time();
    }

private:
    static constexpr int kMostSwitches = 4;
    static constexpr int kLargest = 500, kMostNegative = 10;
    static constexpr int kRepeat = kLargest + kMostNegative + 1;  // only with HasRepeat
    static constexpr int kFull = kLargest + kMostNegative + 1 + HasRepeat;

    struct Sequence {
        uint64_t time = 0;
        int32_t difference = 0;
        int32_t extremes = 0;  // multiples beyond the range, since the difference was set
    };

    static void step(Sequence& sequence, int32_t difference) { sequence.time += uint64_t(int64_t(difference)); }

    // Both return how many sequences to move on and try there; 0: done.
    int decode_after_zero(ArithmeticDecoder& decoder, Sequence& sequence) {
        int code = int(decoder.symbol(after_zero_));
        if (HasRepeat && code-- == 0) return 0;
        if (code > 1) return code - 1;
        if (code == 1) {
            begin_sequence(decoder, sequence);
        } else {
            sequence.difference = integers_.decode(decoder, 0, 0);
            sequence.extremes = 0;
            step(sequence, sequence.difference);
        }
        return 0;
    }

    int decode_multiple(ArithmeticDecoder& decoder, Sequence& sequence) {
        const int code = int(decoder.symbol(multiples_));
        if (code > kFull) return code - kFull;
        if (code == kFull) {
            begin_sequence(decoder, sequence);
            return 0;
        }
        if (HasRepeat && code == kRepeat) return 0;
        if (code == 1) {
            step(sequence, integers_.decode(decoder, sequence.difference, 1));
            sequence.extremes = 0;
            return 0;
        }
        const int multiple = code <= kLargest ? code : std::max(kLargest - code, -kMostNegative);
        const size_t context = code == 0                ? 7
                               : code < 10              ? 2
                               : code < kLargest        ? 3
                               : code == kLargest       ? 4
                               : multiple > -kMostNegative ? 5
                                                        : 6;
        const int32_t difference = integers_.decode(decoder, int32_t(uint32_t(multiple) * uint32_t(sequence.difference)), context);
        if (context == 7 || context == 4 || context == 6)
            if (++sequence.extremes > 3) {
                sequence.difference = difference;
                sequence.extremes = 0;
            }
        step(sequence, difference);
        return 0;
    }

    void begin_sequence(ArithmeticDecoder& decoder, const Sequence& before) {
        const uint32_t upper = uint32_t(integers_.decode(decoder, int32_t(before.time >> 32), 8));
        const uint32_t lower = decoder.raw_bits(32);
        newest_ = (newest_ + 1) & 3;
        sequences_[newest_] = {uint64_t(upper) << 32 | lower, 0, 0};
        current_ = newest_;
    }

    SymbolModel<kFull + 4> multiples_;
    SymbolModel<5 + HasRepeat> after_zero_;
    IntegerDecompressor<32, 9> integers_;
    std::array<Sequence, 4> sequences_{};
    uint32_t current_ = 0, newest_ = 0;
};

using Rgb = std::array<uint16_t, 3>;

/// Colors as differences of the color before, byte by byte; red's differences predict those of green, both those of blue.
class RgbModels {
public:
    void restart() {
        changes_.restart();
        for (auto& model : differences_) model.restart();
    }

    [[gnu::always_inline]] Rgb decode(ArithmeticDecoder& decoder, const Rgb& last) {
        // Bits 0 to 5: the lower and upper byte of red, green, blue changed; 6: green and blue are not red's.
        const uint32_t changed = decoder.symbol(changes_);
        const auto byte = [&](int place, int predicted, int unchanged) {
            return changed >> place & 1 ? uint8_t(predicted + int(decoder.symbol(differences_[size_t(place)]))) : uint8_t(unchanged);
        };
        const auto lower = [](uint16_t value) { return value & 0xFF; };
        const auto upper = [](uint16_t value) { return value >> 8; };
        const auto clamped = [](int value) { return std::clamp(value, 0, 255); };
        const int red_lower = byte(0, lower(last[0]), lower(last[0]));
        const int red_upper = byte(1, upper(last[0]), upper(last[0]));
        const uint16_t red = uint16_t(red_upper << 8 | red_lower);
        if (!(changed >> 6 & 1)) return {red, red, red};

        const int red_lower_step = red_lower - lower(last[0]), red_upper_step = red_upper - upper(last[0]);
        const int green_lower = byte(2, clamped(red_lower_step + lower(last[1])), lower(last[1]));
        const int blue_lower_step = (red_lower_step + green_lower - lower(last[1])) / 2;
        const int blue_lower = byte(4, clamped(blue_lower_step + lower(last[2])), lower(last[2]));
        const int green_upper = byte(3, clamped(red_upper_step + upper(last[1])), upper(last[1]));
        const int blue_upper_step = (red_upper_step + green_upper - upper(last[1])) / 2;
        const int blue_upper = byte(5, clamped(blue_upper_step + upper(last[2])), upper(last[2]));
        return {red, uint16_t(green_upper << 8 | green_lower), uint16_t(blue_upper << 8 | blue_lower)};
    }

private:
    SymbolModel<128> changes_;
    std::array<SymbolModel<256>, 6> differences_;
};

/// References into waveform data: 29 bytes, the index of a descriptor and the rest as in the record.
class WavePacketModels {
public:
    static constexpr size_t kBytes = 29;
    struct Packet {
        uint8_t descriptor = 0;
        uint64_t offset = 0;
        uint32_t size = 0;
        std::array<int32_t, 4> floats{};  // return point, x(t), y(t), z(t): the bits of floats

        static Packet load(const std::byte* record) {
            Packet packet;
            std::memcpy(&packet.descriptor, record, 1);
            std::memcpy(&packet.offset, record + 1, 8);
            std::memcpy(&packet.size, record + 9, 4);
            std::memcpy(packet.floats.data(), record + 13, 16);
            return packet;
        }
        void store(std::byte* record) const {
            std::memcpy(record, &descriptor, 1);
            std::memcpy(record + 1, &offset, 8);
            std::memcpy(record + 9, &size, 4);
            std::memcpy(record + 13, floats.data(), 16);
        }
    };

    void restart() {
        descriptors_.restart();
        for (auto& model : offset_codes_) model.restart();
        offset_steps_.restart();
        sizes_.restart();
        return_points_.restart();
        directions_.restart();
        offset_code_ = 0;
        offset_step_ = 0;
    }

    Packet decode(ArithmeticDecoder& decoder, const Packet& last) {
        Packet packet;
        packet.descriptor = uint8_t(decoder.symbol(descriptors_));
        offset_code_ = decoder.symbol(offset_codes_[offset_code_]);
        switch (offset_code_) {
            case 0: packet.offset = last.offset; break;
            case 1: packet.offset = last.offset + last.size; break;
            case 2:
                offset_step_ = offset_steps_.decode(decoder, offset_step_, 0);
                packet.offset = last.offset + uint64_t(int64_t(offset_step_));
                break;
            default: packet.offset = decoder.raw_bits_64();
        }
        packet.size = uint32_t(sizes_.decode(decoder, int32_t(last.size), 0));
        packet.floats[0] = return_points_.decode(decoder, last.floats[0], 0);
        for (size_t axis = 0; axis < 3; ++axis) packet.floats[1 + axis] = directions_.decode(decoder, last.floats[1 + axis], axis);
        return packet;
    }

private:
    SymbolModel<256> descriptors_;
    std::array<SymbolModel<4>, 4> offset_codes_;  // by the code before
    IntegerDecompressor<32, 1> offset_steps_, sizes_, return_points_;
    IntegerDecompressor<32, 3> directions_;
    uint32_t offset_code_ = 0;
    int32_t offset_step_ = 0;
};

}  // namespace strata::las
