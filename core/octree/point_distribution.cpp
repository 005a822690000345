#include "core/octree/point_distribution.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <numeric>

#include "core/parallel.h"

namespace strata {
namespace {

// Hands the batches of a source out to workers, in ascending order.
template <typename Body>
void for_each_batch(const PointSource& source, int threads, std::span<const int> wanted, const Body& body) {
    std::atomic<uint64_t> next = 0;
    std::atomic<bool> failed = false;
    parallel_workers(threads, [&](int worker) {
        PointBatch batch;
        try {
            for (uint64_t index; !failed && (index = next++) < source.batch_count();) {
                source.read_batch(index, wanted, batch);
                body(worker, batch);
            }
        } catch (...) {
            failed = true;
            throw;
        }
    });
}

void extend_axis(const std::vector<int32_t>& values, int axis, QuantaBounds& bounds) {
    int32_t low = bounds.min[axis], high = bounds.max[axis];
    for (const int32_t value : values) {
        low = std::min(low, value);
        high = std::max(high, value);
    }
    bounds.min[axis] = low;
    bounds.max[axis] = high;
}

// Points that were outside of the expected bounds have no cell; the caller sees it by the bounds and counts again.
bool fits(const OctreeFrame& frame, const QuantaBounds& bounds) {
    return (bounds.min.array() >= frame.min_quanta.array()).all() && (bounds.max.array() <= frame.max_quanta.array()).all();
}

void count_batch(const PointBatch& batch, const OctreeFrame& frame, Partition& partition) {
    const int shift = partition.run_shift();
    uint32_t run_x = 0, run_y = 0, run_z = 0;
    uint64_t run = 0;
    for (size_t i = 0; i < batch.size; ++i) {
        const uint32_t x = frame.cell(0, frame.stored(0, batch.x[i])), y = frame.cell(1, frame.stored(1, batch.y[i])),
                       z = frame.cell(2, frame.stored(2, batch.z[i]));
        if (((x ^ run_x) | (y ^ run_y) | (z ^ run_z)) >> shift == 0) {
            ++run;
            continue;
        }
        if (run > 0) partition.count(run_x, run_y, run_z, run);
        run_x = x, run_y = y, run_z = z;
        run = 1;
    }
    if (run > 0) partition.count(run_x, run_y, run_z, run);
}

template <typename T, typename IsNone>
void extend_ranges(std::span<const T> values, int components, IsNone is_none, std::vector<double>& low, std::vector<double>& high) {
    for (int c = 0; c < components; ++c) {
        T least = std::numeric_limits<T>::max(), greatest = std::numeric_limits<T>::lowest();
        for (size_t i = size_t(c); i < values.size(); i += size_t(components)) {
            if (is_none(values[i])) continue;
            least = values[i] < least ? values[i] : least;
            greatest = values[i] > greatest ? values[i] : greatest;
        }
        if (least > greatest) continue;  // none but NaN and no_data
        low[size_t(c)] = std::min(low[size_t(c)], double(least));
        high[size_t(c)] = std::max(high[size_t(c)], double(greatest));
    }
}

template <size_t size_bytes>
void scatter_fixed(const std::byte* column, size_t n, const uint32_t* place, size_t record_size, std::byte* to) {
    for (size_t i = 0; i < n; ++i) std::memcpy(to + place[i] * record_size, column + i * size_bytes, size_bytes);
}

void scatter_column(const std::vector<std::byte>& column, size_t size_bytes, const std::vector<uint32_t>& place,
                    size_t record_size, std::byte* to) {
    const size_t n = place.size();
    switch (size_bytes) {
        case 1: return scatter_fixed<1>(column.data(), n, place.data(), record_size, to);
        case 2: return scatter_fixed<2>(column.data(), n, place.data(), record_size, to);
        case 4: return scatter_fixed<4>(column.data(), n, place.data(), record_size, to);
        case 6: return scatter_fixed<6>(column.data(), n, place.data(), record_size, to);
        case 8: return scatter_fixed<8>(column.data(), n, place.data(), record_size, to);
        default:
            for (size_t i = 0; i < n; ++i)
                std::memcpy(to + place[i] * record_size, column.data() + i * size_bytes, size_bytes);
    }
}

// Turns batches into records grouped by chunk, and passes them on in pieces that are worth a write.
class Distributor {
public:
    Distributor(const OctreeFrame& frame, const Partition& partition, const RecordLayout& layout, ChunkStore& store,
                size_t piece_bytes)
        : frame_(frame), partition_(partition), layout_(layout), store_(store),
          piece_bytes_(piece_bytes / layout.size * layout.size), waiting_(partition.chunks().size()),
          count_(partition.chunks().size(), 0) {}

    void add(const PointBatch& batch) {
        group(batch);
        records_.resize(batch.size * layout_.size);
        for (size_t i = 0; i < batch.size; ++i) {
            const int32_t p_quanta[3] = {frame_.stored(0, batch.x[i]), frame_.stored(1, batch.y[i]), frame_.stored(2, batch.z[i])};
            std::memcpy(records_.data() + place_[i] * layout_.size, p_quanta, 12);
        }
        for (size_t a = 0; a < batch.columns.size(); ++a)
            scatter_column(batch.columns[a], layout_.attributes[a].size_bytes(), place_, layout_.size,
                           records_.data() + layout_.offsets[a]);
        size_t begin = 0;
        for (const uint32_t chunk : touched_) {
            const size_t size = count_[chunk] * layout_.size;
            pass_on(chunk, std::span(records_).subspan(begin, size));
            begin += size;
            count_[chunk] = 0;
        }
    }

    void flush() {
        for (uint32_t chunk = 0; chunk < waiting_.size(); ++chunk)
            if (!waiting_[chunk].empty()) store_.add(chunk, waiting_[chunk]);
    }

private:
    // place_[i]: where record i goes so that records of a chunk lie together, chunks in order of appearance.
    void group(const PointBatch& batch) {
        chunk_.resize(batch.size);
        place_.resize(batch.size);
        touched_.clear();
        for (size_t i = 0; i < batch.size; ++i) {
            chunk_[i] = partition_.chunk_of(frame_.cell(0, frame_.stored(0, batch.x[i])), frame_.cell(1, frame_.stored(1, batch.y[i])),
                                            frame_.cell(2, frame_.stored(2, batch.z[i])));
            if (chunk_[i] >= count_.size()) throw changed_source();
            if (count_[chunk_[i]]++ == 0) touched_.push_back(chunk_[i]);
        }
        if (start_.size() < count_.size()) start_.resize(count_.size());
        uint32_t sum = 0;
        for (const uint32_t chunk : touched_) {
            start_[chunk] = sum;
            sum += count_[chunk];
        }
        for (size_t i = 0; i < batch.size; ++i) place_[i] = start_[chunk_[i]]++;
    }

    void pass_on(uint32_t chunk, std::span<const std::byte> records) {
        std::vector<std::byte>& waiting = waiting_[chunk];
        if (waiting.empty() && records.size() >= piece_bytes_) return store_.add(chunk, records);
        if (waiting.capacity() == 0) waiting.reserve(piece_bytes_);
        while (!records.empty()) {
            const size_t room = std::min(piece_bytes_ - waiting.size(), records.size());
            waiting.insert(waiting.end(), records.begin(), records.begin() + ptrdiff_t(room));
            records = records.subspan(room);
            if (waiting.size() < piece_bytes_) continue;
            store_.add(chunk, waiting);
            waiting.clear();
        }
    }

    const OctreeFrame& frame_;
    const Partition& partition_;
    const RecordLayout& layout_;
    ChunkStore& store_;
    size_t piece_bytes_;
    std::vector<std::vector<std::byte>> waiting_;  // [chunks]
    std::vector<uint32_t> count_, start_;          // [chunks] of the current batch
    std::vector<uint32_t> chunk_, place_, touched_;
    std::vector<std::byte> records_;
};

}  // namespace

QuantaBounds count_points(const PointSource& source, int threads, const OctreeFrame& frame, Partition* partition,
                          const OnPoints& on_points) {
    std::vector<QuantaBounds> bounds(size_t(threads), QuantaBounds{});
    for_each_batch(source, threads, {}, [&](int worker, const PointBatch& batch) {
        QuantaBounds of_batch;
        extend_axis(batch.x, 0, of_batch);
        extend_axis(batch.y, 1, of_batch);
        extend_axis(batch.z, 2, of_batch);
        if (partition && batch.size > 0 && fits(frame, of_batch)) count_batch(batch, frame, *partition);
        QuantaBounds& mine = bounds[size_t(worker)];
        mine.min = mine.min.cwiseMin(of_batch.min);
        mine.max = mine.max.cwiseMax(of_batch.max);
        mine.points += batch.size;
        if (on_points) on_points(batch.size);
    });
    QuantaBounds all;
    for (const QuantaBounds& part : bounds) {
        all.min = all.min.cwiseMin(part.min);
        all.max = all.max.cwiseMax(part.max);
        all.points += part.points;
    }
    return all;
}

AttributeRanges::AttributeRanges(const std::vector<Attribute>& attributes) {
    for (const Attribute& attribute : attributes) {
        min.emplace_back(attribute.components, std::numeric_limits<double>::infinity());
        max.emplace_back(attribute.components, -std::numeric_limits<double>::infinity());
    }
}

void AttributeRanges::extend(const std::vector<Attribute>& attributes, const PointBatch& batch) {
    for (size_t a = 0; a < attributes.size(); ++a) {
        const double no_data = attributes[a].no_data;
        const auto extend_as = [&]<typename T>() {
            const auto extend_without = [&](auto is_none) { extend_ranges(batch.column<T>(a), attributes[a].components, is_none, min[a], max[a]); };
            if (std::isnan(no_data))
                extend_without([](T) { return false; });  // nothing to compare in this loop over all points
            else
                extend_without([no_data](T value) { return double(value) == no_data; });
        };
        switch (attributes[a].type) {
            case ScalarType::int8: extend_as.operator()<int8_t>(); break;
            case ScalarType::uint8: extend_as.operator()<uint8_t>(); break;
            case ScalarType::int16: extend_as.operator()<int16_t>(); break;
            case ScalarType::uint16: extend_as.operator()<uint16_t>(); break;
            case ScalarType::int32: extend_as.operator()<int32_t>(); break;
            case ScalarType::uint32: extend_as.operator()<uint32_t>(); break;
            case ScalarType::int64: extend_as.operator()<int64_t>(); break;
            case ScalarType::uint64: extend_as.operator()<uint64_t>(); break;
            case ScalarType::float32: extend_as.operator()<float>(); break;
            case ScalarType::float64: extend_as.operator()<double>(); break;
        }
    }
}

void AttributeRanges::extend(const AttributeRanges& other) {
    for (size_t a = 0; a < min.size(); ++a)
        for (size_t c = 0; c < min[a].size(); ++c) {
            min[a][c] = std::min(min[a][c], other.min[a][c]);
            max[a][c] = std::max(max[a][c], other.max[a][c]);
        }
}

void AttributeRanges::append(const AttributeRanges& of_more_attributes) {
    min.insert(min.end(), of_more_attributes.min.begin(), of_more_attributes.min.end());
    max.insert(max.end(), of_more_attributes.max.begin(), of_more_attributes.max.end());
}

AttributeRanges distribute_points(const PointSource& source, int threads, uint64_t buffer_bytes, const OctreeFrame& frame,
                                  const Partition& partition, const RecordLayout& layout, ChunkStore& store,
                                  const OnPoints& on_points) {
    const uint64_t share = buffer_bytes / (uint64_t(threads) * std::max<size_t>(partition.chunks().size(), 1));
    const size_t piece_bytes = std::clamp<size_t>(share, 2 * layout.size, size_t{1} << 17);
    const std::vector<Attribute>& attributes = source.info().attributes;
    std::vector<int> wanted(attributes.size());
    std::iota(wanted.begin(), wanted.end(), 0);
    std::vector<Distributor> distributors(size_t(threads), Distributor(frame, partition, layout, store, piece_bytes));
    std::vector<AttributeRanges> ranges(static_cast<size_t>(threads), AttributeRanges(attributes));
    for_each_batch(source, threads, wanted, [&](int worker, const PointBatch& batch) {
        distributors[size_t(worker)].add(batch);
        ranges[size_t(worker)].extend(attributes, batch);
        if (on_points) on_points(batch.size);
    });
    for (Distributor& distributor : distributors) distributor.flush();
    for (size_t worker = 1; worker < ranges.size(); ++worker) ranges[0].extend(ranges[worker]);
    return ranges[0];
}

}  // namespace strata
