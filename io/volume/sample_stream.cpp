#include "io/volume/sample_stream.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/error.h"
#include "io/text_words.h"

namespace strata {
namespace {

// Deflate codes 258 bytes by two bits at best.
constexpr uint64_t kMostDeflation = 1032;

std::string size_text(const VolumeHeader& header) {
    return std::to_string(header.size[0]) + " x " + std::to_string(header.size[1]) + " x " + std::to_string(header.size[2]) + " samples of " +
           std::string(name_of(header.type)) + " are " + std::to_string(header.sample_bytes()) + " bytes";
}

// Goes to the first byte behind the header and lines that are stepped over.
void seek_samples(ByteStream& stream, const VolumeHeader& header) {
    stream.seek(header.offset);
    std::string_view line;
    for (uint64_t i = 0; i < header.lines_before; ++i)
        if (!stream.next_line(line)) stream.fail_at_byte(std::to_string(header.lines_before) + " lines before the samples are expected, the file ends in line " + std::to_string(i + 1));
}

class RawSamples : public SampleStream {
public:
    RawSamples(const ByteSource& source, const VolumeHeader& header) : stream_(source) {
        const uint64_t bytes = header.sample_bytes();
        if (header.is_at_end) {
            if (bytes > stream_.size()) stream_.fail_at_byte(size_text(header) + "; the file has " + std::to_string(stream_.size()));
            stream_.seek(stream_.size() - bytes);
            return;
        }
        seek_samples(stream_, header);
        stream_.skip(header.bytes_before);
        if (bytes > stream_.left()) stream_.fail_at_byte(size_text(header) + "; " + std::to_string(stream_.left()) + " are left");
        bytes_behind_ = stream_.left() - bytes;
    }
    void read(std::span<std::byte> out) override { stream_.read(out); }
    uint64_t bytes_behind() const override { return bytes_behind_; }

private:
    ByteStream stream_;
    uint64_t bytes_behind_ = 0;
};

class DeflatedSamples : public SampleStream {
public:
    DeflatedSamples(const ByteSource& source, const VolumeHeader& header) : stream_(source), input_(kInput) {
        if (header.is_at_end) {
            const uint64_t bytes = header.stored_bytes.value_or(0);
            if (bytes == 0) stream_.fail_at_byte("CompressedDataSize is expected where compressed samples are at the end of the file");
            if (bytes > stream_.size()) stream_.fail_at_byte(std::to_string(bytes) + " bytes of compressed samples are expected, the file has " + std::to_string(stream_.size()));
            stream_.seek(stream_.size() - bytes);
        } else {
            seek_samples(stream_, header);
        }
        left_ = header.stored_bytes.value_or(stream_.left());
        if (left_ > stream_.left()) stream_.fail_at_byte(std::to_string(left_) + " bytes of compressed samples are expected, " + std::to_string(stream_.left()) + " are left");
        if (header.sample_bytes() / kMostDeflation > left_)
            stream_.fail_at_byte(size_text(header) + ", which cannot be in " + std::to_string(left_) + " compressed bytes");
        // 32: by zlib or gzip, as the bytes say.
        if (inflateInit2(&inflater_, 32 + MAX_WBITS) != Z_OK) throw Error(ErrorKind::limit, stream_.name() + ": no memory to decompress with");
        try {
            skip(header.bytes_before);
        } catch (...) {
            inflateEnd(&inflater_);
            throw;
        }
    }
    DeflatedSamples(const DeflatedSamples&) = delete;
    DeflatedSamples& operator=(const DeflatedSamples&) = delete;
    ~DeflatedSamples() override { inflateEnd(&inflater_); }

    void read(std::span<std::byte> out) override {
        while (!out.empty()) {
            const size_t count = inflate_some(out);
            if (count == 0) stream_.fail_at_byte("the compressed samples end here, " + std::to_string(out.size()) + " bytes more are expected at least");
            out = out.subspan(count);
        }
    }
    // The checksum stands behind the last byte.
    void finish() override {
        std::array<std::byte, 1> more;
        if (inflate_some(more) > 0) stream_.fail_at_byte("the compressed samples are expected to end before this, by the header's count of them");
    }

private:
    static constexpr size_t kInput = 16 * 1024;

    void skip(uint64_t count) {
        std::array<std::byte, 4096> skipped;
        while (count > 0) {
            const size_t part = size_t(std::min<uint64_t>(count, skipped.size()));
            read(std::span(skipped).first(part));
            count -= part;
        }
    }

    // 0: the last stream has ended.
    size_t inflate_some(std::span<std::byte> out) {
        for (;;) {
            if (ended_) {
                // gzip's may follow each other; other bytes behind them are padding.
                if (!more_input() || inflater_.next_in[0] != 0x1F) return 0;
                inflateReset(&inflater_);
                ended_ = false;
            }
            if (!more_input()) stream_.fail_at_byte("the compressed samples are cut off here");
            inflater_.next_out = reinterpret_cast<Bytef*>(out.data());
            inflater_.avail_out = uInt(std::min<size_t>(out.size(), 1 << 30));
            const uInt wanted = inflater_.avail_out;
            const int result = inflate(&inflater_, Z_NO_FLUSH);
            ended_ = result == Z_STREAM_END;
            if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR)
                stream_.fail_at_byte(std::string("samples compressed by zlib or gzip are expected before this, but ") + (inflater_.msg ? inflater_.msg : "they are not"));
            if (wanted > inflater_.avail_out) return wanted - inflater_.avail_out;
        }
    }
    bool more_input() {
        if (inflater_.avail_in > 0) return true;
        const size_t count = size_t(std::min<uint64_t>(left_, input_.size()));
        if (count == 0) return false;
        stream_.read(std::span(input_).first(count));
        left_ -= count;
        inflater_.next_in = reinterpret_cast<Bytef*>(input_.data());
        inflater_.avail_in = uInt(count);
        return true;
    }

    ByteStream stream_;
    std::vector<std::byte> input_;
    uint64_t left_ = 0;  // compressed bytes that are not in `input_` yet
    z_stream inflater_{};
    bool ended_ = false;
};

class TextSamples : public SampleStream {
public:
    TextSamples(const ByteSource& source, const VolumeHeader& header) : stream_(source), type_(header.type) {
        if (header.is_at_end) stream_.fail_at_byte("samples as text begin behind the header");
        seek_samples(stream_, header);
        stream_.skip(header.bytes_before);
        // A digit and a blank each; the last blank may be missing.
        if (header.samples() > (stream_.left() + 1) / 2)
            stream_.fail_at_byte(std::to_string(header.samples()) + " numbers are expected, " + std::to_string(stream_.left()) + " bytes are left");
    }

    void read(std::span<std::byte> out) override {
        const size_t step = size_of(type_);
        for (size_t at = 0; at < out.size(); at += step) {
            std::byte* const to = out.data() + at;
            switch (type_) {
                case SampleType::int8: put<int8_t>(to); break;
                case SampleType::uint8: put<uint8_t>(to); break;
                case SampleType::int16: put<int16_t>(to); break;
                case SampleType::uint16: put<uint16_t>(to); break;
                case SampleType::int32: put<int32_t>(to); break;
                case SampleType::uint32: put<uint32_t>(to); break;
                case SampleType::int64: put<int64_t>(to); break;
                case SampleType::uint64: put<uint64_t>(to); break;
                case SampleType::float32: put<float>(to); break;
                case SampleType::float64: put<double>(to); break;
            }
        }
    }

private:
    template <typename T>
    void put(std::byte* to) {
        std::string_view line;
        while (!words_.more()) {
            if (!stream_.next_line(line)) stream_.fail_at_byte("the file ends here, one more number is expected at least");
            words_ = TextWords(line);
        }
        T value{};
        if constexpr (std::is_integral_v<T>) {
            std::string_view word = words_.word();
            if (word.size() > 1 && word.front() == '+') word.remove_prefix(1);
            const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), value);
            if (problem != std::errc() || end != word.data() + word.size()) stream_.fail_at_byte("numbers of type " + std::string(name_of(type_)) + " are expected before this, not '" + std::string(word.substr(0, 40)) + "'");
        } else {
            double number = 0.0;
            if (!words_.number(number)) stream_.fail_at_byte("numbers are expected before this");
            value = T(number);
        }
        std::memcpy(to, &value, sizeof value);
    }

    ByteStream stream_;
    SampleType type_;
    TextWords words_{std::string_view()};
};

}  // namespace

std::unique_ptr<SampleStream> open_samples(const ByteSource& source, const VolumeHeader& header) {
    switch (header.encoding) {
        case VolumeEncoding::raw: return std::make_unique<RawSamples>(source, header);
        case VolumeEncoding::deflated: return std::make_unique<DeflatedSamples>(source, header);
        case VolumeEncoding::text: break;
    }
    return std::make_unique<TextSamples>(source, header);
}

}  // namespace strata
