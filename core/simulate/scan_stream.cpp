#include "core/simulate/scan_stream.h"

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <vector>

#include "core/parallel.h"

namespace strata {
namespace {

// Hands out blocks in order and takes them back in any order; whoever brings the next one passes on all that are ready.
class OrderedScan {
public:
    OrderedScan(const VillageScene& scene, const Survey& survey, int threads, const std::function<void(std::span<const ScanPoint>)>& sink)
        : scene_(scene), survey_(survey), most_pending_(size_t(threads) * 2), sink_(sink) {}

    void work() {
        BeamScanner scanner(scene_);
        try {
            std::vector<ScanPoint> points;
            for (Ticket ticket; take(ticket, points);) {
                survey_.scan_block(scanner, ticket.part, ticket.block, points);
                bring(ticket, std::move(points), scanner);
            }
        } catch (...) {
            const std::lock_guard lock(mutex_);
            failed_ = true;
            room_.notify_all();
            throw;
        }
    }

private:
    struct Ticket {
        uint64_t number = 0;
        size_t part = 0;
        uint64_t block = 0;
    };
    struct Pending {
        Ticket ticket;
        std::vector<ScanPoint> points;
    };

    // `points` gets an emptied block to fill, because fresh memory for each would cost as much as a tenth of the scan.
    bool take(Ticket& ticket, std::vector<ScanPoint>& points) {
        std::unique_lock lock(mutex_);
        // The block that all wait for was handed out already, so its bearer never waits here.
        room_.wait(lock, [&] { return failed_ || pending_.size() < most_pending_; });
        while (next_.part < survey_.parts().size() && next_.block == survey_.parts()[next_.part].planned_blocks) next_ = {next_.number, next_.part + 1, 0};
        if (failed_ || next_.part == survey_.parts().size()) return false;
        if (!spare_.empty()) {
            points = std::move(spare_.back());
            spare_.pop_back();
        }
        ticket = next_;
        ++next_.number;
        ++next_.block;
        return true;
    }

    void bring(const Ticket& ticket, std::vector<ScanPoint> points, BeamScanner& scanner) {
        const std::lock_guard lock(mutex_);
        pending_.emplace(ticket.number, Pending{ticket, std::move(points)});
        while (!pending_.empty() && pending_.begin()->first == next_to_pass_ && !failed_) {
            Pending ready = std::move(pending_.begin()->second);
            pending_.erase(pending_.begin());
            ++next_to_pass_;
            pass(ready.ticket.part, ready.points);
            // The plan fell short: the part goes on until it has its points, before the next part follows.
            uint64_t block = ready.ticket.block + 1;
            if (block == survey_.parts()[ready.ticket.part].planned_blocks)
                for (std::vector<ScanPoint> more; passed_ < survey_.parts()[ready.ticket.part].quota; ++block) {
                    survey_.scan_block(scanner, ready.ticket.part, block, more);
                    pass(ready.ticket.part, more);
                }
            spare_.push_back(std::move(ready.points));
        }
        room_.notify_all();
    }

    void pass(size_t part, std::span<const ScanPoint> points) {
        if (part != part_) {
            part_ = part;
            passed_ = 0;
        }
        const size_t count = size_t(std::min<uint64_t>(points.size(), survey_.parts()[part].quota - passed_));
        if (count > 0) sink_(points.first(count));
        passed_ += count;
    }

    const VillageScene& scene_;
    const Survey& survey_;
    const size_t most_pending_;
    const std::function<void(std::span<const ScanPoint>)>& sink_;
    std::mutex mutex_;
    std::condition_variable room_;
    bool failed_ = false;
    Ticket next_;
    uint64_t next_to_pass_ = 0;
    std::map<uint64_t, Pending> pending_;
    std::vector<std::vector<ScanPoint>> spare_;
    size_t part_ = 0;      // whose points pass now
    uint64_t passed_ = 0;  // of that part
};

}  // namespace

void stream_scan(const VillageScene& scene, const Survey& survey, int threads, const std::function<void(std::span<const ScanPoint>)>& sink) {
    OrderedScan scan(scene, survey, threads, sink);
    parallel_workers(threads, [&](int) { scan.work(); });
}

}  // namespace strata
