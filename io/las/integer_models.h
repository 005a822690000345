#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "io/las/arithmetic_models.h"

namespace strata::las {

/// Bytes that one integer may take, at most: two symbols and 23 raw bits.
inline constexpr size_t kMostIntegerBytes = 4 * kBytesPerSymbol;

/// Integers of `Bits` bits as corrections of a prediction. A correction c is coded as the number k of bits that its
/// magnitude needs, by a model a context, and then as its place among the 2^k corrections that need k bits, the upper 8 bits
/// of it by a model a k, the others raw: k = 0 holds 0 and 1; k > 0 holds -(2^k - 1) to -2^(k-1) and 2^(k-1) + 1 to 2^k.
/// Contexts = 0: their number is told by restart.
template <typename Coder, int Bits, size_t Contexts>
class IntegerModels {
public:
    void restart(size_t contexts = Contexts) {
        if constexpr (Contexts == 0) widths_.resize(contexts);
        for (auto& model : widths_) model.restart();
        unit_ = {};
        ready_ = 0;
    }

    /// k of the last correction.
    uint32_t width() const { return width_; }

    /// prediction + correction modulo 2^Bits, as an integer of 32 bits that is negative only for Bits = 32. An encoder is told
    /// it, and returns it.
    [[gnu::always_inline]] int32_t code(Coder& coder, int32_t prediction, size_t context, int32_t value = 0) {
        if constexpr (Coder::kEncodes) {
            const uint32_t correction = uint32_t(value) - uint32_t(prediction);
            // The upper bits are those of the sign.
            code_correction(coder, context, int32_t(correction << (32 - Bits)) >> (32 - Bits));
            return value;
        } else {
            const uint32_t sum = uint32_t(prediction) + uint32_t(code_correction(coder, context, 0));
            return int32_t(Bits < 32 ? sum & uint32_t((uint64_t{1} << Bits) - 1) : sum);
        }
    }

private:
    static constexpr int kModeledBits = 8;
    using PlaceModel = typename Coder::template Symbols<1 << kModeledBits>;
    using WidthModel = typename Coder::template Symbols<Bits + 1>;

    [[gnu::always_inline]] int32_t code_correction(Coder& coder, size_t context, int32_t c) {
        const uint32_t k = width_ = coder.symbol(widths_[context], width_of(c));
        if (k == 0) return int32_t(coder.bit(unit_, uint32_t(c)));
        if (k == 32) return INT32_MIN;
        uint32_t place = uint32_t(c) - 1 + ((1u << k) & uint32_t(c >> 31));  // the sign is as good as random: no branch
        if (k > kModeledBits) {
            const int raw = int(k) - kModeledBits;
            const uint32_t upper = coder.symbol(places_of(k), place >> raw);
            place = upper << raw | coder.raw_bits(raw, place & ((1u << raw) - 1));
        } else {
            place = coder.symbol(places_of(k), place);
        }
        return int32_t(place >> (k - 1) ? place + 1 : place - ((1u << k) - 1));
    }

    static uint32_t width_of(int32_t c) {
        const int64_t below = int64_t(c) - 1;  // its bits, or those of what is as far on the other side
        return uint32_t(std::bit_width(uint64_t(below ^ below >> 63)));
    }

    // Most k never come; their models are made ready when they do.
    PlaceModel& places_of(uint32_t k) {
        PlaceModel& model = places_[k - 1];
        if (!(ready_ >> k & 1)) [[unlikely]] {
            model.restart(1 << std::min<uint32_t>(k, kModeledBits));
            ready_ |= uint64_t{1} << k;
        }
        return model;
    }

    uint32_t width_ = 0;
    uint64_t ready_ = 0;  // bit k: places_of(k) is in use
    BitModel unit_;
    std::conditional_t<Contexts == 0, std::vector<WidthModel>, std::array<WidthModel, Contexts>> widths_;
    std::array<PlaceModel, std::min(Bits, 31)> places_;
};

}  // namespace strata::las
