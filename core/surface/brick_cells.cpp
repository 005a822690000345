#include "core/surface/brick_cells.h"

#include "core/parallel.h"

namespace strata {
namespace {

// Finds corners in a sorted list, asked for in ascending order.
class Finder {
public:
    explicit Finder(const std::vector<BrickPlace>* corners) : corners_(corners) {}

    int32_t find(const BrickPlace& wanted) {
        if (corners_ == nullptr) return -1;
        while (at_ < corners_->size() && comes_before((*corners_)[at_], wanted)) ++at_;
        return at_ < corners_->size() && (*corners_)[at_][0] == wanted[0] && (*corners_)[at_][1] == wanted[1] ? int32_t(at_) : -1;
    }

private:
    const std::vector<BrickPlace>* corners_;
    size_t at_ = 0;
};

}  // namespace

void find_around(const std::vector<BrickPlace>& corners, const std::array<const std::vector<BrickPlace>*, 2>& lists, int step, int threads,
                 std::vector<AroundBrick>& found) {
    found.resize(corners.size());
    parallel_blocks(threads, 8, 1, [&](size_t begin, size_t end) {
        for (size_t n = begin; n < end; ++n) {
            Finder finder(lists[n >> 2]);
            for (size_t b = 0; b < found.size(); ++b)
                found[b][n] = finder.find(moved(corners[b], step * int32_t(n & 1), step * int32_t(n >> 1 & 1)));
        }
    });
}

}  // namespace strata
