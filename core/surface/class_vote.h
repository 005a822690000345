#pragma once

#include <algorithm>
#include <limits>
#include <vector>

namespace strata {

/// A class that points have, and how much they weigh.
struct ClassVote {
    float value;
    double weight;
};

/// The class of most weight, the least of such; NaN: there are no votes. Sorts them. None is NaN.
inline float most_voted(std::vector<ClassVote>& votes) {
    // By weight too, so that sums do not depend on how they came.
    std::sort(votes.begin(), votes.end(), [](const ClassVote& a, const ClassVote& b) { return a.value != b.value ? a.value < b.value : a.weight < b.weight; });
    float found = std::numeric_limits<float>::quiet_NaN();
    double most = 0.0;
    for (size_t begin = 0, end; begin < votes.size(); begin = end) {
        double weight = 0.0;
        for (end = begin; end < votes.size() && votes[end].value == votes[begin].value; ++end) weight += votes[end].weight;
        if (weight > most) {
            most = weight;
            found = votes[begin].value;
        }
    }
    return found;
}

}  // namespace strata
