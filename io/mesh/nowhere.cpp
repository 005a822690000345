#include "io/mesh/nowhere.h"

#include <algorithm>

namespace strata {
namespace {

template <typename T>
void remove_at(std::vector<T>& array, std::span<const uint32_t> indices) {
    if (array.empty()) return;
    size_t to = indices.front();
    for (size_t from = to, next = 0; from < array.size(); ++from)
        if (next < indices.size() && indices[next] == from)
            ++next;
        else
            array[to++] = array[from];
    array.resize(to);
}

}  // namespace

void remove_nowhere(TriangleMesh& mesh, std::span<const uint32_t> nowhere, std::vector<std::string>& notes) {
    if (nowhere.empty()) return;
    const size_t before = mesh.triangles.size();
    std::erase_if(mesh.triangles, [&](std::array<uint32_t, 3>& triangle) {
        for (uint32_t& vertex : triangle) {
            const auto found = std::lower_bound(nowhere.begin(), nowhere.end(), vertex);
            if (found != nowhere.end() && *found == vertex) return true;
            vertex -= uint32_t(found - nowhere.begin());
        }
        return false;
    });
    remove_at(mesh.positions, nowhere);
    remove_at(mesh.normals, nowhere);
    remove_at(mesh.colors, nowhere);
    for (MeshScalars& scalars : mesh.scalars) remove_at(scalars.values, nowhere);
    notes.push_back(std::to_string(nowhere.size()) + " vertices without a finite position are left out, and " +
                    std::to_string(before - mesh.triangles.size()) + " triangles that use them");
}

}  // namespace strata
