#include "core/surface/surface_report.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <utility>

namespace strata {
namespace {

constexpr uint64_t kFree = std::numeric_limits<uint64_t>::max();  // no edge: its vertices would be the same
constexpr uint64_t kRunFaces = 65'536;
constexpr size_t kLeastSlots = 1024;

constexpr uint8_t kOneUp = 1, kOneDown = 8, kMostTimes = 7, kTimes = 0x3F;

uint8_t times_up(uint8_t state) { return state & 7; }
uint8_t times_down(uint8_t state) { return state >> 3 & 7; }

bool is_settled(uint8_t state) { return (state & kTimes) == (kOneUp | kOneDown); }

}  // namespace

size_t EdgeTable::slot_of(const Slots& slots, uint64_t key) {
    // Fibonacci hashing of a mixed key: vertices of neighbours differ in their low bits only.
    const uint64_t mixed = (key ^ key >> 29) * 0x9E3779B97F4A7C15u;
    const size_t mask = slots.keys.size() - 1;
    size_t slot = size_t(mixed >> (64 - std::countr_zero(slots.keys.size())));
    while (slots.keys[slot] != key && slots.keys[slot] != kFree) slot = (slot + 1) & mask;
    return slot;
}

// Of an edge that is new, 0.
uint8_t& EdgeTable::early_state_of(uint64_t key) {
    if (early_.keys.size() < 2 * (early_.used + 1)) move_to(std::max(kLeastSlots, 2 * early_.keys.size()), false);
    const size_t slot = slot_of(early_, key);
    uint8_t& state = early_.states[slot];
    if (early_.keys[slot] == kFree) {
        early_.keys[slot] = key;
        ++early_.used;
        state = 0;
    }
    state = uint8_t((state & kTimes) | run_ << 6);
    return state;
}

uint8_t& EdgeTable::state_of(uint32_t least, uint32_t greatest) {
    if (least >= first_late_) {
        Star& star = late_[least - first_late_];
        for (size_t i = 0; i < star.count; ++i)
            if (star.ends[i] == greatest) return star.states[i];
        if (star.count < kAtVertex) {
            star.ends[star.count] = greatest;
            return star.states[star.count++] = 0;
        }
    }
    return early_state_of(uint64_t{least} << 32 | greatest);
}

void EdgeTable::add(uint32_t from, uint32_t to) {
    const bool up = from < to;
    uint8_t& state = up ? state_of(from, to) : state_of(to, from);
    edges_ += (state & kTimes) == 0;
    if ((up ? times_up(state) : times_down(state)) < kMostTimes) state = uint8_t(state + (up ? kOneUp : kOneDown));
}

// A run is as long as the table is large, which is swept at its end; and ends between pieces, as faces of the vertices of one are yet to come.
void EdgeTable::add_vertices(uint64_t count) {
    if (!keep_all_ && faces_in_run_ >= std::max<uint64_t>(kRunFaces, early_.used / 2)) end_run();
    const size_t before = late_.size();
    late_.resize(before + size_t(count));
    for (size_t i = before; i < late_.size(); ++i) late_[i].count = 0;
}

void EdgeTable::end_run() {
    const size_t leaving = first_of_run_ - first_late_;
    for (size_t i = 0; i < leaving; ++i)
        for (size_t k = 0; k < late_[i].count; ++k)
            if (!is_settled(late_[i].states[k])) {
                uint8_t& state = early_state_of(uint64_t{first_late_ + i} << 32 | late_[i].ends[k]);
                state = uint8_t(state | late_[i].states[k]);
            }
    std::copy(late_.begin() + leaving, late_.end(), late_.begin());
    late_.resize(late_.size() - leaving);
    first_late_ = first_of_run_;
    first_of_run_ += uint32_t(late_.size());
    move_to(early_.keys.size(), true);
    faces_in_run_ = 0;
    run_ = (run_ + 1) & 3;
}

// forget  what is settled and was not met in this run
void EdgeTable::move_to(size_t capacity, bool forget) {
    const auto stays = [&](size_t slot) {
        return early_.keys[slot] != kFree && !(forget && is_settled(early_.states[slot]) && early_.states[slot] >> 6 != run_);
    };
    if (forget) {
        size_t left = 0;
        for (size_t slot = 0; slot < early_.keys.size(); ++slot) left += stays(slot);
        capacity = std::max(kLeastSlots, std::bit_ceil(2 * (left + 1)));
        if (left == early_.used && capacity == early_.keys.size()) return;
    }
    Slots moved{.keys = std::vector<uint64_t>(capacity, kFree), .states = std::vector<uint8_t>(capacity)};
    for (size_t slot = 0; slot < early_.keys.size(); ++slot) {
        if (!stays(slot)) continue;
        const size_t to = slot_of(moved, early_.keys[slot]);
        moved.keys[to] = early_.keys[slot];
        moved.states[to] = early_.states[slot];
        ++moved.used;
    }
    early_ = std::move(moved);
}

void EdgeTable::count(SurfaceReport& report) const {
    const auto add = [&](uint8_t state) {
        const int up = times_up(state), down = times_down(state);
        report.boundary_edges += up + down == 1;
        report.nonmanifold_edges += up + down > 2;
        report.open_edges += up != down;
        report.flipped_edges += up + down == 2 && up != down;
    };
    for (const Star& star : late_)
        for (size_t i = 0; i < star.count; ++i) add(star.states[i]);
    for (size_t slot = 0; slot < early_.keys.size(); ++slot)
        if (early_.keys[slot] != kFree) add(early_.states[slot]);
}

void SurfaceMeter::add_vertices(uint64_t count) {
    const size_t before = parents_.size();
    parents_.resize(before + size_t(count));
    for (size_t i = before; i < parents_.size(); ++i) parents_[i] = uint32_t(i);
    used_.resize(parents_.size());
    edges_.add_vertices(count);
    report_.vertices += count;
}

uint32_t SurfaceMeter::root_of(uint32_t vertex) {
    while (parents_[vertex] != vertex) vertex = parents_[vertex] = parents_[parents_[vertex]];
    return vertex;
}

void SurfaceMeter::add_face(std::span<const uint32_t> corners, std::span<const Vec3d> positions) {
    const size_t count = corners.size();
    ++(count == 4 ? report_.quads : report_.triangles);
    bool degenerate = false;
    for (size_t i = 0; i < count; ++i)
        for (size_t j = 0; j < i; ++j) degenerate |= corners[i] == corners[j];
    if (degenerate) {
        ++report_.degenerate_faces;
        return;
    }
    if (used_vertices_ == 0) reference_ = positions[0];
    for (size_t i = 0; i < count; ++i) {
        if (!used_[corners[i]]) {
            used_[corners[i]] = true;
            ++used_vertices_;
            ++report_.components;
            report_.bounds.extend(positions[i]);
        }
        edges_.add(corners[i], corners[i + 1 == count ? 0 : i + 1]);
    }
    edges_.face_done();
    for (size_t i = 1; i < count; ++i) {
        const uint32_t a = root_of(corners[0]), b = root_of(corners[i]);
        if (a == b) continue;
        parents_[std::max(a, b)] = std::min(a, b);
        --report_.components;
    }
    const Vec3d a = positions[0] - reference_;
    for (size_t i = 2; i < count; ++i) {
        const Vec3d b = positions[i - 1] - reference_, c = positions[i] - reference_;
        report_.area += 0.5 * (b - a).cross(c - a).norm();
        six_volumes_ += a.dot(b.cross(c));
    }
}

SurfaceReport SurfaceMeter::report() const {
    SurfaceReport report = report_;
    report.unused_vertices = report.vertices - used_vertices_;
    report.edges = edges_.edges();
    edges_.count(report);
    const uint64_t faces = report.triangles + report.quads - report.degenerate_faces;
    report.euler_characteristic = int64_t(used_vertices_) - int64_t(report.edges) + int64_t(faces);
    report.volume = six_volumes_ / 6.0;
    return report;
}

void MeasuredSurface::add(const SurfacePiece& piece) {
    positions_.append(piece);
    meter_.add_vertices(piece.positions.size());
    std::array<Vec3d, 4> positions;
    const auto add_face = [&](std::span<const uint32_t> corners) {
        for (size_t i = 0; i < corners.size(); ++i) positions[i] = positions_[corners[i]];
        meter_.add_face(corners, std::span(positions).first(corners.size()));
    };
    for (const std::array<uint32_t, 3>& triangle : piece.triangles) add_face(triangle);
    for (const std::array<uint32_t, 4>& quad : piece.quads) add_face(quad);
    if (next_) next_->add(piece);
}

SurfaceReport measure_surface(const TriangleMesh& mesh) {
    SurfaceMeter meter(true);
    meter.add_vertices(mesh.positions.size());
    for (const std::array<uint32_t, 3>& triangle : mesh.triangles)
        meter.add_face(triangle, std::array{mesh.positions[triangle[0]], mesh.positions[triangle[1]], mesh.positions[triangle[2]]});
    return meter.report();
}

}  // namespace strata
