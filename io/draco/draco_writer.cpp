#include "io/draco/draco_writer.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <mutex>
#include <numeric>
#include <string_view>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "io/draco/draco_block.h"
#include "io/draco/draco_header.h"
#include "io/draco/draco_source.h"
#include "io/output_folder.h"

namespace strata {
namespace {

constexpr uint64_t kBlockPoints = DracoSource::kWholeBatchPoints;  // read back as one batch
constexpr uint64_t kBaseBytes = 64 << 20, kBatchBytes = 16 << 20;  // the program; a batch of a source

std::vector<int> all_attributes(const CloudInfo& info) {
    std::vector<int> all(info.attributes.size());
    std::iota(all.begin(), all.end(), 0);
    return all;
}

void append(const PointBatch& batch, PointBatch& points) {
    const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    points.columns.resize(batch.columns.size());
    points.size += batch.size;
    join(points.x, batch.x);
    join(points.y, batch.y);
    join(points.z, batch.z);
    for (size_t i = 0; i < batch.columns.size(); ++i) join(points.columns[i], batch.columns[i]);
}

// Takes the first points off.
PointBatch take_first(PointBatch& points, size_t count) {
    PointBatch first;
    const auto split = [&](auto& from, auto& to, size_t width) {
        const auto end = from.begin() + ptrdiff_t(count * width);
        to.assign(from.begin(), end);
        from.erase(from.begin(), end);
    };
    first.columns.resize(points.columns.size());
    for (size_t i = 0; i < points.columns.size(); ++i) split(points.columns[i], first.columns[i], points.columns[i].size() / points.size);
    split(points.x, first.x, 1);
    split(points.y, first.y, 1);
    split(points.z, first.z, 1);
    first.size = count;
    points.size -= count;
    return first;
}

// What the blocks add up to, from any thread.
class Sum {
public:
    Sum(const DracoWriteSettings& settings, uint64_t total) : settings_(settings), total_(total) { report_.exact = true; }

    void add(uint64_t points, const drc::EncodedBlock& block) {
        const std::lock_guard lock(mutex_);
        report_.points += points;
        ++report_.blocks;
        report_.output_bytes += block.bytes.size();
        report_.worst_error = std::max(report_.worst_error, block.worst_error);
        report_.exact = report_.exact && block.exact;
        if (settings_.on_progress) settings_.on_progress(report_.points, total_);
    }
    const DracoWriteReport& report() const { return report_; }

private:
    const DracoWriteSettings& settings_;
    uint64_t total_;
    std::mutex mutex_;
    DracoWriteReport report_;
};

void check_not_empty(const std::string& path, uint64_t points) {
    if (points == 0) throw Error(ErrorKind::unsupported, path + ": no points to write; a Draco file holds one at least");
}

drc::EncodedBlock encode_for(const std::string& path, const PointBatch& points, const CloudInfo& info, const drc::BlockFrame& frame) try {
    return drc::encode_block(points, info, frame);
} catch (const Error& error) {
    throw error.within(path);
}

class FileWriter : public DracoWriter {
public:
    FileWriter(const std::string& path, const DracoWriteSettings& settings) : settings_(settings), file_(path, settings.overwrite) {}

    DracoWriteReport write(const PointSource& source) override {
        const CloudInfo& info = source.info();
        check_not_empty(file_.path(), info.points);
        check_memory(info);
        const drc::BlockFrame frame = drc::block_frame(source, settings_.max_error, settings_.threads);
        const std::vector<int> wanted = all_attributes(info);
        PointBatch points, batch;
        for (uint64_t i = 0; i < source.batch_count(); ++i) {
            source.read_batch(i, wanted, batch);
            append(batch, points);
        }
        check_not_empty(file_.path(), points.size);
        const drc::EncodedBlock block = encode_for(file_.path(), points, info, frame);
        file_.write(block.bytes);
        file_.commit(settings_.durability);
        Sum sum(settings_, info.points);
        sum.add(points.size, block);
        return sum.report();
    }

private:
    void check_memory(const CloudInfo& info) const {
        const uint64_t needed = kBaseBytes + drc::encoding_bytes(info.points, info.attributes);
        const uint64_t most = std::min(settings_.memory_bytes, drc::allowed_bytes(UINT64_MAX));
        if (needed > most)
            throw Error(ErrorKind::limit, file_.path() + ": one Draco file of " + std::to_string(info.points) + " points needs up to " + std::to_string(needed >> 20) +
                                              " MiB of memory, " + std::to_string(most >> 20) + " MiB are allowed; a folder of blocks (an output without .drc, --format drc) needs little");
    }

    DracoWriteSettings settings_;
    OutputFile file_;
};

// By their names in the order of the points.
std::string name_of(uint64_t block) {
    char name[32];
    std::snprintf(name, sizeof name, "%06llu.drc", static_cast<unsigned long long>(block));
    return name;
}

bool is_block_name(std::string_view name) {
    uint64_t block = 0;
    return std::from_chars(name.data(), name.data() + name.size(), block).ec == std::errc() && name == name_of(block);
}

class FolderWriter : public DracoWriter {
public:
    FolderWriter(const std::string& path, const DracoWriteSettings& settings)
        : settings_(settings), folder_(path, {.always = {name_of(0)}, .is_part = is_block_name}, settings.overwrite) {}

    DracoWriteReport write(const PointSource& source) override {
        const CloudInfo& info = source.info();
        check_not_empty(folder_.path(), info.points);
        const int threads = affordable_threads(info);
        const drc::BlockFrame frame = drc::block_frame(source, settings_.max_error, threads);
        Sum sum(settings_, info.points);
        // Blocks are made of so many batches each, by their mean size: what they hold follows from the source alone.
        const uint64_t batches = source.batch_count(), each = std::max<uint64_t>(1, batches * kBlockPoints / std::max<uint64_t>(info.points, 1));
        const uint64_t groups = (batches + each - 1) / each;
        std::vector<uint64_t> parts(groups, 0);  // blocks of each
        std::atomic<uint64_t> next = 0;
        std::atomic<bool> failed = false;
        parallel_workers(threads, [&](int) {
            try {
                for (uint64_t group; !failed && (group = next++) < groups;)
                    parts[group] = write_group(source, group, group * each, std::min(batches, (group + 1) * each), frame, sum);
            } catch (...) {
                failed = true;
                throw;
            }
        });
        check_not_empty(folder_.path(), sum.report().points);
        number_blocks(parts);
        folder_.commit(settings_.durability);
        return sum.report();
    }

private:
    // Until it is known how many come before it.
    static std::string name_within(uint64_t group, uint64_t part) { return std::to_string(group) + "-" + std::to_string(part); }

    void number_blocks(const std::vector<uint64_t>& parts) const {
        uint64_t block = 0;
        for (uint64_t group = 0; group < parts.size(); ++group)
            for (uint64_t part = 0; part < parts[group]; ++part)
                rename_output(folder_.path_of(name_within(group, part)), folder_.path_of(name_of(block++)), false);
    }

    int affordable_threads(const CloudInfo& info) const {
        uint64_t record = 12;
        for (const Attribute& attribute : info.attributes) record += attribute.size_bytes();
        // What is gathered, up to twice as it grows, with a batch behind it; the block cut off it, and its encoding.
        const uint64_t each = 3 * (kBlockPoints * record + kBatchBytes) + drc::encoding_bytes(kBlockPoints, info.attributes);
        if (kBaseBytes + each > settings_.memory_bytes)
            throw Error(ErrorKind::limit, folder_.path() + ": a block needs up to " + std::to_string((kBaseBytes + each) >> 20) + " MiB of memory, " +
                                              std::to_string(settings_.memory_bytes >> 20) + " MiB are allowed");
        return int(std::clamp<uint64_t>((settings_.memory_bytes - kBaseBytes) / each, 1, uint64_t(std::max(1, settings_.threads))));
    }

    // returns  how many blocks it is
    uint64_t write_group(const PointSource& source, uint64_t group, uint64_t begin, uint64_t end, const drc::BlockFrame& frame, Sum& sum) const {
        const std::vector<int> wanted = all_attributes(source.info());
        PointBatch points, batch;
        uint64_t part = 0;
        const auto write_block = [&](const PointBatch& block) {
            const drc::EncodedBlock encoded = encode_for(folder_.path(), block, source.info(), frame);
            OutputFile file(folder_.path_of(name_within(group, part++)), false);
            file.write(encoded.bytes);
            file.commit(settings_.durability);
            sum.add(block.size, encoded);
        };
        for (uint64_t i = begin; i < end; ++i) {
            source.read_batch(i, wanted, batch);
            append(batch, points);
            while (points.size >= kBlockPoints) write_block(points.size == kBlockPoints ? std::exchange(points, {}) : take_first(points, kBlockPoints));
        }
        if (points.size > 0) write_block(points);
        return part;
    }

    DracoWriteSettings settings_;
    OutputFolder folder_;
};

bool is_file_name(const std::string& path) {
    std::string ending = path.size() < 4 ? "" : path.substr(path.size() - 4);
    std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return ending == ".drc";
}

}  // namespace

std::unique_ptr<DracoWriter> make_draco_writer(const std::string& path, const DracoWriteSettings& settings) {
    if (is_file_name(path)) return std::make_unique<FileWriter>(path, settings);
    return std::make_unique<FolderWriter>(path, settings);
}

}  // namespace strata
