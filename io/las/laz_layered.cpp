// Layered chunks of points, formats 6 to 10, from bytes; laz_layered_points.h says what they are.
#include <algorithm>
#include <cstring>
#include <numeric>
#include <string>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/arithmetic_decoder.h"
#include "io/las/las_layout.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_layered_points.h"

namespace strata::las {
namespace {

constexpr uint64_t kBridgedGap = 32 * 1024;  // bytes between two layers that ByteSource::read_many reads along
// What a layer's decoder may run ahead within one point: GPS time switches sequence four times, then begins one.
constexpr size_t kMargin = kBytesPerSymbol * 64 + kBytesAhead;

/// The bytes of a layer and how far they are decoded.
struct DecodedLayer {
    using Coder = ArithmeticDecoder;
    ArithmeticDecoder decoder;
    const std::byte* end = nullptr;
    bool active = false;  // asked for, and not the same for all points of the chunk

    const ArithmeticDecoder& enter(size_t) const { return decoder; }
    void check(const ArithmeticDecoder& at) const {
        if (at.next() > end) [[unlikely]]
            throw Error(ErrorKind::malformed, "the compressed points go on where the bytes of a layer end");
    }
    /// Keeps where the decoder is, behind the last point of a tile.
    void leave(const ArithmeticDecoder& at) {
        check(at);
        if (!at.ok()) throw Error(ErrorKind::malformed, "the bytes of a layer are not compressed points");
        decoder = at;
    }
};

class LayeredDecoder : public LazDecoder {
public:
    LayeredDecoder(const Header& header, const LazHeader& laz, const LazSelection& selection)
        : layout_(point_layout(header.point_format)),
          record_size_(header.record_size),
          points_(layout_, record_size_, laz.items.front().version == 4),
          wanted_(wanted_layers(selection)) {}

    std::unique_ptr<LazDecoder> clone() const override { return std::make_unique<LayeredDecoder>(*this); }

    void prefetch(const ByteSource& source, const LazChunk& chunk) const override {
        try {
            const ChunkHead head = read_head(source, chunk);
            uint64_t offset = head.layers_offset, begin = offset, end = offset;
            for (size_t i = 0; i < head.sizes.size(); offset += head.sizes[i++]) {
                if (!wanted_[i] || head.sizes[i] == 0) continue;
                if (offset - end > kBridgedGap) {
                    source.prefetch(begin, end - begin);
                    begin = offset;
                }
                end = offset + chunk.likely_bytes(head.sizes[i]);
            }
            source.prefetch(begin, end - begin);
        } catch (const Error&) {  // begin will say it
        }
    }

    void begin(const ByteSource& source, const LazChunk& chunk) override {
        offset_ = chunk.offset;
        const ChunkHead head = read_head(source, chunk);
        first_ = head.first;
        end_ = head.layers_offset + std::accumulate(head.sizes.begin(), head.sizes.end(), uint64_t{0});
        read_layers(source, chunk, head);
        points_.restart(first_.data());
        at_first_ = true;
    }

    void decode(size_t count, std::byte* records) override {
        if (count > 0 && at_first_) {
            std::copy(first_.begin(), first_.end(), records);
            records += record_size_;
            --count;
            at_first_ = false;
        }
        try {
            for (size_t size; count > 0; count -= size, records += size * record_size_) {
                size = std::min(count, kTilePoints);
                decode_tile(size, records);
            }
        } catch (const Error& error) {
            throw error.within("byte " + std::to_string(offset_));
        }
    }

    uint64_t finish() override { return end_; }

private:
    /// What stands before the layers.
    struct ChunkHead {
        std::vector<std::byte> first;  // record
        std::vector<uint32_t> sizes;   // of the layers, bytes
        uint64_t layers_offset = 0;
    };

    ChunkHead read_head(const ByteSource& source, const LazChunk& chunk) const {
        const uint64_t head_size = record_size_ + 4 + 4 * uint64_t(points_.layers.size());
        if (chunk.size < head_size)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset) + ": " + std::to_string(head_size) +
                                                  " bytes needed for its first point and the sizes of its layers, " + std::to_string(chunk.size) + " left");
        std::vector<std::byte> bytes(head_size);
        source.read(chunk.offset, bytes);
        ChunkHead head{.first = {bytes.begin(), bytes.begin() + std::ptrdiff_t(record_size_)}, .sizes = {}, .layers_offset = chunk.offset + head_size};
        ByteReader reader(std::span<const std::byte>(bytes).subspan(record_size_), "layers", chunk.offset + record_size_);
        const uint32_t points = reader.read<uint32_t>();
        if (points != chunk.points)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset + record_size_) + ": it says that it has " + std::to_string(points) +
                                                  " points, " + std::to_string(chunk.points) + " are expected");
        head.sizes.resize(points_.layers.size());
        for (uint32_t& size : head.sizes) size = reader.read<uint32_t>();
        const uint64_t sum = std::accumulate(head.sizes.begin(), head.sizes.end(), uint64_t{0});
        if (chunk.open_end ? sum > chunk.size - head_size : sum != chunk.size - head_size)
            throw Error(ErrorKind::malformed, "byte " + std::to_string(chunk.offset + record_size_ + 4) + ": its layers have " + std::to_string(sum) +
                                                  " bytes, there are " + std::to_string(chunk.size - head_size));
        return head;
    }

    // Which layers are asked for, in their order.
    std::vector<bool> wanted_layers(const LazSelection& selection) const {
        std::vector<bool> wanted = {true, true};
        const auto ask = [&](size_t offset, size_t size) { wanted.push_back(selection.has(offset, size)); };
        ask(kClassification, 1);
        ask(kFlags, 1);
        ask(kIntensity, 2);
        ask(kScanAngle, 2);
        ask(kUserData, 1);
        ask(kPointSource, 2);
        ask(kGpsTime, 8);
        if (layout_.rgb) ask(layout_.rgb, 6);
        if (layout_.nir) ask(layout_.nir, 2);
        if (layout_.wave) ask(layout_.wave, WavePacket::kBytes);
        for (size_t i = 0; i < record_size_ - layout_.size; ++i) ask(layout_.size + i, 1);
        return wanted;
    }

    void read_layers(const ByteSource& source, const LazChunk& chunk, const ChunkHead& head) {
        uint64_t room = kMargin, offset = head.layers_offset;
        for (size_t i = 0; i < head.sizes.size(); ++i) room += wanted_[i] ? chunk.likely_bytes(head.sizes[i]) : 0;
        const auto bytes = std::make_shared<std::vector<std::byte>>(room);
        std::vector<ByteRange> ranges;
        size_t at = 0;
        for (size_t i = 0; i < head.sizes.size(); offset += head.sizes[i++]) {
            DecodedLayer& layer = points_.layers[i];
            layer.active = wanted_[i] && head.sizes[i] > 0;
            if (!layer.active) continue;
            const size_t size = size_t(chunk.likely_bytes(head.sizes[i]));
            ranges.push_back({offset, std::span(*bytes).subspan(at, size)});
            layer.end = bytes->data() + at + size;
            at += size;
        }
        source.read_many(ranges);
        size_t range = 0;
        for (DecodedLayer& layer : points_.layers)
            if (layer.active) layer.decoder = ArithmeticDecoder(ranges[range++].out.data());
        bytes_ = bytes;
    }

    void decode_tile(size_t size, std::byte* records) {
        // Fields whose layers do not change, or are not asked for, are those of the first point.
        for (size_t i = 0; i < size; ++i) std::memcpy(records + i * record_size_, first_.data(), record_size_);
        if (!points_.layers[kPositions].active) throw Error(ErrorKind::malformed, "its first layer, of x and y, has no bytes");
        points_.code_tile(size, records);
    }

    PointLayout layout_;
    size_t record_size_;

    uint64_t offset_ = 0, end_ = 0;  // of the chunk, bytes
    std::vector<std::byte> first_;   // record
    bool at_first_ = false;
    std::shared_ptr<const std::vector<std::byte>> bytes_;  // of the layers asked for, and a margin of zeros
    LayeredPoints<DecodedLayer> points_;
    std::vector<bool> wanted_;  // layers, by what is asked for
};

}  // namespace

std::unique_ptr<LazDecoder> make_layered_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection) {
    return std::make_unique<LayeredDecoder>(header, laz, selection);
}

std::unique_ptr<LazDecoder> make_laz_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection) {
    return laz.layered ? make_layered_decoder(header, laz, selection) : make_pointwise_decoder(header, laz);
}

}  // namespace strata::las
