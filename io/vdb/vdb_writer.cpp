#include "io/vdb/vdb_writer.h"

#include "core/error.h"

#ifdef STRATA_OPENVDB

#include <Eigen/Geometry>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <ostream>
#include <span>
#include <streambuf>

namespace strata {
namespace {

constexpr size_t kBuffer = 1 << 20;

// Bytes for an output file by way of a stream that can go back.
class OutputBuffer : public std::streambuf {
public:
    explicit OutputBuffer(OutputFile& file) : file_(file), bytes_(kBuffer) { setp(bytes_.data(), bytes_.data() + bytes_.size()); }

protected:
    int_type overflow(int_type c) override {
        flush();
        if (!traits_type::eq_int_type(c, traits_type::eof())) sputc(traits_type::to_char_type(c));
        return traits_type::not_eof(c);
    }
    int sync() override {
        flush();
        return 0;
    }
    pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override {
        const off_type here = off_type(place_) + (pptr() - pbase());
        if (from == std::ios_base::cur && offset == 0) return here;
        flush();
        place_ = uint64_t(offset + (from == std::ios_base::beg ? 0 : from == std::ios_base::cur ? here : off_type(file_.size())));
        return off_type(place_);
    }
    pos_type seekpos(pos_type place, std::ios_base::openmode mode) override { return seekoff(off_type(place), std::ios_base::beg, mode); }

private:
    void flush() {
        const size_t count = size_t(pptr() - pbase());
        if (count == 0) return;
        file_.write_at(place_, std::as_bytes(std::span(pbase(), count)));
        place_ += count;
        setp(bytes_.data(), bytes_.data() + bytes_.size());
    }

    OutputFile& file_;
    std::vector<char> bytes_;
    uint64_t place_ = 0;  // in the file, of the buffer's first byte
};

// OpenVDB writes to streams by this class alone; its own File goes to a path.
class Archive : public openvdb::io::Archive {
public:
    void write_to(std::ostream& out, const openvdb::GridCPtrVec& grids) const { write(out, grids, /*seekable=*/true, openvdb::MetaMap()); }

private:
    using openvdb::io::Archive::write;
};

uint64_t write_grids(OutputFile& file, const openvdb::GridCPtrVec& grids, const VdbWriteSettings& settings, Durability durability) {
    Archive archive;
    using namespace openvdb::io;
    const uint32_t compression = settings.compression == VdbCompression::zip ? COMPRESS_ZIP : settings.compression == VdbCompression::blosc ? COMPRESS_BLOSC : COMPRESS_NONE;
    archive.setCompression(compression | COMPRESS_ACTIVE_MASK);
    OutputBuffer buffer(file);
    std::ostream out(&buffer);
    out.exceptions(std::ios_base::badbit | std::ios_base::failbit);  // the buffer's Error comes through
    archive.write_to(out, grids);
    out.flush();
    // Each file gets a random name of its own, a UUID behind 21 bytes of signature, versions and a flag: the same input, the same bytes.
    constexpr std::string_view kName = "00000000-0000-4000-8000-000000000000";
    file.write_at(21, std::as_bytes(std::span(kName)));
    file.commit(durability);
    return file.size();
}

// Where the bits of a 4^3 mask are in a leaf: place 64 x + 8 y + z, by the block's octant in the leaf.
constexpr std::array<std::array<uint16_t, 64>, 8> kPlaces = [] {
    std::array<std::array<uint16_t, 64>, 8> places{};
    for (uint32_t octant = 0; octant < 8; ++octant)
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const auto [x, y, z] = coordinates_of_code(octant * 64 + bit);
            places[octant][bit] = uint16_t(x << 6 | y << 3 | z);
        }
    return places;
}();

// What OpenVDB throws becomes an Error. place: for its message, may be empty
template <typename Act>
auto with_errors(const std::string& place, const Act& act) {
    try {
        return act();
    } catch (const openvdb::Exception& failure) {
        const bool is_io = dynamic_cast<const openvdb::IoError*>(&failure) != nullptr;
        throw Error(is_io ? ErrorKind::io : ErrorKind::unsupported, (place.empty() ? "" : place + ": ") + "OpenVDB: " + failure.what());
    }
}

openvdb::math::Transform::Ptr transform_of(const Vec3d& place_of_0, double voxel_size) {
    const auto transform = openvdb::math::Transform::createLinearTransform(voxel_size);
    transform->postTranslate({place_of_0.x(), place_of_0.y(), place_of_0.z()});
    return transform;
}

openvdb::Coord coord_of(uint64_t code, int log2_side) {
    const auto [x, y, z] = coordinates_of_code(code);
    return {int(x) << log2_side, int(y) << log2_side, int(z) << log2_side};
}

template <typename Tree, typename Value>
void put_block(Tree& tree, const VoxelBlock& block, const Value& value) {
    if (block.height == 0) {
        auto* const leaf = tree.touchLeaf(coord_of(block.code, 2));
        const auto& places = kPlaces[size_t(block.code & 7)];
        for (uint64_t left = block.mask; left != 0; left &= left - 1) leaf->setValueOn(places[size_t(std::countr_zero(left))], value);
        return;
    }
    const auto fill = [&](uint64_t code, int log2_side) {
        const openvdb::Coord least = coord_of(code, log2_side);
        tree.fill(openvdb::CoordBBox::createCube(least, 1 << log2_side), value, true);
    };
    const int log2_cell = 2 * block.height;
    for (uint64_t octant = 0; octant < 8; ++octant) {
        const uint64_t cells = block.mask >> 8 * octant & 0xFF;
        if (cells == 0xFF)
            fill(block.code * 8 + octant, log2_cell + 1);
        else
            for (uint64_t left = cells; left != 0; left &= left - 1) fill((block.code * 8 + octant) * 8 + uint64_t(std::countr_zero(left)), log2_cell);
    }
}

}  // namespace

bool has_openvdb() { return true; }

struct VdbWriter::Grids {
    OutputFile file;
    VoxelFrame frame;
    VdbWriteSettings settings;
    openvdb::FloatGrid::Ptr fog;
    openvdb::MaskGrid::Ptr mask;
    openvdb::Int32Grid::Ptr count;
    openvdb::Vec3SGrid::Ptr color;
    uint64_t bytes = 0, last_leaf = ~uint64_t{0};  // of leaves, which take nearly all; a leaf that is left and met again counts twice

    void count_leaf(const VoxelBlock& block, bool with_count, bool with_color) {
        if (block.height != 0 || block.code >> 3 == last_leaf) return;
        last_leaf = block.code >> 3;
        bytes += (mask ? sizeof(openvdb::MaskTree::LeafNodeType) : sizeof(openvdb::FloatTree::LeafNodeType) + 512 * sizeof(float)) +
                 (with_count ? sizeof(openvdb::Int32Tree::LeafNodeType) + 512 * sizeof(int32_t) : 0) +
                 (with_color ? sizeof(openvdb::Vec3STree::LeafNodeType) + 512 * sizeof(openvdb::Vec3f) : 0);
        if (bytes > settings.memory_bytes)
            throw Error(ErrorKind::limit, file.path() + ": its grids need more than " + std::to_string(bytes) + " bytes of memory, " +
                                              std::to_string(settings.memory_bytes) + " are allowed; values of a mask need least");
    }

    template <typename Grid>
    typename Grid::Ptr make(const char* name) const {
        const auto grid = Grid::create();
        grid->setName(name);
        grid->setTransform(transform_of(frame.origin + Vec3d::Constant(0.5 * frame.voxel_size), frame.voxel_size));
        grid->insertMeta("strata_levels", openvdb::Int32Metadata(frame.levels));
        return grid;
    }
};

VdbWriter::VdbWriter(const std::string& path, bool overwrite, const VoxelFrame& frame, const VdbWriteSettings& settings)
    : grids_(new Grids{.file = {path, overwrite}, .frame = frame, .settings = settings}) {
    with_errors(path, [&] {
        openvdb::initialize();
        if (settings.as_mask) {
            grids_->mask = grids_->make<openvdb::MaskGrid>("occupancy");
            return;
        }
        grids_->fog = grids_->make<openvdb::FloatGrid>("occupancy");
        grids_->fog->setGridClass(openvdb::GRID_FOG_VOLUME);
        grids_->fog->setSaveFloatAsHalf(settings.half);
    });
}
VdbWriter::~VdbWriter() = default;

void VdbWriter::add(const VoxelBatch& batch) {
    Grids& grids = *grids_;
    if (!batch.counts.empty() && !grids.count) grids.count = grids.make<openvdb::Int32Grid>("count");
    if (!batch.colors.empty() && !grids.color) grids.color = grids.make<openvdb::Vec3SGrid>("color");
    size_t voxel = 0;
    for (const VoxelBlock& block : batch.blocks) {
        grids.count_leaf(block, !batch.counts.empty(), !batch.colors.empty());
        if (grids.mask)
            put_block(grids.mask->tree(), block, true);
        else
            put_block(grids.fog->tree(), block, 1.0f);
        if (batch.counts.empty() && batch.colors.empty()) continue;
        const openvdb::Coord place = coord_of(block.code, 2);
        auto* const counts = batch.counts.empty() ? nullptr : grids.count->tree().touchLeaf(place);
        auto* const colors = batch.colors.empty() ? nullptr : grids.color->tree().touchLeaf(place);
        for (uint64_t left = block.mask; left != 0; left &= left - 1, ++voxel) {
            const uint16_t at = kPlaces[size_t(block.code & 7)][size_t(std::countr_zero(left))];
            if (counts) counts->setValueOn(at, int32_t(std::min<uint32_t>(batch.counts[voxel], 0x7FFFFFFF)));
            if (colors) colors->setValueOn(at, openvdb::Vec3f(batch.colors[voxel][0], batch.colors[voxel][1], batch.colors[voxel][2]) / 255.0f);
        }
    }
}

uint64_t VdbWriter::commit(Durability durability) {
    return with_errors(grids_->file.path(), [&] {
        openvdb::GridCPtrVec grids;
        if (grids_->fog) {
            openvdb::tools::prune(grids_->fog->tree());
            grids.push_back(grids_->fog);
        }
        if (grids_->mask) {
            openvdb::tools::prune(grids_->mask->tree());
            grids.push_back(grids_->mask);
        }
        if (grids_->count) grids.push_back(grids_->count);
        if (grids_->color) grids.push_back(grids_->color);
        return write_grids(grids_->file, grids, grids_->settings, durability);
    });
}

struct MeshLevelSet::Grid {
    openvdb::FloatGrid::Ptr grid;
    Vec3d place_of_0;
    double voxel_size;
};

namespace {

// A mesh as OpenVDB asks for it, in double precision: floats would move vertices that lie far from the world's origin.
struct IndexSpaceMesh {
    const TriangleMesh& mesh;
    Vec3d place_of_0;
    double voxel_size;

    size_t polygonCount() const { return mesh.triangles.size(); }
    size_t pointCount() const { return mesh.positions.size(); }
    size_t vertexCount(size_t) const { return 3; }
    void getIndexSpacePoint(size_t triangle, size_t corner, openvdb::Vec3d& place) const {
        const Vec3d p = (mesh.positions[mesh.triangles[triangle][corner]] - place_of_0) / voxel_size;
        place = {p.x(), p.y(), p.z()};
    }
};

// Bytes that the band and what is beside it while it is made take: leaves are half filled by it, each voxel has a distance
// and the index of a triangle.
double estimated_bytes(const TriangleMesh& mesh, const LevelSetSettings& settings) {
    double area = 0.0;
    for (const auto& [a, b, c] : mesh.triangles)
        area += 0.5 * (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm();
    return area / (settings.voxel_size * settings.voxel_size) * 2.0 * (settings.half_width + 1.0) * 2.0 * 8.0;
}

}  // namespace

MeshLevelSet::MeshLevelSet(const TriangleMesh& mesh, const LevelSetSettings& settings) {
    const auto is_positive = [](double value) { return std::isfinite(value) && value > 0.0; };
    if (mesh.triangles.empty()) throw Error(ErrorKind::usage, "a level set needs triangles");
    if (!is_positive(settings.voxel_size)) throw Error(ErrorKind::usage, "a positive voxel size is expected");
    if (!is_positive(settings.half_width) || settings.half_width > 1000.0) throw Error(ErrorKind::usage, "a half width of up to 1000 voxels is expected");
    Box3d box;  // of triangles: vertices that none uses may lie anywhere
    for (const auto& triangle : mesh.triangles)
        for (const uint32_t vertex : triangle) box.extend(mesh.positions[vertex]);
    if (box.size().maxCoeff() / settings.voxel_size + 2.0 * settings.half_width > 1 << 20)
        throw Error(ErrorKind::limit, "at most 1,048,576 voxels an axis can be held");
    const double bytes = estimated_bytes(mesh, settings);
    if (bytes > double(settings.memory_bytes))
        throw Error(ErrorKind::limit, "the level set needs about " + std::to_string(uint64_t(bytes)) + " bytes of memory, " +
                                          std::to_string(settings.memory_bytes) + " are allowed");
    const Vec3d place_of_0 = (box.min / settings.voxel_size).array().floor().matrix() * settings.voxel_size;
    with_errors("", [&] {
        openvdb::initialize();
        const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, size_t(std::max(settings.threads, 1)));
        const auto transform = transform_of(place_of_0, settings.voxel_size);
        const IndexSpaceMesh index_mesh{mesh, place_of_0, settings.voxel_size};
        const float width = float(settings.half_width);
        const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(index_mesh, *transform, width, width);
        grid->setName("surface");
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        grid_.reset(new Grid{grid, place_of_0, settings.voxel_size});
    });
}
MeshLevelSet::~MeshLevelSet() = default;

uint64_t MeshLevelSet::active_voxels() const { return grid_->grid->activeVoxelCount(); }

VdbVoxels MeshLevelSet::voxels(double isovalue) const {
    VdbVoxels result;
    result.grid = {.name = "surface", .type = "float", .grid_class = "level set", .is_common = true, .voxel_size = Vec3d::Constant(grid_->voxel_size), .place_of_0 = grid_->place_of_0};
    const VdbVisitor visitor = gather_occupied(result.grid, {.isovalue = isovalue}, "level set", result.voxels);
    const openvdb::FloatTree& tree = grid_->grid->tree();
    visitor.begin(double(tree.background()));
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(int(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH) - 1);
    for (; tile; ++tile) {
        const openvdb::CoordBBox box = tile.getBoundingBox();
        visitor.tile({box.min().x(), box.min().y(), box.min().z()}, int(std::bit_width(uint32_t(box.dim().x())) - 1), double(*tile), tile.isValueOn());
    }
    std::array<uint64_t, 8> active;
    std::array<double, 512> values;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        for (openvdb::Index word = 0; word < 8; ++word) active[word] = leaf->valueMask().template getWord<uint64_t>(word);
        for (openvdb::Index i = 0; i < 512; ++i) values[i] = double(leaf->getValue(i));
        const openvdb::Coord origin = leaf->origin();
        visitor.leaf({origin.x(), origin.y(), origin.z()}, active, values);
    }
    result.frame = result.voxels.finish(grid_->place_of_0, grid_->voxel_size);
    return result;
}

uint64_t MeshLevelSet::write(const std::string& path, bool overwrite, const VdbWriteSettings& settings, Durability durability) const {
    OutputFile file(path, overwrite);
    grid_->grid->setSaveFloatAsHalf(settings.half);
    return with_errors(path, [&] { return write_grids(file, {grid_->grid}, settings, durability); });
}

}  // namespace strata

#else

namespace strata {
namespace {

[[noreturn]] void refuse() { throw Error(ErrorKind::unsupported, "this build has no OpenVDB, which writes .vdb files and makes level sets of meshes"); }

}  // namespace

bool has_openvdb() { return false; }

struct VdbWriter::Grids {};
VdbWriter::VdbWriter(const std::string&, bool, const VoxelFrame&, const VdbWriteSettings&) { refuse(); }
VdbWriter::~VdbWriter() = default;
void VdbWriter::add(const VoxelBatch&) { refuse(); }
uint64_t VdbWriter::commit(Durability) { refuse(); }

struct MeshLevelSet::Grid {};
MeshLevelSet::MeshLevelSet(const TriangleMesh&, const LevelSetSettings&) { refuse(); }
MeshLevelSet::~MeshLevelSet() = default;
uint64_t MeshLevelSet::active_voxels() const { refuse(); }
VdbVoxels MeshLevelSet::voxels(double) const { refuse(); }
uint64_t MeshLevelSet::write(const std::string&, bool, const VdbWriteSettings&, Durability) const { refuse(); }

}  // namespace strata

#endif
