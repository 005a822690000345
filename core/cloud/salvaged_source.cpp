#include "core/cloud/salvaged_source.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <numeric>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kMostNotes = 10;  // the rest is counted

// What is wrong with the batches that cannot be read: the texts that come first, each once.
class Faults {
public:
    void add(uint64_t index, const std::string& text) {
        const std::lock_guard lock(mutex_);
        const auto [fault, is_new] = first_.try_emplace(text, index);
        fault->second = std::min(fault->second, index);
        // The latest one goes; should it come earlier, it is back. So the order of the threads does not show.
        if (first_.size() > kMostNotes) first_.erase(std::max_element(first_.begin(), first_.end(), [](const auto& a, const auto& b) { return a.second < b.second; }));
    }
    std::vector<std::string> texts() const {
        std::vector<std::pair<uint64_t, std::string>> sorted;
        for (const auto& [text, index] : first_) sorted.emplace_back(index, text);
        std::sort(sorted.begin(), sorted.end());
        std::vector<std::string> texts;
        for (auto& fault : sorted) texts.push_back(std::move(fault.second));
        return texts;
    }

private:
    std::mutex mutex_;
    std::map<std::string, uint64_t> first_;  // text to the least index of a batch that has it
};

}  // namespace

SalvagedSource::SalvagedSource(std::unique_ptr<PointSource> source, uint64_t stated_points, int threads)
    : source_(std::move(source)), stated_points_(stated_points), info_(source_->info()) {
    const size_t batches = size_t(source_->batch_count());
    std::vector<uint8_t> is_sound(batches, 0);
    std::atomic<uint64_t> points = 0;
    Faults faults;
    std::vector<int> all(info_.attributes.size());
    std::iota(all.begin(), all.end(), 0);
    parallel_blocks(threads, batches, 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t index = begin; index < end; ++index) {
            try {
                source_->read_batch(index, all, batch);
                points += batch.size;
                is_sound[index] = 1;
            } catch (const Error& error) {
                if (error.kind != ErrorKind::malformed && error.kind != ErrorKind::io) throw;
                faults.add(index, error.what());
            }
        }
    });
    info_.points = points;
    for (size_t index = 0; index < batches; ++index)
        if (is_sound[index]) sound_.push_back(index);
    const std::vector<std::string> texts = faults.texts();
    if (sound_.empty() && !texts.empty()) throw Error(ErrorKind::malformed, texts.front() + "; nothing else can be read, either");
    for (const std::string& text : texts) info_.notes.push_back("left out: " + text);
    if (const size_t damaged = batches - sound_.size(); damaged > texts.size())
        info_.notes.push_back(std::to_string(damaged) + " parts are left out in all");
}

}  // namespace strata
