#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "app/commands/surface_input.h"
#include "core/surface/vertex_values.h"
#include "io/volume/volume_source.h"

namespace strata {

/// What --attributes names for a surface of values on a grid: where its vertices find attributes and colors.
class SurfaceAttributes {
public:
    /// None.
    SurfaceAttributes() = default;
    /// Of other volume files: read beside the main one where their samples lie at the same places, else held in memory.
    /// memory_bytes  for all of them
    /// throws        Error{usage}: no volumes, or two of one name; Error{limit}
    static SurfaceAttributes of_volumes(const VolumeSource& main, const SurfaceRequest& request, uint64_t memory_bytes);
    /// Of other grids of a .vdb file: of numbers; of three numbers, each on its own, or where it is called color, rgb or Cd as colors.
    static SurfaceAttributes of_grids(const std::string& path, const SurfaceRequest& request, uint64_t memory_bytes);

    bool empty() const { return names_.empty() && !colors_; }
    const std::vector<std::string>& names() const { return names_; }
    bool has_colors() const { return colors_ != nullptr; }
    void set_colors(std::unique_ptr<ColorsAtVertices> colors) { colors_ = std::move(colors); }
    uint64_t memory_bytes() const { return memory_bytes_; }  // that they take
    std::vector<std::string>& notes() { return notes_; }

    /// Calls extract(sink) with one that gives what comes what is here, and hands it to `out`.
    template <typename Extract>
    auto extract_with(SurfaceSink& out, const Extract& extract) {
        if (empty()) return extract(out);
        SurfaceWithValues with(out);
        for (size_t i = 0; i < names_.size(); ++i) with.add_values(names_[i], *values_[i]);
        if (colors_) with.set_colors(*colors_);
        const auto found = extract(with);
        with.finish();
        return found;
    }

private:
    void add(const std::string& name, std::unique_ptr<ValuesAtVertices> values);

    std::vector<std::unique_ptr<ScratchStore>> scratches_;  // of grids
    std::vector<std::unique_ptr<VolumeSource>> volumes_;
    std::vector<std::string> names_, notes_;
    std::vector<std::unique_ptr<ValuesAtVertices>> values_;  // [names]
    std::unique_ptr<ColorsAtVertices> colors_;
    uint64_t memory_bytes_ = 0;
};

}  // namespace strata
