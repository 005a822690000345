#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/surface/scalar_field.h"
#include "io/byte_source.h"
#include "io/volume/sample_stream.h"
#include "io/volume/volume_header.h"

namespace strata {

/// The least and the greatest value of a volume.
struct VolumeRange {
    double min = 0.0, max = 0.0;   // where there is a value
    uint64_t values = 0, nan = 0;  // samples that have one, and that are not a number
};

/// The samples of a file, slice by slice, through buffers of some 500 KiB. What is not finite is beyond all that is: the greatest and the
/// least number of a float.
class VolumeSource : public SliceSource {
public:
    /// header  fits the samples' file as far as can be seen before they are read
    VolumeSource(std::unique_ptr<ByteSource> samples, VolumeHeader header);

    const VolumeHeader& header() const { return header_; }
    const std::string& name() const { return bytes_->name(); }  // of the file of samples

    const GridPlacement& placement() const override { return header_.placement; }
    std::array<uint32_t, 3> size() const override { return header_.size; }
    void read(uint32_t count, double reference, std::span<float> out) override;

    /// Begins again with the first slice.
    void restart();
    /// Reads all of it, and begins again.
    VolumeRange measure();

private:
    void read_block(std::span<std::byte> out);
    template <typename Take>
    void each_block(uint64_t samples, const Take& take);

    std::unique_ptr<ByteSource> bytes_;
    VolumeHeader header_;
    std::unique_ptr<SampleStream> samples_;
    std::vector<std::byte> buffer_;
    uint32_t next_ = 0;  // slice
};

/// Opens the file that a header names, by that name.
using OpenBeside = std::function<std::unique_ptr<ByteSource>(const std::string& name)>;

/// Opens a MetaImage, NRRD or legacy VTK file of one number a sample on a grid of up to three dimensions.
/// throws  Error{not_found, io, malformed, unsupported}, naming the file and the place
std::unique_ptr<VolumeSource> open_volume(const std::string& path);
std::unique_ptr<VolumeSource> open_volume(std::unique_ptr<ByteSource> source, const OpenBeside& open_beside);

/// What a file of samples alone does not say.
struct RawVolumeLayout {
    std::array<uint32_t, 3> size = {0, 0, 0};
    SampleType type = SampleType::uint8;
    bool is_big_endian = false;
    Vec3d spacing = Vec3d::Ones();
    Vec3d origin = Vec3d::Zero();   // of the first sample
    std::optional<uint64_t> offset; // of the first sample, in bytes; none: the samples are the last bytes of the file
};

/// throws  Error{not_found, io, malformed}
std::unique_ptr<VolumeSource> open_raw_volume(std::unique_ptr<ByteSource> source, const RawVolumeLayout& layout);

}  // namespace strata
