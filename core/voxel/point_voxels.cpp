#include "core/voxel/point_voxels.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "core/voxel/code_sort.h"
#include "core/voxel/ordered_output.h"
#include "core/voxel/record_buckets.h"
#include "core/voxel/voxel_code_kernel.h"
#include "core/voxel/voxel_record.h"

namespace strata {
namespace {

constexpr size_t kRunPoints = 65536;     // that are sorted, and those of a voxel
                                         // made one, before they are stored
constexpr uint64_t kDenseVoxels = 4096;  // a bucket of so few is summed up in place

// Which attributes of the source are read: indices, -1: not asked for.
struct WantedAttributes {
    int rgb = -1;
    std::array<int, 3> normal = {-1, -1, -1};
    std::vector<int> all;

    WantedAttributes(const std::vector<Attribute>& attributes, const VoxelAttributes& voxels) {
        if (voxels.color) {
            rgb = find_attribute(attributes, attribute_name::kRgb);
            if (rgb < 0 || attributes[size_t(rgb)].type != ScalarType::uint16 || attributes[size_t(rgb)].components != 3)
                throw Error(ErrorKind::usage, "colors of voxels: the points have none");
            all.push_back(rgb);
        }
        if (!voxels.normal) return;
        for (size_t axis = 0; axis < 3; ++axis) {
            normal[axis] = find_attribute(attributes, attribute_name::kNormal[axis]);
            if (normal[axis] < 0 || attributes[size_t(normal[axis])].components != 1)
                throw Error(ErrorKind::usage, "normals of voxels: the points have none");
            all.push_back(normal[axis]);
        }
    }
};

// Memory, shared out. Beside it each thread has a batch of points and a run of
// records.
struct Budget {
    uint64_t blocks;  // bytes of all records
    uint64_t bucket;  // bytes for sorting a bucket, each thread
    uint64_t block_bytes;
    size_t buckets;

    Budget(const PointVoxelSettings& settings, uint64_t points, size_t record_size) {
        constexpr uint64_t kLeastBlock = 4096, kMostBlock = 64 * 1024, kMostBuckets = 4096, kCachedBytes = 2 << 20,
                           kLeastBucket = 256 * 1024;
        blocks = settings.memory_bytes / 2;
        bucket = std::max(settings.memory_bytes / 4 / uint64_t(std::max(settings.threads, 1)), kLeastBucket);
        // Blocks that are not full take an eighth at most.
        const uint64_t most_buckets = std::clamp<uint64_t>(settings.memory_bytes / 8 / kLeastBlock, 1, kMostBuckets);
        const uint64_t stated_bytes =
            std::min(points, std::numeric_limits<uint64_t>::max() / 64) * record_size;  // may lie: too few or too many buckets cost time
        buckets = size_t(std::clamp<uint64_t>(stated_bytes / std::min(kCachedBytes, bucket / 4), 1, most_buckets));
        block_bytes = std::clamp<uint64_t>(settings.memory_bytes / 8 / buckets, kLeastBlock, kMostBlock);
    }
};

// Codes that part what the sample holds into buckets of like size. Blocks of
// 4^3 voxels stay whole.
std::vector<uint64_t> choose_first_codes(std::vector<uint64_t>& sample, uint64_t first_code, size_t buckets) {
    std::vector<uint64_t> first_codes = {first_code};
    std::sort(sample.begin(), sample.end());
    for (size_t i = 1; i < buckets && !sample.empty(); ++i) {
        uint64_t code = sample[i * sample.size() / buckets] & ~uint64_t{63};
        if (code == first_codes.back()) code += 64;  // one block has more than its share: let it be alone
        if (code > first_codes.back()) first_codes.push_back(code);
    }
    return first_codes;
}

// Appends voxels in ascending order to a batch.
class VoxelWriter {
public:
    VoxelWriter(const VoxelAttributes& attributes, int rgb_bits, VoxelBatch& batch)
        : attributes_(attributes), rgb_bits_(rgb_bits), batch_(batch) {}

    void reserve(size_t voxels) {
        batch_.blocks.reserve(voxels / 4);
        if (attributes_.count) batch_.counts.reserve(voxels);
        if (attributes_.color) batch_.colors.reserve(voxels);
        if (attributes_.normal) batch_.normals.reserve(voxels);
    }
    template <RecordForm form>
    void add(uint64_t code, const VoxelSums& sums) {
        add_code(code);
        if constexpr (form.count) batch_.counts.push_back(saturated_count(sums.count));
        if constexpr (form.color) batch_.colors.push_back(mean_color(sums, rgb_bits_));
        if constexpr (form.normal) batch_.normals.push_back(mean_normal(sums));
    }
    void add_code(uint64_t code) {
        if (batch_.blocks.empty() || batch_.blocks.back().code != code >> 6) batch_.blocks.push_back({code >> 6, 0, 0});
        batch_.blocks.back().mask |= uint64_t{1} << (code & 63);
    }

private:
    VoxelAttributes attributes_;
    int rgb_bits_;
    VoxelBatch& batch_;
};

uint64_t count_voxels(const VoxelBatch& batch) {
    uint64_t voxels = 0;
    for (const VoxelBlock& block : batch.blocks) voxels += uint64_t(std::popcount(block.mask));
    return voxels;
}

// Makes records of those that sorted words stand for; those of one voxel become
// one or two. record_at  of the index in a word
template <RecordForm form, typename RecordAt>
void merge_records(std::span<const uint64_t> words, uint64_t index_mask, const RecordAt& record_at, std::vector<VoxelRecord<form>>& out) {
    out.clear();
    if (words.empty()) return;
    out.reserve(words.size());
    VoxelRecord<form> first = record_at(size_t(words[0] & index_mask));
    VoxelSums sums;
    bool several = false;
    const auto put = [&] {
        if (several) append_records<form>(first.code(), sums, out);
        else out.push_back(first);
        several = false;
    };
    for (const uint64_t word : words.subspan(1)) {
        const VoxelRecord<form> record = record_at(size_t(word & index_mask));
        if (record.code() != first.code()) {
            put();
            first = record;
            continue;
        }
        if (!several) {
            sums = {};
            sums.add(first);
            several = true;
        }
        sums.add(record);
    }
    put();
}

// The first pass, one thread's part.
template <RecordForm form>
class RunMaker {
public:
    RunMaker(const std::vector<Attribute>& attributes, const WantedAttributes& wanted, const VoxelFromQuanta& map, RecordBuckets& buckets)
        : attributes_(attributes), wanted_(wanted), map_(map), buckets_(buckets) {}

    void add(const PointBatch& batch) {
        for (size_t begin = 0; begin < batch.size; begin += kRunPoints) add_run(batch, begin, std::min(kRunPoints, batch.size - begin));
    }

    uint64_t points = 0, outside = 0;
    uint32_t rgb_union = 0;  // a bit is set where a channel of any point has it

private:
    void add_run(const PointBatch& batch, size_t begin, size_t size) {
        if constexpr (form.color)
            for (const uint16_t channel : batch.column<uint16_t>(size_t(wanted_.rgb)).subspan(3 * begin, 3 * size)) rgb_union |= channel;
        codes_.resize(size);
        find_voxel_codes(map_, batch.x.data() + begin, batch.y.data() + begin, batch.z.data() + begin, codes_);
        points += size;
        const size_t inside = size_t(std::count_if(codes_.begin(), codes_.end(), [](uint64_t code) { return code != kNoVoxel; }));
        outside += size - inside;
        if (inside == 0) return;
        const bool all = inside == size;
        if (!all) drop_outside();
        std::copy_n(codes_.data(), inside, sort_.codes(inside).data());
        if constexpr (!form.has_sums()) {
            const auto record_of = [](size_t code) {
                VoxelRecord<form> record;
                record.set_key(code, 0);
                return record;
            };
            merge_records<form>(sort_.sort(), ~uint64_t{0}, record_of, records_);
        } else {
            if constexpr (form.normal) find_normals(batch, begin, size);
            const auto record_at = [&](size_t i) { return point_record(batch, begin, codes_[i], all ? i : rows_[i]); };
            const std::span<const uint64_t> words = sort_.order([&](size_t i) { return codes_[i]; });
            merge_records<form>(words, sort_.index_mask(), record_at, records_);
        }
        buckets_.add(std::as_bytes(std::span(records_)));
    }

    void drop_outside() {
        rows_.resize(codes_.size());
        size_t inside = 0;
        for (size_t i = 0; i < codes_.size(); ++i) {
            const uint64_t code = codes_[i];
            codes_[inside] = code;
            rows_[inside] = uint32_t(i);
            inside += code != kNoVoxel;
        }
    }

    VoxelRecord<form> point_record(const PointBatch& batch, size_t begin, uint64_t code, size_t row) const {
        using Record = VoxelRecord<form>;
        Record record;
        record.set_key(code, kPacked);
        if constexpr (form.color) {
            const uint16_t* const rgb = batch.column<uint16_t>(size_t(wanted_.rgb)).data() + 3 * (begin + row);
            record.words[Record::kColor] = uint64_t{rgb[0]} << 4 | uint64_t{rgb[1]} << 24 | uint64_t{rgb[2]} << 44;
        }
        if constexpr (form.normal) {
            record.words[Record::kNormal] = 0;
            for (size_t i = 0; i < 3; ++i)
                record.words[Record::kNormal] |= (uint64_t(int64_t{normals_[3 * row + i]}) & kPackedBits) << (4 + 20 * i);
        }
        return record;
    }

    // Directions in steps of 1/32767.
    void find_normals(const PointBatch& batch, size_t begin, size_t size) {
        normals_.resize(3 * size);
        std::array<const std::byte*, 3> column;
        std::array<Attribute, 3> attribute;
        for (size_t axis = 0; axis < 3; ++axis) {
            attribute[axis] = attributes_[size_t(wanted_.normal[axis])];
            column[axis] = batch.columns[size_t(wanted_.normal[axis])].data() + begin * attribute[axis].size_bytes();
        }
        for (size_t i = 0; i < size; ++i) {
            std::array<double, 3> n;
            for (size_t axis = 0; axis < 3; ++axis) {
                const Attribute& a = attribute[axis];
                n[axis] = load_scalar(a.type, column[axis] + i * a.size_bytes()) * a.scale + a.offset;
            }
            const double largest = std::max({std::abs(n[0]), std::abs(n[1]), std::abs(n[2])});
            // By the largest first, so that no square is beyond a double.
            double square = 0.0;
            for (double& component : n) {
                component /= largest;
                square += component * component;
            }
            const bool known = std::isfinite(square);  // none where all are 0, or one is infinite or NaN
            for (size_t axis = 0; axis < 3; ++axis)
                normals_[3 * i + axis] =
                    known ? int16_t(std::clamp(std::round(32767.0 * (n[axis] / std::sqrt(square))), -32767.0, 32767.0)) : int16_t{0};
        }
    }

    const std::vector<Attribute>& attributes_;
    const WantedAttributes& wanted_;
    const VoxelFromQuanta& map_;
    RecordBuckets& buckets_;
    CodeSort sort_;
    std::vector<uint64_t> codes_;
    std::vector<uint32_t> rows_;
    std::vector<int16_t> normals_;
    std::vector<VoxelRecord<form>> records_;
};

// The second pass, one thread's part: buckets to voxels in ascending order.
template <RecordForm form>
class BucketReader {
public:
    using Record = VoxelRecord<form>;

    BucketReader(const VoxelAttributes& attributes, int rgb_bits, uint64_t bucket_bytes, BlockPool& pool, ScratchBlocks& scratch)
        : attributes_(attributes), rgb_bits_(rgb_bits), bucket_bytes_(bucket_bytes), pool_(pool), scratch_(scratch) {}

    bool fits(uint64_t records) const { return records <= bucket_bytes_ / (CodeSort::kBytesPerCode + 2 * sizeof(Record)); }

    // A bucket that fits.
    void read(RecordBuckets& buckets, size_t bucket, VoxelBatch& batch) {
        const size_t n = size_t(buckets.records(bucket)), block_records = buckets.block_records();
        const std::vector<const std::byte*> blocks = buckets.load(bucket, loaded_);
        const int shift = std::countr_zero(block_records);
        const auto record_at = [&](size_t i) {
            Record record;
            std::memcpy(&record, blocks[i >> shift] + (i & (block_records - 1)) * sizeof(Record), sizeof record);
            return record;
        };
        uint64_t* codes = sort_.codes(n).data();
        for (size_t begin = 0, block = 0; begin < n; begin += block_records, ++block) {
            const std::byte* from = blocks[block];
            for (size_t i = 0; i < std::min(block_records, n - begin); ++i, from += sizeof(Record)) {
                uint64_t key;
                std::memcpy(&key, from, sizeof key);
                *codes++ = form.has_sums() ? code_of_key(key) : key;
            }
        }
        VoxelWriter writer(attributes_, rgb_bits_, batch);
        writer.reserve(n);
        VoxelSums sums;
        uint64_t voxel = kNoVoxel;
        const auto add = [&](const Record& record) {
            if (record.code() != voxel) {
                if (voxel != kNoVoxel) writer.add<form>(voxel, sums);
                voxel = record.code();
                sums = {};
            }
            sums.add(record);
        };
        if constexpr (form.has_sums())
            for (const uint64_t word : sort_.order([&](size_t i) { return record_at(i).code(); }))
                add(record_at(size_t(word & sort_.index_mask())));
        else
            for (const uint64_t key : sort_.sort()) add(Record{{key}});
        if (voxel != kNoVoxel) writer.add<form>(voxel, sums);
        buckets.release(bucket);
    }

    // A bucket of any size; put is called with batches in ascending order.
    // end_code  past its codes
    template <typename Put>
    void read_parts(RecordBuckets& buckets, size_t bucket, uint64_t end_code, const Put& put) {
        const uint64_t first_code = buckets.first_code(bucket);
        VoxelBatch batch;
        if (fits(buckets.records(bucket))) {
            read(buckets, bucket, batch);
            return put(batch);
        }
        if (end_code - first_code <= kDenseVoxels) {
            sum_up(buckets, bucket, end_code, batch);
            return put(batch);
        }
        RecordBuckets parts(part_codes(buckets, bucket, end_code), sizeof(Record), pool_, scratch_);
        move_records(buckets, bucket, parts);
        for (size_t part = 0; part < parts.size(); ++part)
            read_parts(parts, part, part + 1 < parts.size() ? parts.first_code(part + 1) : end_code, put);
    }

private:
    // Those of one voxel that come together become one on the way.
    void move_records(RecordBuckets& buckets, size_t bucket, RecordBuckets& parts) {
        std::vector<Record> records;
        const auto add = [&] {
            uint64_t* codes = sort_.codes(records.size()).data();
            for (const Record& record : records) *codes++ = record.code();
            const std::span<const uint64_t> words = sort_.order([&](size_t i) { return records[i].code(); });
            merge_records<form>(
                words, sort_.index_mask(), [&](size_t i) { return records[i]; }, merged_);
            parts.add(std::as_bytes(std::span(merged_)));
            records.clear();
        };
        const size_t most =
            std::max<size_t>(std::min<size_t>(kRunPoints, bucket_bytes_ / 4 / (CodeSort::kBytesPerCode + 2 * sizeof(Record))), 1);
        buckets.take(bucket, [&](std::span<const std::byte> block) {
            const size_t count = block.size() / sizeof(Record), before = records.size();
            records.resize(before + count);
            std::memcpy(records.data() + before, block.data(), block.size());
            if (records.size() >= most) add();
        });
        if (!records.empty()) add();
    }

    void sum_up(RecordBuckets& buckets, size_t bucket, uint64_t end_code, VoxelBatch& batch) {
        const uint64_t first_code = buckets.first_code(bucket);
        std::vector<VoxelSums> sums(size_t(end_code - first_code));
        buckets.take(bucket, [&](std::span<const std::byte> block) {
            for (size_t at = 0; at < block.size(); at += sizeof(Record)) {
                Record record;
                std::memcpy(&record, block.data() + at, sizeof record);
                sums[size_t(record.code() - first_code)].add(record);
            }
        });
        VoxelWriter writer(attributes_, rgb_bits_, batch);
        for (size_t i = 0; i < sums.size(); ++i)
            if (sums[i].count > 0) writer.add<form>(first_code + i, sums[i]);
    }

    // Parts of like size by what some blocks hold, and by the range itself, so
    // that parts of parts come to an end.
    std::vector<uint64_t> part_codes(const RecordBuckets& buckets, size_t bucket, uint64_t end_code) const {
        constexpr size_t kSampledBlocks = 64, kMostParts = 64, kParts = 8;
        const uint64_t first_code = buckets.first_code(bucket), bytes = buckets.records(bucket) * sizeof(Record);
        std::vector<uint64_t> sample;
        buckets.visit_some(bucket, kSampledBlocks, [&](std::span<const std::byte> block) {
            for (size_t at = 0; at < block.size(); at += 16 * sizeof(Record)) {
                uint64_t key;
                std::memcpy(&key, block.data() + at, sizeof key);
                sample.push_back(code_of_key(key));
            }
        });
        std::vector<uint64_t> codes =
            choose_first_codes(sample, first_code, size_t(std::clamp<uint64_t>(8 * bytes / bucket_bytes_, 2, kMostParts)));
        const uint64_t width = ((end_code - first_code) / kParts + 63) & ~uint64_t{63};
        for (uint64_t code = first_code + width; code < end_code; code += width) codes.push_back(code);
        std::sort(codes.begin(), codes.end());
        codes.erase(std::unique(codes.begin(), codes.end()), codes.end());
        while (codes.back() >= end_code) codes.pop_back();
        return codes;
    }

    VoxelAttributes attributes_;
    int rgb_bits_;
    uint64_t bucket_bytes_;
    BlockPool& pool_;
    ScratchBlocks& scratch_;
    CodeSort sort_;
    std::vector<std::byte> loaded_;
    std::vector<Record> merged_;
};

template <RecordForm form>
class PointVoxelizer {
public:
    PointVoxelizer(const PointSource& source, const VoxelFrame& frame, const PointVoxelSettings& settings, const VoxelSink& sink)
        : source_(source),
          frame_(frame),
          settings_(settings),
          sink_(sink),
          threads_(std::max(settings.threads, 1)),
          wanted_(source.info().attributes, settings.attributes),
          map_(frame, source.info().quantization),
          budget_(settings, source.info().points, sizeof(VoxelRecord<form>)),
          pool_(budget_.block_bytes, budget_.blocks),
          scratch_(settings.scratch) {}

    PointVoxelReport run() {
        std::vector<uint64_t> sample = budget_.buckets > 1 ? sample_codes() : std::vector<uint64_t>();
        RecordBuckets buckets(choose_first_codes(sample, 0, budget_.buckets), sizeof(VoxelRecord<form>), pool_, scratch_);
        sample = {};
        distribute(buckets);
        put_out(buckets);
        report_.scratch_bytes = scratch_.written_bytes();
        return report_;
    }

private:
    // The codes of some points of many batches.
    std::vector<uint64_t> sample_codes() const {
        constexpr uint64_t kMostBatches = 1024, kSampledPoints = 131072;
        const uint64_t batches = source_.batch_count(), count = std::min(batches, kMostBatches);
        std::vector<std::vector<uint64_t>> of_batches(count);
        parallel_blocks(threads_, size_t(count), 1, [&](size_t begin, size_t end) {
            PointBatch batch;
            for (size_t i = begin; i < end; ++i) {
                source_.read_first(i * batches / count, kSampledPoints / count, {}, batch);
                of_batches[i].resize(batch.size);
                find_voxel_codes(map_, batch.x.data(), batch.y.data(), batch.z.data(), of_batches[i]);
            }
        });
        std::vector<uint64_t> codes;
        for (const std::vector<uint64_t>& of_batch : of_batches)
            std::copy_if(of_batch.begin(), of_batch.end(), std::back_inserter(codes), [](uint64_t code) { return code != kNoVoxel; });
        return codes;
    }

    void distribute(RecordBuckets& buckets) {
        std::atomic<uint64_t> next = 0, points = 0, outside = 0;
        std::atomic<uint32_t> rgb_union = 0;
        std::atomic<bool> failed = false;
        parallel_workers(threads_, [&](int) {
            try {
                PointBatch batch;
                RunMaker<form> maker(source_.info().attributes, wanted_, map_, buckets);
                for (uint64_t index; !failed && (index = next++) < source_.batch_count();) {
                    source_.read_batch(index, wanted_.all, batch);
                    maker.add(batch);
                    if (settings_.on_points) settings_.on_points(batch.size);
                }
                points += maker.points;
                outside += maker.outside;
                rgb_union |= maker.rgb_union;
            } catch (...) {
                failed = true;
                throw;
            }
        });
        report_.points = points;
        report_.outside = outside;
        rgb_bits_ = rgb_union > 255 ? 16 : 8;
    }

    void put_out(RecordBuckets& buckets) {
        OrderedOutput output(sink_, 2 * uint64_t(threads_) + 2);
        std::atomic<uint64_t> next = 0, voxels = 0;
        parallel_workers(threads_, [&](int) {
            try {
                BucketReader<form> reader(settings_.attributes, rgb_bits_, budget_.bucket, pool_, scratch_);
                for (uint64_t index; (index = next++) < buckets.size() && output.begin(index);) {
                    if (reader.fits(buckets.records(size_t(index)))) {
                        VoxelBatch batch = output.batch();
                        reader.read(buckets, size_t(index), batch);
                        voxels += count_voxels(batch);
                        output.deliver(index, std::move(batch));
                        continue;
                    }
                    const uint64_t end_code =
                        index + 1 < buckets.size() ? buckets.first_code(size_t(index) + 1) : uint64_t{1} << 6 * frame_.levels;
                    bool turn = false, failed = false;
                    const auto wait = [&] {
                        if (!turn && !failed) (output.wait_for_turn(index) ? turn : failed) = true;
                        return turn;
                    };
                    reader.read_parts(buckets, size_t(index), end_code, [&](const VoxelBatch& batch) {
                        if (!wait()) return;
                        voxels += count_voxels(batch);
                        output.put(batch);
                    });
                    if (!wait()) return;
                    output.end_turn();
                }
            } catch (...) {
                output.fail();
                throw;
            }
        });
        report_.voxels = voxels;
    }

    const PointSource& source_;
    const VoxelFrame& frame_;
    const PointVoxelSettings& settings_;
    const VoxelSink& sink_;
    int threads_;
    WantedAttributes wanted_;
    VoxelFromQuanta map_;
    Budget budget_;
    BlockPool pool_;
    ScratchBlocks scratch_;
    int rgb_bits_ = 8;
    PointVoxelReport report_;
};

}  // namespace

PointVoxelReport voxelize_points(const PointSource& source, const VoxelFrame& frame, const PointVoxelSettings& settings,
                                 const VoxelSink& sink) {
    const auto run = [&]<RecordForm form>() { return PointVoxelizer<form>(source, frame, settings, sink).run(); };
    const VoxelAttributes& wanted = settings.attributes;
    switch ((wanted.count ? 1 : 0) | (wanted.color ? 2 : 0) | (wanted.normal ? 4 : 0)) {
        case 0: return run.operator()<RecordForm{}>();
        case 1: return run.operator()<RecordForm{.count = true}>();
        case 2: return run.operator()<RecordForm{.color = true}>();
        case 3: return run.operator()<RecordForm{.count = true, .color = true}>();
        case 4: return run.operator()<RecordForm{.normal = true}>();
        case 5: return run.operator()<RecordForm{.count = true, .normal = true}>();
        case 6: return run.operator()<RecordForm{.color = true, .normal = true}>();
        default: return run.operator()<RecordForm{.count = true, .color = true, .normal = true}>();
    }
}

}  // namespace strata
