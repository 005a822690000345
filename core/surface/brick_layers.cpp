#include "core/surface/brick_layers.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr int kSide = kFieldBrickSide;
constexpr size_t kBlock = 32;  // bricks that a thread takes at a time
constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

BrickLevels::BrickLevels(const ContourSettings& settings) : below(settings.inside == ContourInside::below), isovalues(settings.isovalues.size()) {
    for (const double isovalue : settings.isovalues) {
        if (!std::isfinite(isovalue)) throw Error(ErrorKind::usage, "an isovalue is not finite");
        values.push_back(level_of(isovalue, below));
    }
    if (settings.open_at_nan) values.push_back(below ? kInfinity : -kInfinity);
}

void BrickLayerWindow::read_to(int32_t k) {
    if (ahead_.valid()) ahead_.wait();  // others ask the source for values then
    while (!ended_ && (layers_.empty() || layers_.back().layer.k < k)) {
        if (!ahead_.valid()) make_room_(bytes_to_read(), false);
        std::optional<MaskedLayer> next = ahead_.valid() ? ahead_.get() : next_layer(std::exchange(spare_, {}));
        if (!next) {
            ended_ = true;
            break;
        }
        MaskedLayer& samples = *next;
        check(samples.layer);
        last_k_ = samples.layer.k;
        const size_t bricks = samples.layer.corners.size();
        if (bricks == 0) continue;
        make_room_(MaskedLayer::bytes_of(samples.layer) + levels_.values.size() * bricks * sizeof samples.masks[0], true);
        find_masks(samples);
        layers_.push_back(std::move(samples));
    }
}

// used  for its memory
std::optional<MaskedLayer> BrickLayerWindow::next_layer(MaskedLayer used) {
    return source_.next_layer(used.layer) ? std::optional(std::move(used)) : std::nullopt;
}

void BrickLayerWindow::check(const FieldBrickLayer& layer) const {
    const auto out_of_place = [](int32_t c) { return c % kSide != 0 || std::abs(int64_t{c}) > int64_t{1} << 30; };
    if (!(last_k_ < layer.k) || out_of_place(layer.k))
        throw Error(ErrorKind::malformed, "a layer of bricks at k = " + std::to_string(layer.k) + " is out of order or place");
    if (layer.values.size() != layer.corners.size() * kFieldBrickSamples)
        throw Error(ErrorKind::malformed,
                    std::to_string(layer.corners.size()) + " bricks have " + std::to_string(layer.values.size()) + " samples");
    for (size_t b = 0; b < layer.corners.size(); ++b)
        if (out_of_place(layer.corners[b][0]) || out_of_place(layer.corners[b][1]) ||
            (b > 0 && !comes_before(layer.corners[b - 1], layer.corners[b])))
            throw Error(ErrorKind::malformed, "a brick at (" + std::to_string(layer.corners[b][0]) + ", " +
                                                  std::to_string(layer.corners[b][1]) + ", " + std::to_string(layer.k) +
                                                  ") is out of order or place");
}

// The next layer is taken to be as large as the last; what is spare is room for it.
uint64_t BrickLayerWindow::bytes_to_read() const {
    const uint64_t wanted = layers_.empty() ? 0 : MaskedLayer::bytes_of(layers_.back().layer), spare = MaskedLayer::bytes_of(spare_.layer);
    return wanted - std::min(wanted, spare);
}

void BrickLayerWindow::read_ahead(uint64_t room) {
    if (settings_.threads < 2 || settings_.normals || ended_ || ahead_.valid() || bytes_to_read() > room) return;
    try {
        ahead_ = std::async(std::launch::async,
                            [this, used = std::exchange(spare_, {})]() mutable { return next_layer(std::move(used)); });
    } catch (const std::system_error&) {
        // No thread is to be had: it is read when it is wanted.
    }
}

void BrickLayerWindow::find_masks(MaskedLayer& samples) {
    const size_t bricks = samples.layer.corners.size(), levels = levels_.values.size();
    samples.masks.resize(levels * bricks);
    std::mutex mutex;
    parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
        SampleStatistics found;
        std::vector<uint64_t*> words(levels);
        for (size_t b = begin; b < end; ++b) {
            for (size_t s = 0; s < levels; ++s) words[s] = samples.masks[s * bricks + b].data();
            find_inside({samples.layer.values.data() + b * kFieldBrickSamples, kFieldBrickSamples}, levels_.values, levels_.below,
                        words.data(), found, simd_level_);
        }
        const std::lock_guard lock(mutex);
        statistics_.add(found);
    });
}

const MaskedLayer* BrickLayerWindow::at(int32_t k) const {
    for (const MaskedLayer& samples : layers_)
        if (samples.layer.k == k) return &samples;
    return nullptr;
}

std::optional<int32_t> BrickLayerWindow::next_above(int32_t k) const {
    for (const MaskedLayer& samples : layers_)
        if (samples.layer.k > k) return samples.layer.k;
    return std::nullopt;
}

void BrickLayerWindow::drop_below(int32_t k) {
    for (; !layers_.empty() && layers_.front().layer.k < k; layers_.pop_front()) spare_ = std::move(layers_.front());
}

uint64_t BrickLayerWindow::bytes() const {
    uint64_t bytes = spare_.bytes();
    for (const MaskedLayer& samples : layers_) bytes += samples.bytes();
    return bytes;
}

}  // namespace strata
