#include "core/cloud/cloud_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <numeric>

#include "core/parallel.h"

namespace strata {
namespace {

// What a worker has seen so far. Quanta and stored values: scaling keeps order or turns it round, so it can wait.
struct Tally {
    uint64_t points = 0;
    Vec3i min = Vec3i::Constant(std::numeric_limits<int32_t>::max());
    Vec3i max = Vec3i::Constant(std::numeric_limits<int32_t>::min());
    std::vector<std::vector<ValueRange>> ranges;
    std::array<uint64_t, 256> points_by_return{}, points_by_class{};

    void add_axis(int axis, const std::vector<int32_t>& quanta) {
        const auto [low, high] = std::minmax_element(quanta.begin(), quanta.end());
        min[axis] = std::min(min[axis], *low);
        max[axis] = std::max(max[axis], *high);
    }

    template <typename T>
    void add_column(const Attribute& attribute, const std::vector<std::byte>& column, std::vector<ValueRange>& components) {
        const size_t step = size_t(attribute.components), count = column.size() / sizeof(T);
        const bool check_no_data = !std::isnan(attribute.no_data);
        for (size_t c = 0; c < step; ++c) {
            bool any = false;
            T low{}, high{};
            for (size_t i = c; i < count; i += step) {
                T value;
                std::memcpy(&value, column.data() + i * sizeof value, sizeof value);
                if (value != value || (check_no_data && double(value) == attribute.no_data)) continue;
                low = any ? std::min(low, value) : value;
                high = any ? std::max(high, value) : value;
                any = true;
            }
            if (!any) continue;
            components[c].min = std::min(components[c].min, double(low));
            components[c].max = std::max(components[c].max, double(high));
        }
    }

    void add(const CloudInfo& info, const PointBatch& batch) {
        if (batch.size == 0) return;
        points += batch.size;
        add_axis(0, batch.x);
        add_axis(1, batch.y);
        add_axis(2, batch.z);
        for (size_t a = 0; a < info.attributes.size(); ++a) {
            const Attribute& attribute = info.attributes[a];
            const std::vector<std::byte>& column = batch.columns[a];
            switch (attribute.type) {
                case ScalarType::int8: add_column<int8_t>(attribute, column, ranges[a]); break;
                case ScalarType::uint8: add_column<uint8_t>(attribute, column, ranges[a]); break;
                case ScalarType::int16: add_column<int16_t>(attribute, column, ranges[a]); break;
                case ScalarType::uint16: add_column<uint16_t>(attribute, column, ranges[a]); break;
                case ScalarType::int32: add_column<int32_t>(attribute, column, ranges[a]); break;
                case ScalarType::uint32: add_column<uint32_t>(attribute, column, ranges[a]); break;
                case ScalarType::int64: add_column<int64_t>(attribute, column, ranges[a]); break;
                case ScalarType::uint64: add_column<uint64_t>(attribute, column, ranges[a]); break;
                case ScalarType::float32: add_column<float>(attribute, column, ranges[a]); break;
                case ScalarType::float64: add_column<double>(attribute, column, ranges[a]); break;
            }
            if (attribute.type != ScalarType::uint8 || attribute.components != 1) continue;
            if (attribute.name == attribute_name::kReturnNumber)
                for (const std::byte value : column) ++points_by_return[size_t(value)];
            if (attribute.name == attribute_name::kClassification)
                for (const std::byte value : column) ++points_by_class[size_t(value)];
        }
    }

    void add(const Tally& other) {
        points += other.points;
        min = min.cwiseMin(other.min);
        max = max.cwiseMax(other.max);
        for (size_t a = 0; a < ranges.size(); ++a)
            for (size_t c = 0; c < ranges[a].size(); ++c) {
                ranges[a][c].min = std::min(ranges[a][c].min, other.ranges[a][c].min);
                ranges[a][c].max = std::max(ranges[a][c].max, other.ranges[a][c].max);
            }
        for (size_t i = 0; i < 256; ++i) {
            points_by_return[i] += other.points_by_return[i];
            points_by_class[i] += other.points_by_class[i];
        }
    }
};

Tally empty_tally(const std::vector<Attribute>& attributes) {
    Tally tally;
    for (const Attribute& attribute : attributes) tally.ranges.emplace_back(size_t(attribute.components));
    return tally;
}

}  // namespace

CloudStatistics measure_cloud(const PointSource& source, int threads) {
    const CloudInfo& info = source.info();
    std::vector<int> all(info.attributes.size());
    std::iota(all.begin(), all.end(), 0);

    Tally total = empty_tally(info.attributes);
    std::mutex mutex;
    constexpr size_t kBatchesAtOnce = 16;  // share one set of columns
    parallel_blocks(threads, size_t(source.batch_count()), kBatchesAtOnce, [&](size_t begin, size_t end) {
        Tally tally = empty_tally(info.attributes);
        PointBatch batch;
        for (size_t i = begin; i < end; ++i) {
            source.read_batch(i, all, batch);
            tally.add(info, batch);
        }
        const std::lock_guard lock(mutex);
        total.add(tally);
    });

    CloudStatistics result{.points = total.points, .bounds = {}, .ranges = std::move(total.ranges),
                           .points_by_return = total.points_by_return, .points_by_class = total.points_by_class};
    if (total.points > 0) {
        result.bounds.extend(info.quantization.world_from_quanta(total.min));
        result.bounds.extend(info.quantization.world_from_quanta(total.max));
    }
    if (const int rgb = find_attribute(info.attributes, attribute_name::kRgb); rgb >= 0)
        for (const ValueRange& channel : result.ranges[size_t(rgb)])
            result.rgb_bits = std::max(result.rgb_bits, channel.empty() || channel.max == 0.0 ? 0 : channel.max > 255.0 ? 16 : 8);
    for (size_t a = 0; a < info.attributes.size(); ++a)
        for (ValueRange& range : result.ranges[a]) {
            if (range.empty()) continue;
            const double low = range.min * info.attributes[a].scale + info.attributes[a].offset;
            const double high = range.max * info.attributes[a].scale + info.attributes[a].offset;
            range = {std::min(low, high), std::max(low, high)};  // a negative scale turns them round
        }
    return result;
}

}  // namespace strata
