// What strata voxelize writes: voxel files of a tree or a DAG, and OpenVDB grids.
#include "app/commands/voxel_output.h"

#include <numeric>

#include "core/error.h"
#include "core/voxel/voxel_dag.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/vdb/vdb_writer.h"

namespace strata {
namespace {

uint64_t sum_of(const std::vector<uint64_t>& counts) { return std::accumulate(counts.begin(), counts.end(), uint64_t{0}); }

class TreeOutput : public VoxelOutput {
public:
    TreeOutput(const VoxelOutputRequest& request, const VoxelFrame& frame, const VoxelAttributes& attributes, const SvoLabels& labels)
        : durability_(request.durability), writer_(request.path, request.overwrite, frame, labels), builder_(frame, attributes, writer_) {}

    void add(const VoxelBatch& batch) override { builder_.add(batch); }
    VoxelOutputReport commit() override {
        const VoxelTreeCounts counts = builder_.finish();
        return {.voxels = counts.voxels, .bytes = writer_.commit(counts.voxels, durability_), .nodes = sum_of(counts.nodes)};
    }

private:
    Durability durability_;
    SvoWriter writer_;
    VoxelTreeBuilder builder_;
};

// Subtrees are compared when all are there.
class DagOutput : public VoxelOutput {
public:
    DagOutput(const VoxelOutputRequest& request, const VoxelFrame& frame, const VoxelAttributes& attributes, const SvoLabels& labels)
        : durability_(request.durability), writer_(request.path, request.overwrite, frame, labels, svo::Layout::dag),
          memory_(frame, attributes, request.memory_bytes / 2), builder_(frame, attributes, memory_) {
        if (attributes.any_of_voxels() || attributes.opacity) throw Error(ErrorKind::usage, "--dag: a DAG says what is occupied and has no attributes; --attributes none is expected");
    }

    void add(const VoxelBatch& batch) override {
        with_hint([&] { builder_.add(batch); });
    }
    uint64_t estimated_bytes(uint64_t) const override { return 0; }  // known when it is done
    VoxelOutputReport commit() override {
        const VoxelTreeCounts counts = finish();
        const VoxelDag dag = dag_of(memory_.take());
        write_svo_dag(dag, writer_);
        VoxelOutputReport report = {.voxels = counts.voxels, .bytes = writer_.commit(counts.voxels, durability_), .nodes = sum_of(counts.nodes)};
        for (const DagLevel& level : dag.levels) report.dag_nodes += level.masks.size();
        return report;
    }

private:
    template <typename Act>
    static void with_hint(const Act& act) {
        try {
            act();
        } catch (const Error& error) {
            if (error.kind != ErrorKind::limit) throw;
            throw error.within("--dag needs the whole tree in half of --memory");
        }
    }
    VoxelTreeCounts finish() {
        VoxelTreeCounts counts;
        with_hint([&] { counts = builder_.finish(); });
        return counts;
    }

    Durability durability_;
    SvoWriter writer_;
    VoxelTreeInMemory memory_;
    VoxelTreeBuilder builder_;
};

class VdbOutput : public VoxelOutput {
public:
    VdbOutput(const VoxelOutputRequest& request, const VoxelFrame& frame, const VoxelAttributes& attributes)
        : durability_(request.durability), writer_(request.path, request.overwrite, frame, {.memory_bytes = request.memory_bytes / 2}), builder_(frame, {}, nothing_) {
        if (attributes.normal || attributes.opacity) throw Error(ErrorKind::usage, "--attributes: a .vdb file keeps count and color");
    }

    void add(const VoxelBatch& batch) override {
        writer_.add(batch);
        builder_.add({.blocks = batch.blocks});
    }
    uint64_t estimated_bytes(uint64_t) const override { return 0; }  // compressed
    VoxelOutputReport commit() override {
        const VoxelTreeCounts counts = builder_.finish();
        return {.voxels = counts.voxels, .bytes = writer_.commit(durability_), .nodes = sum_of(counts.nodes)};
    }

private:
    // The octree is only counted.
    class Nothing : public VoxelTreeSink {
        void append(VoxelStream, std::span<const std::byte>) override {}
    };

    Durability durability_;
    VdbWriter writer_;
    Nothing nothing_;
    VoxelTreeBuilder builder_;
};

}  // namespace

VoxelOutputRequest voxel_output_request(const Options& options) {
    VoxelOutputRequest request = {.path = options.text("--output"),
                                  .overwrite = options.given("--overwrite"),
                                  .dag = options.given("--dag"),
                                  .durability = options.given("--no-sync") ? Durability::unsynced : Durability::synced,
                                  .memory_bytes = memory_cap(options)};
    if (request.path.empty()) throw Error(ErrorKind::usage, "voxelize: --output OUT is expected, a name that ends in .svo or .vdb");
    const bool vdb = request.path.ends_with(".vdb");
    if (!vdb && !request.path.ends_with(".svo")) throw Error(ErrorKind::usage, request.path + ": a name that ends in .svo or .vdb is expected");
    if (vdb && request.dag) throw Error(ErrorKind::usage, "--dag is for .svo files");
    return request;
}

std::unique_ptr<VoxelOutput> make_voxel_output(const VoxelOutputRequest& request, const VoxelFrame& frame, const VoxelAttributes& attributes, const SvoLabels& labels) {
    if (request.path.ends_with(".vdb")) return std::make_unique<VdbOutput>(request, frame, attributes);
    if (request.dag) return std::make_unique<DagOutput>(request, frame, attributes, labels);
    return std::make_unique<TreeOutput>(request, frame, attributes, labels);
}

}  // namespace strata
