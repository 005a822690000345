#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <vector>

#include "io/las/integer_models.h"

// What the pointwise items of version 2 and the layered items have in common. Each is written once for both directions: an
// encoder is told the values, finds the symbols that choose among the ways to code them, and then goes the decoder's way; what
// it is told is the last argument, which a decoder does without. What runs at each point is always inlined: a coder whose address
// a call has does not stay in registers.

namespace strata::las {

/// A coordinate's usual step: the median of five steps, of which each new one drives out, in turns, the largest or the
/// smallest; the turn changes when a step falls on the far side of the median.
class StepMedian {
public:
    int32_t median() const { return steps_[2]; }

    void add(int32_t step) {
        const int32_t* const kept = steps_.data() + (drop_smallest_ ? 1 : 0);
        const std::array<int32_t, 4> old = {kept[0], kept[1], kept[2], kept[3]};
        drop_smallest_ = int64_t(step) + !drop_smallest_ > steps_[2];  // a step equal to the median changes the turn; no branch
        steps_[0] = std::min(step, old[0]);
        for (size_t i = 1; i < 4; ++i) steps_[i] = std::max(old[i - 1], std::min(step, old[i]));
        steps_[4] = std::max(old[3], step);
    }

private:
    std::array<int32_t, 5> steps_{};  // ascending
    bool drop_smallest_ = false;
};

/// Models of which one is chosen by a value that seldom takes many: each is made when it is first needed.
template <typename Coder, int Symbols>
class ModelBank {
public:
    using Model = typename Coder::template Symbols<Symbols>;

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
template <typename Coder, bool HasRepeat>
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
    [[gnu::always_inline]] uint64_t code(Coder& coder, bool& ok, uint64_t next = 0) {
        // An encoder switches at most once a point.
        for (int tries = 0; tries < kMostSwitches; ++tries) {
            Sequence& sequence = sequences_[current_];
            const int to_switch = sequence.difference == 0 ? code_after_zero(coder, sequence, next) : code_multiple(coder, sequence, next);
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
    static int32_t step_to(const Sequence& sequence, uint64_t next) { return int32_t(uint32_t(next - sequence.time)); }
    static bool reaches(const Sequence& sequence, uint64_t next) {
        return next - sequence.time == uint64_t(int64_t(step_to(sequence, next)));
    }

    // Both return how many sequences to move on and try there; 0: done.
    [[gnu::always_inline]] int code_after_zero(Coder& coder, Sequence& sequence, uint64_t next) {
        int code = int(coder.symbol(after_zero_, Coder::kEncodes ? code_after_zero_of(sequence, next) : 0));
        if (HasRepeat && code-- == 0) return 0;
        if (code > 1) return code - 1;
        if (code == 1) {
            begin_sequence(coder, sequence, next);
        } else {
            sequence.difference = integers_.code(coder, 0, 0, step_to(sequence, next));
            sequence.extremes = 0;
            step(sequence, sequence.difference);
        }
        return 0;
    }

    [[gnu::always_inline]] int code_multiple(Coder& coder, Sequence& sequence, uint64_t next) {
        const int code = int(coder.symbol(multiples_, Coder::kEncodes ? multiple_code_of(sequence, next) : 0));
        if (code > kFull) return code - kFull;
        if (code == kFull) {
            begin_sequence(coder, sequence, next);
            return 0;
        }
        if (HasRepeat && code == kRepeat) return 0;
        const int multiple = code <= kLargest ? code : std::max(kLargest - code, -kMostNegative);
        const size_t context = code == 1                  ? 1
                               : code == 0                ? 7
                               : code < 10                ? 2
                               : code < kLargest          ? 3
                               : code == kLargest         ? 4
                               : multiple > -kMostNegative ? 5
                                                          : 6;
        const int32_t difference =
            integers_.code(coder, int32_t(uint32_t(multiple) * uint32_t(sequence.difference)), context, step_to(sequence, next));
        step(sequence, difference);
        if (code == 1) {
            sequence.extremes = 0;
        } else if (context == 7 || context == 4 || context == 6) {
            if (++sequence.extremes > 3) {
                sequence.difference = difference;
                sequence.extremes = 0;
            }
        }
        return 0;
    }

    [[gnu::always_inline]] void begin_sequence(Coder& coder, const Sequence& before, uint64_t next) {
        const uint32_t upper = uint32_t(integers_.code(coder, int32_t(before.time >> 32), 8, int32_t(next >> 32)));
        const uint32_t lower = coder.raw_bits(32, uint32_t(next));
        newest_ = (newest_ + 1) & 3;
        sequences_[newest_] = {uint64_t(upper) << 32 | lower, 0, 0};
        current_ = newest_;
    }

    // What an encoder chooses: a step of 32 bits where there is one, else the next sequence from which there is, else a new one.
    uint32_t code_after_zero_of(const Sequence& sequence, uint64_t next) const {
        if (HasRepeat && next == sequence.time) return 0;
        if (reaches(sequence, next)) return HasRepeat;
        return uint32_t(HasRepeat + 1 + sequences_to(next));
    }
    uint32_t multiple_code_of(const Sequence& sequence, uint64_t next) const {
        if (HasRepeat && next == sequence.time) return kRepeat;
        if (!reaches(sequence, next)) return uint32_t(kFull + sequences_to(next));
        const int multiple = multiple_of(step_to(sequence, next), sequence.difference);
        return uint32_t(multiple >= 0 ? std::min(multiple, kLargest) : kLargest - std::max(multiple, -kMostNegative));
    }
    int sequences_to(uint64_t next) const {
        for (int i = 1; i < 4; ++i)
            if (reaches(sequences_[(current_ + uint32_t(i)) & 3], next)) return i;
        return 0;
    }
    // Rounded as the reference encoder does, which divides floats: others would write other bytes, though no wrong ones.
    static int multiple_of(int32_t step, int32_t difference) {
        if (step == difference) return 1;
        const double quotient = double(float(step) / float(difference));
        const double rounded = quotient + (quotient >= 0 ? 0.5 : -0.5);
        return rounded < 2147483648.0 ? int(rounded) : INT32_MIN;  // 2^31, of floats: its conversion gives this
    }

    typename Coder::template Symbols<kFull + 4> multiples_;
    typename Coder::template Symbols<5 + HasRepeat> after_zero_;
    IntegerModels<Coder, 32, 9> integers_;
    std::array<Sequence, 4> sequences_{};
    uint32_t current_ = 0, newest_ = 0;
};

using Rgb = std::array<uint16_t, 3>;

/// Colors as differences of the color before, byte by byte; red's differences predict those of green, both those of blue.
template <typename Coder>
class RgbModels {
public:
    void restart() {
        changes_.restart();
        for (auto& model : differences_) model.restart();
    }

    [[gnu::always_inline]] Rgb code(Coder& coder, const Rgb& last, const Rgb& told = {}) {
        const uint32_t changed = coder.symbol(changes_, Coder::kEncodes ? changes_of(last, told) : 0);
        const auto byte = [&](int place, int predicted, int unchanged, int value) __attribute__((always_inline)) {
            if (!(changed >> place & 1)) return uint8_t(unchanged);
            return uint8_t(predicted + int(coder.symbol(differences_[size_t(place)], uint8_t(value - predicted))));
        };
        const auto lower = [](uint16_t value) { return value & 0xFF; };
        const auto upper = [](uint16_t value) { return value >> 8; };
        const auto clamped = [](int value) { return std::clamp(value, 0, 255); };
        const int red_lower = byte(0, lower(last[0]), lower(last[0]), lower(told[0]));
        const int red_upper = byte(1, upper(last[0]), upper(last[0]), upper(told[0]));
        const uint16_t red = uint16_t(red_upper << 8 | red_lower);
        if (!(changed >> 6 & 1)) return {red, red, red};

        const int red_lower_step = red_lower - lower(last[0]), red_upper_step = red_upper - upper(last[0]);
        const int green_lower = byte(2, clamped(red_lower_step + lower(last[1])), lower(last[1]), lower(told[1]));
        const int blue_lower_step = (red_lower_step + green_lower - lower(last[1])) / 2;
        const int blue_lower = byte(4, clamped(blue_lower_step + lower(last[2])), lower(last[2]), lower(told[2]));
        const int green_upper = byte(3, clamped(red_upper_step + upper(last[1])), upper(last[1]), upper(told[1]));
        const int blue_upper_step = (red_upper_step + green_upper - upper(last[1])) / 2;
        const int blue_upper = byte(5, clamped(blue_upper_step + upper(last[2])), upper(last[2]), upper(told[2]));
        return {red, uint16_t(green_upper << 8 | green_lower), uint16_t(blue_upper << 8 | blue_lower)};
    }

private:
    // Bits 0 to 5: the lower and upper byte of red, green, blue changed; 6: green and blue are not red's.
    static uint32_t changes_of(const Rgb& last, const Rgb& next) {
        uint32_t changed = uint32_t(next[0] != next[1] || next[0] != next[2]) << 6;
        for (size_t c = 0; c < 3; ++c) {
            const uint32_t differ = uint32_t(last[c] ^ next[c]);
            changed |= (uint32_t((differ & 0xFF) != 0) | uint32_t(differ > 0xFF) << 1) << 2 * c;
        }
        return changed;
    }

    typename Coder::template Symbols<128> changes_;
    std::array<typename Coder::template Symbols<256>, 6> differences_;
};

/// A reference into waveform data, of 29 bytes.
struct WavePacket {
    static constexpr size_t kBytes = 29;
    uint8_t descriptor = 0;
    uint64_t offset = 0;
    uint32_t size = 0;
    std::array<int32_t, 4> floats{};  // return point, x(t), y(t), z(t): the bits of floats

    static WavePacket load(const std::byte* record) {
        WavePacket packet;
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

/// Wave packets: the offset as a step from the end of the packet before, or from its begin, the rest as in the record.
template <typename Coder>
class WavePacketModels {
public:
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

    WavePacket code(Coder& coder, const WavePacket& last, const WavePacket& told = {}) {
        WavePacket packet;
        packet.descriptor = uint8_t(coder.symbol(descriptors_, told.descriptor));
        offset_code_ = coder.symbol(offset_codes_[offset_code_], Coder::kEncodes ? offset_code_of(last, told) : 0);
        switch (offset_code_) {
            case 0: packet.offset = last.offset; break;
            case 1: packet.offset = last.offset + last.size; break;
            case 2:
                offset_step_ = offset_steps_.code(coder, offset_step_, 0, int32_t(uint32_t(told.offset - last.offset)));
                packet.offset = last.offset + uint64_t(int64_t(offset_step_));
                break;
            default: packet.offset = coder.raw_bits_64(told.offset);
        }
        packet.size = uint32_t(sizes_.code(coder, int32_t(last.size), 0, int32_t(told.size)));
        packet.floats[0] = return_points_.code(coder, last.floats[0], 0, told.floats[0]);
        for (size_t axis = 0; axis < 3; ++axis)
            packet.floats[1 + axis] = directions_.code(coder, last.floats[1 + axis], axis, told.floats[1 + axis]);
        return packet;
    }

private:
    static uint32_t offset_code_of(const WavePacket& last, const WavePacket& next) {
        const uint64_t step = next.offset - last.offset;
        if (step == 0) return 0;
        if (step != uint64_t(int64_t(int32_t(uint32_t(step))))) return 3;
        return step == last.size ? 1 : 2;
    }

    typename Coder::template Symbols<256> descriptors_;
    std::array<typename Coder::template Symbols<4>, 4> offset_codes_;  // by the code before
    IntegerModels<Coder, 32, 1> offset_steps_, sizes_, return_points_;
    IntegerModels<Coder, 32, 3> directions_;
    uint32_t offset_code_ = 0;
    int32_t offset_step_ = 0;
};

}  // namespace strata::las
