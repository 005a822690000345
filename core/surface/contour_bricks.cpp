#include <algorithm>
#include <bit>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/surface/brick_cell_counter.h"
#include "core/surface/brick_emitter.h"
#include "core/surface/brick_layers.h"
#include "core/surface/contour.h"
#include "core/surface/piece_buffer.h"

namespace strata {
namespace {

constexpr int kSide = kFieldBrickSide;
constexpr size_t kBlock = 32;  // bricks that a thread takes at a time

// Numbers vertices and triangles of a layer after those of the layers before, and tells how many there are before a part.
class Numbering {
public:
    // above  may be null
    Numbering(BrickCells& cells, BrickCells* above, size_t isovalues, uint64_t first_vertex)
        : cells_(cells), above_(above), first_(first_vertex), next_(first_vertex) {
        for (size_t part = 0; part < cells.parts.size(); ++part) number(cells.parts[part], false);
        late_end_ = next_;
        if (above != nullptr)
            for (size_t part = 0; part < isovalues * above->bricks(); ++part) number(above->parts[part], true);
        if (next_ > std::numeric_limits<uint32_t>::max())
            throw Error(ErrorKind::limit, "the surface has more than 4294967295 vertices: take a coarser field, or a part of it");
        for (BrickPart& part : cells.parts) {
            part.first_triangle = triangles_;
            triangles_ += part.triangles;
        }
    }

    uint64_t vertices() const { return next_ - first_; }
    uint64_t triangles() const { return triangles_; }
    uint64_t end() const { return next_; }

    // Parts with vertices: those of the cells, then those above with the vertices that come early.
    size_t vertex_parts() const { return cells_.parts.size() + (above_ != nullptr ? above_->parts.size() : 0); }
    bool is_early(size_t part) const { return part >= cells_.parts.size(); }
    uint64_t vertices_before(size_t part) const {
        const size_t late = cells_.parts.size();
        if (part == vertex_parts()) return vertices();
        if (part == late) return late_end_ - first_;
        return (part < late ? cells_.parts[part].first[2][0] : above_->parts[part - late].first[0][0]) - first_;
    }
    size_t triangle_parts() const { return cells_.parts.size(); }
    uint64_t triangles_before(size_t part) const { return part == triangle_parts() ? triangles_ : cells_.parts[part].first_triangle; }

private:
    void number(BrickPart& part, bool early) {
        const auto take = [&](uint32_t& first, uint32_t count) { first = uint32_t(std::exchange(next_, next_ + count)); };
        for (size_t plane = 0; plane < kSide; ++plane)
            for (size_t axis = 0; axis < 3; ++axis)
                if (BrickPart::comes_early(axis, plane) == early) take(part.first[axis][plane], uint32_t(std::popcount(part.crossed[axis][plane])));
        if (!early) take(part.first_inner, part.inner);
    }

    BrickCells& cells_;
    BrickCells* above_;
    uint64_t first_, next_, late_end_ = 0;
    uint64_t triangles_ = 0;
};

class BrickContour {
public:
    /// sink, mesh  one of them, null the other: pieces go on, or all is kept
    BrickContour(FieldBrickSource& source, const ContourSettings& settings, SurfaceSink* sink, ContourMesh* mesh)
        : source_(source),
          settings_(settings),
          sink_(sink),
          mesh_(mesh),
          levels_(settings),
          window_(source, settings, levels_, [this](uint64_t bytes, bool must) { make_room(bytes, must); }),
          counter_(source, settings, levels_, [this](uint64_t bytes, bool must) { make_room(bytes, must); }),
          emitter_(source, settings, levels_, window_),
          piece_(settings) {
        if (!settings.colors.empty() && settings.colors.size() != settings.isovalues.size())
            throw Error(ErrorKind::usage, std::to_string(settings.isovalues.size()) + " isovalues have " +
                                              std::to_string(settings.colors.size()) + " colors");
    }

    ContourReport run() {
        if (settings_.isovalues.empty()) return report_;
        window_.read_to(std::numeric_limits<int32_t>::min());
        if (window_.empty()) return report_;
        const std::array<int32_t, 3> start = {window_.first().corners[0][0], window_.first().corners[0][1], window_.first().k};
        emitter_.set_start(start);
        origin_ = source_.placement().world_from_index(Vec3d(start[0], start[1], start[2]));
        if (mesh_ != nullptr) mesh_->origin = origin_;

        for (int32_t k = start[2] - kSide;;) {
            window_.read_to(k + 2 * kSide);
            if (!cells_) {
                cells_ = counter_.count(k, layers_at(k), nullptr);
                if (cells_ && crosses_early(*cells_)) BrickEmitter::refuse_absent(*cells_);  // no layer was before that it could have come with
            }
            above_ = counter_.count(k + kSide, layers_at(k + kSide), cells_ ? &*cells_ : nullptr);
            if (cells_) pass_on(*cells_, above_ ? &*above_ : nullptr);
            if (cells_) counter_.give_back(std::move(*cells_));
            cells_ = std::move(above_);
            above_.reset();
            window_.drop_below(k);  // k itself is below the next: slopes ask for it
            if (cells_) {
                k += kSide;
                continue;
            }
            const std::optional<int32_t> next = window_.next_above(k + kSide);
            if (!next) break;
            k = *next - kSide;
        }
        const SampleStatistics& samples = window_.statistics();
        report_.nan_samples = samples.nan;
        report_.least = samples.least;
        report_.greatest = samples.greatest;
        report_.meets_boundary = counter_.is_open();
        report_.ambiguous_cells = counter_.ambiguous_cells();
        report_.tunnel_cells = counter_.tunnel_cells();
        return report_;
    }

private:
    MaskedLayers layers_at(int32_t k) const { return {window_.at(k), window_.at(k + kSide)}; }

    static bool crosses_early(const BrickCells& cells) {
        return std::any_of(cells.parts.begin(), cells.parts.end(),
                           [](const BrickPart& part) { return (part.crossed[0][0] | part.crossed[1][0]) != 0; });
    }

    void pass_on(BrickCells& cells, BrickCells* above) {
        const Numbering numbers(cells, above, levels_.isovalues, report_.vertices);
        if (numbers.vertices() == 0 && numbers.triangles() == 0) return;
        find_around(cells.corners, {&cells.corners, above != nullptr ? &above->corners : nullptr}, 1, settings_.threads, around_);
        const NumberedCells layer = {.cells = cells, .layers = layers_at(cells.k), .above = above, .around = &around_};
        std::optional<NumberedCells> next;
        if (above != nullptr) next.emplace(NumberedCells{.cells = *above, .layers = layers_at(above->k)});
        const bool is_whole = sink_ == nullptr || piece_.bytes_of(numbers.vertices(), numbers.triangles()) <= room_for_piece();
        if (is_whole) pass_on_whole(numbers, layer, next);
        else pass_on_parts(numbers, layer, next);
        report_.vertices = numbers.end();
        report_.triangles += numbers.triangles();
    }

    void pass_on_whole(const Numbering& numbers, const NumberedCells& layer, const std::optional<NumberedCells>& next) {
        BrickTarget out = room_for(numbers.vertices(), numbers.triangles());
        out.first_vertex = sink_ != nullptr ? report_.vertices : 0;
        read_ahead();
        const size_t bricks = layer.cells.bricks();
        parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
            CutStatistics cuts;
            for (size_t b = begin; b < end; ++b)
                for (size_t s = 0; s < levels_.isovalues; ++s) {
                    emitter_.put_vertices(layer, s * bricks + b, false, out, cuts);
                    emitter_.put_triangles(layer, s * bricks + b, out);
                }
            keep(cuts);
        });
        if (next)
            parallel_blocks(settings_.threads, next->cells.bricks(), kBlock, [&](size_t begin, size_t end) {
                CutStatistics cuts;
                for (size_t b = begin; b < end; ++b)
                    for (size_t s = 0; s < levels_.isovalues; ++s) emitter_.put_vertices(*next, s * next->cells.bricks() + b, true, out, cuts);
                keep(cuts);
            });
        if (sink_ == nullptr) return;
        color_vertices(numbers, layer, next, 0, numbers.vertex_parts());
        hand_on(numbers.vertices(), numbers.triangles());
    }

    // A layer's surface in pieces: first its vertices, then its triangles.
    void pass_on_parts(const Numbering& numbers, const NumberedCells& layer, const std::optional<NumberedCells>& next) {
        uint64_t largest = 0;  // a part
        for (size_t part = 0; part < numbers.vertex_parts(); ++part)
            largest = std::max(largest, piece_.bytes_of(numbers.vertices_before(part + 1) - numbers.vertices_before(part), 0));
        for (size_t part = 0; part < numbers.triangle_parts(); ++part)
            largest = std::max(largest, piece_.bytes_of(0, numbers.triangles_before(part + 1) - numbers.triangles_before(part)));
        if (largest > room_for_piece()) make_room(largest, true);
        const uint64_t most = std::max(largest, room_for_piece());

        const size_t late = layer.cells.parts.size();
        const auto vertices = [&](size_t part) { return numbers.vertices_before(part); };
        // Others may keep more for a vertex than this: about as many come as with their triangles.
        const uint64_t vertex_bytes = piece_.bytes_of(1, 2);
        PieceBuffer::for_pieces(numbers.vertex_parts(), vertices, vertex_bytes, most, [&](size_t first, size_t end) {
            const uint64_t count = vertices(end) - vertices(first);
            BrickTarget out = room_for(count, 0);
            out.first_vertex = report_.vertices + vertices(first);
            parallel_blocks(settings_.threads, end - first, kBlock, [&](size_t begin, size_t stop) {
                CutStatistics cuts;
                for (size_t part = first + begin; part < first + stop; ++part) {
                    if (numbers.is_early(part)) {
                        emitter_.put_vertices(*next, part - late, true, out, cuts);
                    } else {
                        emitter_.put_vertices(layer, part, false, out, cuts);
                        emitter_.put_inner(layer, part, out);
                    }
                }
                keep(cuts);
            });
            color_vertices(numbers, layer, next, first, end);
            hand_on(count, 0);
        });
        const auto triangles = [&](size_t part) { return numbers.triangles_before(part); };
        PieceBuffer::for_pieces(numbers.triangle_parts(), triangles, piece_.bytes_of(0, 1), most, [&](size_t first, size_t end) {
            const uint64_t count = triangles(end) - triangles(first);
            BrickTarget out = room_for(0, count);
            out.positions = out.normals = nullptr;
            out.first_triangle = triangles(first);
            parallel_blocks(settings_.threads, end - first, kBlock, [&](size_t begin, size_t stop) {
                for (size_t part = first + begin; part < first + stop; ++part) emitter_.put_triangles(layer, part, out);
            });
            hand_on(0, count);
        });
    }

    // Of some parts of a piece.
    void color_vertices(const Numbering& numbers, const NumberedCells& layer, const std::optional<NumberedCells>& next, size_t first,
                        size_t end) {
        if (settings_.colors.empty()) return;
        const size_t late = layer.cells.parts.size();
        for (size_t part = first; part < end; ++part) {
            const size_t isovalue = numbers.is_early(part) ? (part - late) / next->cells.bricks() : part / layer.cells.bricks();
            piece_.add_colors(numbers.vertices_before(part + 1) - numbers.vertices_before(part), isovalue);
        }
    }

    void keep(const CutStatistics& cuts) {
        const std::lock_guard lock(mutex_);
        report_.clamped_vertices += cuts.clamped;
        report_.largest_shift_cells = std::max(report_.largest_shift_cells, cuts.largest_shift);
    }

    void hand_on(uint64_t vertices, uint64_t triangles) { piece_.hand_on(origin_, vertices, triangles, *sink_); }

    // After what came before, where all is kept.
    BrickTarget room_for(uint64_t vertices, uint64_t triangles) {
        if (sink_ != nullptr) {
            piece_.make_room(vertices, triangles, room_for_piece());
            return {.positions = piece_.positions(), .normals = piece_.normals(), .triangles = piece_.triangles()};
        }
        mesh_->positions.resize(size_t(report_.vertices + vertices));
        if (settings_.normals) mesh_->normals.resize(mesh_->positions.size());
        mesh_->triangles.resize(size_t(report_.triangles + triangles));
        return {.positions = mesh_->positions.data(), .normals = settings_.normals ? mesh_->normals.data() : nullptr, .triangles = mesh_->triangles.data() + report_.triangles};
    }

    // By layers and their cells.
    uint64_t bytes_held() const {
        uint64_t bytes = window_.bytes() + counter_.bytes();
        for (const std::optional<BrickCells>* cells : {&cells_, &above_})
            if (*cells) bytes += (*cells)->bytes() + (*cells)->bricks() * sizeof around_[0];
        return bytes;
    }

    uint64_t room_for_piece() const {
        const uint64_t held = bytes_held();
        return PieceBuffer::most_bytes(settings_, settings_.memory_bytes - std::min(held, settings_.memory_bytes));
    }

    // Reads the next layer while this one's surface is made.
    void read_ahead() {
        const uint64_t held = bytes_held() + piece_.bytes();
        if (held <= settings_.memory_bytes) window_.read_ahead(settings_.memory_bytes - held);
    }

    // Before memory is taken.
    void make_room(uint64_t more, bool must) {
        const auto fits = [&] { return bytes_held() + piece_.bytes() + more <= settings_.memory_bytes; };
        if (fits()) return;
        piece_.drop();
        if (fits() || !must) return;
        window_.drop_spare();
        if (!fits())
            throw Error(ErrorKind::limit, "a layer of bricks and a piece of the surface in it need " +
                                              std::to_string((bytes_held() + more + settings_.memory_beside) * settings_.memory_parts) + " bytes of memory, " +
                                              std::to_string((settings_.memory_bytes + settings_.memory_beside) * settings_.memory_parts) + " are allowed");
    }

    FieldBrickSource& source_;
    const ContourSettings& settings_;
    SurfaceSink* sink_;
    ContourMesh* mesh_;
    BrickLevels levels_;
    BrickLayerWindow window_;
    BrickCellCounter counter_;
    BrickEmitter emitter_;
    PieceBuffer piece_;
    Vec3d origin_ = Vec3d::Zero();

    std::optional<BrickCells> cells_, above_;  // of the layer that is passed on, and of the next
    std::vector<AroundBrick> around_;          // of the cells passed on
    std::mutex mutex_;
    ContourReport report_;
};

}  // namespace

ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, SurfaceSink& sink) {
    return BrickContour(source, settings, &sink, nullptr).run();
}

ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, ContourMesh& out) {
    out = {};
    return BrickContour(source, settings, nullptr, &out).run();
}

}  // namespace strata
