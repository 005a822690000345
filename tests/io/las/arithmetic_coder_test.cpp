// The two directions of the entropy coder against each other.
#include <gtest/gtest.h>

#include "io/las/arithmetic_decoder.h"
#include "io/las/arithmetic_encoder.h"
#include "io/las/coded_bytes.h"
#include "io/las/integer_models.h"

namespace strata::las {
namespace {

using Bytes = std::vector<std::byte>;

// A decoder reads symbols out of any bytes. An encoder that is told them comes to the same number from below, by however many
// bytes of 255 that become 0 at once: here up to 16 behind a byte of each value.
TEST(ArithmeticCoder, CarriesRunThroughAnyNumberOfBytes) {
    for (int first = 1; first < 250; first += 6)
        for (size_t zeros = 0; zeros < 17; ++zeros)
            for (const int count : {1, 3, 8, 13, 19}) {
                Bytes bytes = {std::byte(first)};
                bytes.resize(1 + zeros);
                for (int i = 1; i < 6; ++i) bytes.push_back(std::byte(37 * i));
                const size_t size = bytes.size();
                bytes.resize(size + 16);
                ArithmeticDecoder decoder(bytes.data());
                CodedBytes coded;
                ArithmeticEncoder encoder = coded.begin();
                while (decoder.next() < bytes.data() + size + 4) {
                    coded.make_room(encoder, kBytesPerSymbol);
                    encoder.raw_bits(count, decoder.raw_bits(count));
                }
                const std::span<const std::byte> again = coded.finish(encoder);
                ASSERT_GE(again.size(), size);
                ASSERT_TRUE(std::equal(bytes.begin(), bytes.begin() + std::ptrdiff_t(size) - 1, again.begin()))
                    << first << ", " << zeros << " zeros, " << count << " bits";
            }
}

// Symbols by models of all sizes, bits and integers in one stream, skewed so that models come to extremes.
TEST(ArithmeticCoder, WhatIsEncodedIsDecoded) {
    uint64_t state = 1234567;
    const auto random = [&](uint64_t below) {
        state ^= state << 13, state ^= state >> 7, state ^= state << 17;
        return uint32_t((state >> 20) % below);
    };
    struct Step {
        uint32_t pair, many, bit, raw, raw_count, integer, context;
    };
    std::vector<Step> steps;
    for (int i = 0; i < 60'000; ++i) {
        const bool rare = i % 50 == 0;
        const uint32_t raw_count = 1 + random(32), magnitude = random(33);
        steps.push_back({rare ? random(2) : 1u, rare ? random(516) : random(3) * 257, random(100) == 0,
                         uint32_t(state >> 11) & uint32_t((uint64_t{1} << raw_count) - 1), raw_count,
                         magnitude == 32 ? 0x80000000u : uint32_t(random(uint64_t{1} << magnitude)) * (random(2) ? 1u : ~0u), random(2)});
    }
    const auto run = [&](auto& coder, auto check) {
        using Coder = std::remove_reference_t<decltype(coder)>;
        typename Coder::template Symbols<2> pairs;
        typename Coder::template Symbols<516> many;
        BitModel bits;
        IntegerModels<Coder, 32, 2> integers;
        pairs.restart();
        many.restart();
        integers.restart();
        for (size_t i = 0; i < steps.size(); ++i) {
            const Step& step = steps[i];
            check(i, coder.symbol(pairs, step.pair), step.pair);
            check(i, coder.symbol(many, step.many), step.many);
            check(i, coder.bit(bits, step.bit), step.bit);
            check(i, coder.raw_bits(int(step.raw_count), step.raw), step.raw);
            check(i, uint32_t(integers.code(coder, int32_t(i), step.context, int32_t(step.integer))), step.integer);
            check(i, integers.width() <= 32, true);
        }
    };
    CodedBytes coded;
    ArithmeticEncoder encoder = coded.begin();
    coded.make_room(encoder, steps.size() * 40);
    run(encoder, [](size_t i, uint32_t found, uint32_t expected) { ASSERT_EQ(found, expected) << i; });
    const std::span<const std::byte> written = coded.finish(encoder);
    Bytes bytes(written.begin(), written.end());
    bytes.resize(bytes.size() + kBytesAhead);
    ArithmeticDecoder decoder(bytes.data());
    run(decoder, [](size_t i, uint32_t found, uint32_t expected) { ASSERT_EQ(found, expected) << i; });
    EXPECT_TRUE(decoder.ok());
    EXPECT_EQ(size_t(decoder.next() - bytes.data()), written.size());
}

}  // namespace
}  // namespace strata::las
