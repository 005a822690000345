#include "core/surface/near_points.h"

#include <algorithm>

#include "core/surface/brick_layers.h"

namespace strata {

void NearPoints::gather(const std::array<const PointLayer*, 3>& from, const std::array<int32_t, 2>& corner, float reach, bool skip) {
    x.clear(), y.clear(), z.clear(), normals.clear(), layers.clear(), points.clear();
    const float low = -reach, high = float(kFieldBrickSide) + reach;
    for (size_t l = 0; l < 3; ++l) {
        if (from[l] == nullptr || from[l]->corners.empty()) continue;
        const PointLayer& layer = *from[l];
        for (int32_t dj = -kFieldBrickSide; dj <= kFieldBrickSide; dj += kFieldBrickSide) {
            size_t brick = size_t(std::lower_bound(layer.corners.begin(), layer.corners.end(), BrickPlace{corner[0] - kFieldBrickSide, corner[1] + dj}, comes_before) -
                                  layer.corners.begin());
            for (; brick < layer.corners.size() && layer.corners[brick][1] == corner[1] + dj && layer.corners[brick][0] <= corner[0] + kFieldBrickSide; ++brick) {
                const Vec3f shift(float(layer.corners[brick][0] - corner[0]), float(dj), float(kFieldBrickSide) * (float(l) - 1.0f));
                for (uint32_t p = layer.begins[brick]; p < layer.begins[brick + 1]; ++p) {
                    const Vec3f place = layer.places[p] + shift;
                    if (!(place.minCoeff() > low && place.maxCoeff() < high)) continue;
                    if (skip && layer.normals[p].isZero(0.0f)) continue;
                    x.push_back(place.x());
                    y.push_back(place.y());
                    z.push_back(place.z());
                    if (!layer.normals.empty()) normals.push_back(layer.normals[p]);
                    layers.push_back(uint8_t(l));
                    points.push_back(p);
                }
            }
        }
    }
}

std::vector<std::array<int32_t, 2>> corners_around(const std::array<const PointLayer*, 3>& layers) {
    std::vector<std::array<int32_t, 2>> all;
    for (const PointLayer* layer : layers) {
        if (layer == nullptr) continue;
        for (const std::array<int32_t, 2>& corner : layer->corners)
            for (int32_t dj = -kFieldBrickSide; dj <= kFieldBrickSide; dj += kFieldBrickSide)
                for (int32_t di = -kFieldBrickSide; di <= kFieldBrickSide; di += kFieldBrickSide) all.push_back({corner[0] + di, corner[1] + dj});
    }
    std::sort(all.begin(), all.end(), comes_before);
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
}

}  // namespace strata
