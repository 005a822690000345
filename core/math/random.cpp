#include "core/math/random.h"

#include <array>
#include <cmath>

namespace strata {
namespace {

// The bell as 128 layers of equal area, the lowest with the tail. G. Marsaglia and W. W. Tsang, "The Ziggurat Method for
// Generating Random Variables", Journal of Statistical Software 2000, with the two constants from there.
struct Ziggurat {
    static constexpr size_t kLayers = 128;
    static constexpr double kTail = 3.442619855899;        // where it begins
    static constexpr double kArea = 9.91256303526217e-3;  // of a layer

    Ziggurat() {
        double bell = std::exp(-0.5 * kTail * kTail);
        width[0] = kArea / bell;
        width[1] = kTail;
        for (size_t i = 2; i < kLayers; ++i) {
            width[i] = std::sqrt(-2.0 * std::log(kArea / width[i - 1] + bell));
            bell = std::exp(-0.5 * width[i] * width[i]);
        }
        for (size_t i = 0; i < kLayers; ++i) inner[i] = width[i + 1] / width[i];
    }

    std::array<double, kLayers + 1> width{};  // of each layer, the last 0
    std::array<double, kLayers> inner{};      // share of a layer that lies under the bell whatever the height
};
const Ziggurat kZiggurat;

}  // namespace

double Random::normal() {
    for (;;) {
        const uint64_t draw = bits();  // the layer from the low bits, the place in it from the high ones
        const size_t layer = draw % Ziggurat::kLayers;
        const double place = double(int64_t(draw) >> 11) * 0x1p-52;  // in [-1, 1)
        const double x = place * kZiggurat.width[layer];
        if (std::abs(place) < kZiggurat.inner[layer]) return x;
        if (layer == 0) {
            double beyond, height;
            do {
                beyond = -std::log(1.0 - uniform()) / Ziggurat::kTail;
                height = -std::log(1.0 - uniform());
            } while (2.0 * height < beyond * beyond);
            return std::copysign(Ziggurat::kTail + beyond, place);
        }
        const double low = std::exp(-0.5 * (kZiggurat.width[layer] * kZiggurat.width[layer] - x * x));
        const double high = std::exp(-0.5 * (kZiggurat.width[layer + 1] * kZiggurat.width[layer + 1] - x * x));
        if (low + uniform() * (high - low) < 1.0) return x;
    }
}

}  // namespace strata
