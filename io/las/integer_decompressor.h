#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "io/las/arithmetic_decoder.h"

namespace strata::las {

/// Integers of `Bits` bits as corrections of a prediction. A correction c is coded as the number k of bits that its
/// magnitude needs, by a model a context, and then as its place among the 2^k corrections that need k bits, the upper 8 bits
/// of it by a model a k, the others raw: k = 0 holds 0 and 1; k > 0 holds -(2^k - 1) to -2^(k-1) and 2^(k-1) + 1 to 2^k.
/// Contexts = 0: their number is told by restart.
template <int Bits, size_t Contexts>
class IntegerDecompressor {
public:
    void restart(size_t contexts = Contexts) {
        if constexpr (Contexts == 0) widths_.resize(contexts);
        for (auto& model : widths_) model.restart();
        unit_ = {};
        ready_ = 0;
    }

    /// k of the last correction.
    uint32_t width() const { return width_; }

    /// prediction + correction modulo 2^Bits, as an integer of 32 bits that is negative only for Bits = 32.
    int32_t decode(ArithmeticDecoder& decoder, int32_t prediction, size_t context) {
        const uint32_t value = uint32_t(prediction) + uint32_t(correction(decoder, context));
        return int32_t(Bits < 32 ? value & uint32_t((uint64_t{1} << Bits) - 1) : value);
    }

private:
    static constexpr int kModeledBits = 8;
    using PlaceModel = SymbolModel<1 << kModeledBits>;

    int32_t correction(ArithmeticDecoder& decoder, size_t context) {
        const uint32_t k = width_ = decoder.symbol(widths_[context]);
        if (k == 0) return int32_t(decoder.bit(unit_));
        if (k == 32) return INT32_MIN;
        uint32_t place = decoder.symbol(places_of(k));
        if (k > kModeledBits) {
            const int raw = int(k) - kModeledBits;
            place = place << raw | decoder.raw_bits(raw);
        }
        return int32_t(place >> (k - 1) ? place + 1 : place - ((1u << k) - 1));
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
    using WidthModel = SymbolModel<Bits + 1>;
    std::conditional_t<Contexts == 0, std::vector<WidthModel>, std::array<WidthModel, Contexts>> widths_;
    std::array<PlaceModel, std::min(Bits, 31)> places_;
};

}  // namespace strata::las
