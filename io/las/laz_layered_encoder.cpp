// Layered chunks of points, formats 6 to 10, to bytes; laz_layered_points.h says what they are.
#include <algorithm>
#include <cassert>
#include <cstring>
#include <numeric>

#include "io/las/arithmetic_encoder.h"
#include "io/las/coded_bytes.h"
#include "io/las/las_layout.h"
#include "io/las/laz_encoder.h"
#include "io/las/laz_layered_points.h"

namespace strata::las {
namespace {

// What a layer takes of a point at most: a wave packet is 6 symbols and 5 integers.
constexpr size_t kMostLayerBytes = 6 * kBytesPerSymbol + 5 * kMostIntegerBytes + 8;

struct EncodedLayer {
    using Coder = ArithmeticEncoder;
    CodedBytes bytes;
    ArithmeticEncoder encoder;
    std::span<const std::byte> coded;  // when the chunk is done
    bool active = false;               // else all points of the chunk have the same

    const ArithmeticEncoder& enter(size_t points) {
        bytes.make_room(encoder, points * kMostLayerBytes);
        return encoder;
    }
    void check(const ArithmeticEncoder&) const {}
    void leave(const ArithmeticEncoder& at) { encoder = at; }
};

class LayeredEncoder : public LazEncoder {
public:
    LayeredEncoder(const PointLayout& layout, size_t record_size)
        : layout_(layout), record_size_(record_size), points_(layout, record_size, false), differ_(record_size) {}

    void encode(std::span<const std::byte> records, std::vector<std::byte>& out) override {
        const std::byte* const first = records.data();
        const size_t count = records.size() / record_size_;
        assert(count > 0 && records.size() % record_size_ == 0);
        compare(first, count);
        choose_layers(first, count);
        for (EncodedLayer& layer : points_.layers)
            if (layer.active) layer.encoder = layer.bytes.begin();
        points_.restart(first);
        for (size_t done = 1, size; done < count; done += size) {
            size = std::min(count - done, kTilePoints);
            points_.code_tile(size, first + done * record_size_);
        }
        write(first, count, out);
    }

private:
    static constexpr size_t kWord = 8;

    // Which bits are not the same in all records, by words of which the last may overlap.
    void compare(const std::byte* first, size_t count) {
        std::fill(differ_.begin(), differ_.end(), std::byte{0});
        for (size_t begin = 1; begin < count; begin += kTilePoints) {
            const size_t end = std::min(count, begin + kTilePoints);
            for (size_t at = 0; at < record_size_; at += kWord) {
                const size_t place = std::min(at, record_size_ - kWord);
                const uint64_t word = load_field<uint64_t>(first + place);
                uint64_t differ = load_field<uint64_t>(differ_.data() + place);
                for (size_t i = begin; i < end; ++i) differ |= load_field<uint64_t>(first + i * record_size_ + place) ^ word;
                store_field(differ_.data() + place, differ);
            }
        }
    }
    bool differs(size_t offset, size_t size, std::byte bits = std::byte{0xFF}) const {
        return std::any_of(differ_.begin() + std::ptrdiff_t(offset), differ_.begin() + std::ptrdiff_t(offset + size),
                           [&](std::byte b) { return (b & bits) != std::byte{0}; });
    }

    // The layers of x and y and of z are always there. Of the others those without a change are left out, where colors that
    // are not grey and times that are no numbers count as changes.
    void choose_layers(const std::byte* first, size_t count) {
        auto& layers = points_.layers;
        constexpr std::byte kAllButChannel{0xCF};
        layers[kPositions].active = layers[kZs].active = true;
        layers[kClassifications].active = differs(kClassification, 1);
        layers[kFlagsLayer].active = differs(kFlags, 1, kAllButChannel);
        layers[kIntensities].active = differs(kIntensity, 2);
        layers[kScanAngles].active = differs(kScanAngle, 2);
        layers[kUserDatas].active = differs(kUserData, 1);
        layers[kPointSources].active = differs(kPointSource, 2);
        const uint64_t time = load_field<uint64_t>(first + kGpsTime);
        layers[kGpsTimes].active = differs(kGpsTime, 8) || (count > 1 && time_changes(time, time));
        size_t layer = kItems;
        if (layout_.rgb) {
            const Rgb rgb = load_field<Rgb>(first + layout_.rgb);
            layers[layer++].active = differs(layout_.rgb, 6) || (count > 1 && (rgb[0] != rgb[1] || rgb[0] != rgb[2]));
        }
        if (layout_.nir) layers[layer++].active = differs(layout_.nir, 2);
        if (layout_.wave) layers[layer++].active = differs(layout_.wave, WavePacket::kBytes);
        for (size_t b = layout_.size; b < record_size_; ++b) layers[layer++].active = differs(b, 1);
    }

    void write(const std::byte* first, size_t count, std::vector<std::byte>& out) {
        std::vector<uint32_t> head = {uint32_t(count)};
        for (EncodedLayer& layer : points_.layers) {
            layer.coded = {};
            if (layer.active) layer.coded = layer.bytes.finish(layer.encoder);
            head.push_back(uint32_t(layer.coded.size()));
        }
        const auto append = [&](std::span<const std::byte> bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); };
        append({first, record_size_});
        append(std::as_bytes(std::span(head)));
        for (const EncodedLayer& layer : points_.layers) append(layer.coded);
    }

    PointLayout layout_;
    size_t record_size_;
    LayeredPoints<EncodedLayer> points_;
    std::vector<std::byte> differ_;
};

}  // namespace

std::unique_ptr<LazEncoder> make_layered_encoder(int point_format, size_t record_size) {
    return std::make_unique<LayeredEncoder>(point_layout(point_format), record_size);
}

}  // namespace strata::las
