#include "core/surface/edge_table.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <functional>
#include <queue>
#include <span>
#include <utility>

namespace strata {
namespace {

constexpr uint64_t kFree = std::numeric_limits<uint64_t>::max();  // no edge: its vertices would be the same
constexpr uint64_t kRunFaces = 65'536;
constexpr uint64_t kLeastRunVertices = 4'096;
constexpr size_t kLeastSlots = 1024;

constexpr uint8_t kOneUp = 1, kOneDown = 8, kMostTimes = 7, kTimes = 0x3F;

uint8_t times_up(uint8_t state) { return state & 7; }
uint8_t times_down(uint8_t state) { return state >> 3 & 7; }

bool is_settled(uint8_t state) { return (state & kTimes) == (kOneUp | kOneDown); }

uint8_t added(uint8_t a, uint8_t b) {
    const auto add = [](uint8_t x, uint8_t y) { return std::min<uint8_t>(kMostTimes, uint8_t(x + y)); };
    return uint8_t(add(times_up(a), times_up(b)) * kOneUp + add(times_down(a), times_down(b)) * kOneDown);
}

void count_edge(uint8_t state, EdgeCounts& counts) {
    const int up = times_up(state), down = times_down(state);
    counts.boundary += up + down == 1;
    counts.nonmanifold += up + down > 2;
    counts.open += up != down;
    counts.flipped += up + down == 2 && up != down;
}

// An edge in the scratch store.
constexpr size_t kRecord = sizeof(uint64_t) + sizeof(uint8_t);
constexpr size_t kGathered = 8'192 * kRecord;

void put_record(uint64_t key, uint8_t state, std::vector<std::byte>& out) {
    const size_t at = out.size();
    out.resize(at + kRecord);
    std::memcpy(out.data() + at, &key, sizeof key);
    out[at + sizeof key] = std::byte{state};
}

}  // namespace

// Reads a run through a buffer of its own.
class EdgeTable::RunReader {
public:
    RunReader(const ScratchStore& store, const Run& run, size_t records) : store_(store), run_(run), buffer_(records * kRecord) {}

    // The next edge, or kFree.
    uint64_t key = 0;
    uint8_t state = 0;
    void next() {
        if (at_ == filled_ && !fill()) {
            key = kFree;
            return;
        }
        std::memcpy(&key, buffer_.data() + at_, sizeof key);
        state = uint8_t(buffer_[at_ + sizeof key]);
        at_ += kRecord;
    }

private:
    bool fill() {
        while (part_ < run_.parts.size() && read_ == run_.parts[part_].edges) {
            ++part_;
            read_ = 0;
        }
        if (part_ == run_.parts.size()) return false;
        const Part& part = run_.parts[part_];
        const uint64_t records = std::min<uint64_t>(buffer_.size() / kRecord, part.edges - read_);
        at_ = 0;
        filled_ = size_t(records) * kRecord;
        store_.read(part.offset + read_ * kRecord, std::span(buffer_).first(filled_));
        read_ += records;
        return true;
    }

    const ScratchStore& store_;
    const Run& run_;
    size_t part_ = 0;
    uint64_t read_ = 0;  // edges of the part
    std::vector<std::byte> buffer_;
    size_t at_ = 0, filled_ = 0;
};

EdgeTable::EdgeTable(bool keep_all, ScratchRoom* scratch, uint64_t memory_bytes) : keep_all_(keep_all), scratch_(scratch) {
    constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();
    // A slot has 9 bytes, twice while the table grows by half; sorting a table that is half full takes 16 bytes for each of its edges.
    table_bytes_ = memory_bytes / 2;
    most_slots_ = scratch ? std::max<uint64_t>(kLeastSlots, std::bit_floor(table_bytes_ / 18)) : kNoLimit;
    most_of_run_ = scratch ? std::max(kLeastRunVertices, memory_bytes / 2 / (2 * sizeof(Star))) : kNoLimit;
}

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
    if (early_.keys.size() < 2 * (early_.used + 1)) {
        if (2 * early_.keys.size() > most_slots_) spill();
        else move_to(std::max(kLeastSlots, 2 * early_.keys.size()), false);
    }
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

// A run is as long as the table is large, which is swept at its end, if memory allows; and ends between pieces, as faces of the vertices of
// one are yet to come.
void EdgeTable::add_vertices(uint64_t count) {
    const uint64_t in_run = first_late_ + late_.size() - first_of_run_;
    const bool is_long = faces_in_run_ >= std::max<uint64_t>(kRunFaces, early_.used / 2), is_full = in_run > 0 && in_run + count > most_of_run_;
    if (is_full || (is_long && !keep_all_)) end_run();
    const size_t before = late_.size();
    late_.resize(before + size_t(count));
    for (size_t i = before; i < late_.size(); ++i) late_[i].count = 0;
}

// Edges of the first of the vertices of late that are not settled become early ones.
void EdgeTable::move_early(size_t leaving) {
    for (size_t i = 0; i < leaving; ++i) {
        if (keep_all_) put_away(late_[i], first_late_ + uint32_t(i));
        for (size_t k = 0; k < late_[i].count; ++k)
            if (!is_settled(late_[i].states[k])) {
                uint8_t& state = early_state_of(uint64_t{first_late_ + i} << 32 | late_[i].ends[k]);
                state = uint8_t(state | late_[i].states[k]);
            }
    }
    std::copy(late_.begin() + leaving, late_.end(), late_.begin());
    late_.resize(late_.size() - leaving);
    first_late_ += uint32_t(leaving);
}

void EdgeTable::end_run() {
    move_early(first_of_run_ - first_late_);
    first_of_run_ += uint32_t(late_.size());
    if (!keep_all_) move_to(early_.keys.size(), true);
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

// Sorts the hash table, which is empty then, into the scratch store. Mostly its edges come after those of the last run, which goes on.
void EdgeTable::spill() {
    std::vector<std::pair<uint64_t, uint8_t>> edges;
    edges.reserve(early_.used);
    for (size_t slot = 0; slot < early_.keys.size(); ++slot)
        if (early_.keys[slot] != kFree && (keep_all_ || !is_settled(early_.states[slot]) || early_.states[slot] >> 6 == run_))
            edges.emplace_back(early_.keys[slot], uint8_t(early_.states[slot] & kTimes));
    std::fill(early_.keys.begin(), early_.keys.end(), kFree);
    early_.used = 0;
    if (edges.empty()) return;
    std::sort(edges.begin(), edges.end());
    if (runs_.empty()) runs_.push_back({});
    if (runs_.size() == 1 || runs_.back().last_key >= edges.front().first) runs_.push_back({});
    std::vector<std::byte> records;
    for (const auto& [key, state] : edges) {
        put_record(key, state, records);
        if (records.size() >= kGathered || key == edges.back().first) append_to(runs_.back(), key, std::exchange(records, {}));
    }
}

// The edges of a vertex with two faces that agree, to the first run; vertices come in order.
void EdgeTable::put_away(const Star& star, uint32_t vertex) {
    std::array<size_t, kAtVertex> order;
    size_t count = 0;
    for (size_t k = 0; k < star.count; ++k) {
        if (!is_settled(star.states[k])) continue;
        size_t at = count++;
        for (; at > 0 && star.ends[order[at - 1]] > star.ends[k]; --at) order[at] = order[at - 1];
        order[at] = k;
    }
    for (size_t n = 0; n < count; ++n) put_record(uint64_t{vertex} << 32 | star.ends[order[n]], star.states[order[n]], leaving_);
    if (runs_.empty()) runs_.push_back({});
    if (leaving_.size() < kGathered) return;
    append_to(runs_.front(), uint64_t{vertex} << 32, leaving_);
    leaving_.clear();
}

void EdgeTable::append_to(Run& run, uint64_t last_key, std::span<const std::byte> records) {
    const uint64_t offset = scratch_->take(records.size());
    scratch_->store().write(offset, records);
    if (!run.parts.empty() && run.parts.back().offset + run.parts.back().edges * kRecord == offset) run.parts.back().edges += records.size() / kRecord;
    else run.parts.push_back({offset, records.size() / kRecord});
    run.last_key = last_key;
}

EdgeCounts EdgeTable::count() {
    EdgeCounts counts;
    if (!runs_.empty()) {
        move_early(late_.size());
        first_of_run_ = first_late_;
        spill();
        if (!leaving_.empty()) append_to(runs_.front(), 0, std::exchange(leaving_, {}));
        counts.edges = edges_ - count_runs(counts);
        return counts;
    }
    counts.edges = edges_;
    for (const Star& star : late_)
        for (size_t i = 0; i < star.count; ++i) count_edge(star.states[i], counts);
    for (size_t slot = 0; slot < early_.keys.size(); ++slot)
        if (early_.keys[slot] != kFree) count_edge(early_.states[slot], counts);
    return counts;
}

// Joins what the runs say of the same edges. Returns how often an edge of one was in an earlier one.
uint64_t EdgeTable::count_runs(EdgeCounts& counts) {
    early_ = {};
    const size_t records = size_t(std::clamp<uint64_t>(table_bytes_ / runs_.size(), 1'024, 65'536)) / kRecord;
    std::vector<RunReader> readers;
    readers.reserve(runs_.size());
    const auto comes_later = [&](size_t a, size_t b) { return readers[a].key > readers[b].key; };
    std::priority_queue<size_t, std::vector<size_t>, decltype(comes_later)> next(comes_later);
    const auto take_next = [&](size_t reader) {
        readers[reader].next();
        if (readers[reader].key != kFree) next.push(reader);
    };
    for (size_t r = 0; r < runs_.size(); ++r) {
        readers.emplace_back(scratch_->store(), runs_[r], records);
        take_next(r);
    }
    uint64_t again = 0;
    while (!next.empty()) {
        size_t reader = next.top();
        const uint64_t key = readers[reader].key;
        uint8_t state = 0;
        for (bool first = true; !next.empty() && readers[reader = next.top()].key == key; first = false) {
            next.pop();
            state = added(state, readers[reader].state);
            again += !first;
            take_next(reader);
        }
        count_edge(state, counts);
    }
    return again;
}

}  // namespace strata
