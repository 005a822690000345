#pragma once

#include <algorithm>
#include <array>
#include <utility>

namespace strata {

/// Which of a few things belong together: each group is known by its least member.
template <int kSize>
class Joined {
public:
    Joined() {
        for (int i = 0; i < kSize; ++i) parent_[size_t(i)] = i;
    }
    int find(int i) const {
        while (parent_[size_t(i)] != i) i = parent_[size_t(i)];
        return i;
    }
    void join(int a, int b) {
        a = find(a);
        b = find(b);
        if (a != b) parent_[size_t(std::max(a, b))] = std::min(a, b);
    }

private:
    std::array<int, kSize> parent_;
};

}  // namespace strata
