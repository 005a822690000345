#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "io/byte_source.h"
#include "io/volume/volume_header.h"

namespace strata {

/// The samples of a volume from the first to the last, through one small buffer.
class SampleStream {
public:
    virtual ~SampleStream() = default;
    /// The next samples, whole ones. Raw and deflated ones are in the order of bytes of the file, text in that of this machine.
    /// throws  Error{malformed, io}, naming the place
    virtual void read(std::span<std::byte> out) = 0;
    /// Bytes of the file behind the last sample, where that is known beforehand.
    virtual uint64_t bytes_behind() const { return 0; }
    /// After the last sample: checks what can be checked of the rest.
    virtual void finish() {}
};

/// source  of the samples; must live as long
/// throws  Error{malformed}: the file is shorter than its header says, as far as that can be seen
std::unique_ptr<SampleStream> open_samples(const ByteSource& source, const VolumeHeader& header);

}  // namespace strata
