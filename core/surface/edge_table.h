#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/surface/large_array.h"
#include "core/surface/paged_array.h"

namespace strata {

/// How many edges of which kind there are.
struct EdgeCounts {
    uint64_t edges = 0;
    uint64_t boundary = 0;     // with one face
    uint64_t nonmanifold = 0;  // with more than two
    uint64_t flipped = 0;      // with two that turn opposite ways
    uint64_t open = 0;         // that are not used as often one way as the other
};

/// How often each edge was met, and in which direction. Edges of the vertices of late are kept at the lesser one, where neighbors are near
/// each other in memory; those of earlier ones in a hash table, but for edges with two faces that agree, which are forgotten or put away. What does
/// not fit goes to a scratch store in sorted runs, and those are joined at the end: faces may come in any order.
class EdgeTable {
public:
    /// keep_all      forget none
    /// scratch       null: all stays in memory, with keep_all 32 bytes a vertex
    /// memory_bytes  for vertices of late and the table, beside 32 bytes for each vertex of two calls of add_vertices
    explicit EdgeTable(bool keep_all, ScratchRoom* scratch = nullptr, uint64_t memory_bytes = std::numeric_limits<uint64_t>::max());

    /// Before the faces that use them.
    void add_vertices(uint64_t count);
    void add(uint32_t from, uint32_t to);
    /// After each face.
    void face_done() { ++faces_in_run_; }

    uint64_t memory_bytes() const { return late_.size() * sizeof(Star) + early_.keys.size() * sizeof early_.keys[0] + early_.states.size(); }
    /// Of the edges up to here; those that were forgotten have two faces.
    EdgeCounts count();

private:
    static constexpr size_t kAtVertex = 6;
    /// The edges from a vertex to greater ones; half of all, which are 6 on average, and others in the hash table.
    struct Star {
        std::array<uint32_t, kAtVertex> ends;
        std::array<uint8_t, kAtVertex> states;
        uint16_t count;
    };
    struct Slots {
        std::vector<uint64_t> keys;  // lesser vertex above greater; kFree
        std::vector<uint8_t> states;
        size_t used = 0;
    };
    struct Part {
        uint64_t offset, edges;
    };
    struct Run {  // edges in the scratch store, ascending
        std::vector<Part> parts;
        uint64_t last_key = 0;
    };
    class RunReader;

    static size_t slot_of(const Slots& slots, uint64_t key);
    uint8_t& state_of(uint32_t least, uint32_t greatest);
    uint8_t& early_state_of(uint64_t key);
    void move_early(size_t leaving);
    void end_run();
    void move_to(size_t capacity, bool forget);
    void spill();
    void put_away(const Star& star, uint32_t vertex);
    void append_to(Run& run, uint64_t key, std::span<const std::byte> records);
    uint64_t count_runs(EdgeCounts& counts);

    // Of a state: bits 0-2: times met from the lesser vertex, 3-5: from the greater; 6-7: the last run, in the hash table.
    bool keep_all_;
    ScratchRoom* scratch_;
    uint64_t table_bytes_;        // for the hash table and what it is sorted in
    uint64_t most_slots_;
    uint64_t most_of_run_;        // vertices
    uint32_t first_late_ = 0;     // vertex
    uint32_t first_of_run_ = 0;   // likewise: those that came in this run
    LargeArray<Star> late_;       // from first_late_ on
    Slots early_;
    std::vector<Run> runs_;       // the first: of vertices as they left
    std::vector<std::byte> leaving_;  // on the way to it
    uint64_t edges_ = 0;          // in more than one run of the scratch store they count for each
    uint64_t faces_in_run_ = 0;
    uint8_t run_ = 0;  // modulo 4
};

}  // namespace strata
