#include "io/potree/potree_writer.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/output_folder.h"
#include "io/potree/potree_encoding.h"
#include "io/potree/potree_hierarchy_writer.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

constexpr const char *kMetadataName = "metadata.json", *kHierarchyName = "hierarchy.bin", *kPointsName = "octree.bin";

FolderParts parts_of_a_set() {
    return {.always = {kMetadataName, kHierarchyName, kPointsName},
            .is_part = [](std::string_view name) { return name == kMetadataName || name == kHierarchyName || name == kPointsName; }};
}

ordered_json array_of(const Vec3d& v) { return ordered_json::array({v.x(), v.y(), v.z()}); }

// JSON has no infinities: an attribute without values has the range 0 ... 0.
ordered_json array_of(const std::vector<double>& values) {
    ordered_json array = ordered_json::array();
    for (const double value : values) array.push_back(std::isfinite(value) ? value : 0.0);
    return array;
}

bool is_64_bit_integer(const Attribute& attribute) {
    return attribute.type == ScalarType::int64 || attribute.type == ScalarType::uint64;
}

// Viewers have no getters for 64-bit integers and fail on the whole node: such attributes are stored as doubles.
Attribute stored_form(Attribute attribute) {
    if (is_64_bit_integer(attribute)) attribute.type = ScalarType::float64;
    return attribute;
}

class Writer : public NodeWriter {
public:
    Writer(const std::string& folder, const PotreeWriteSettings& settings)
        : settings_(settings), folder_(folder, parts_of_a_set(), settings.overwrite), points_file_(folder_.path_of(kPointsName), true) {}

    void begin(const BuiltCloud& cloud) override {
        cloud_ = cloud;
        size_t offset = 12;
        for (Attribute& attribute : cloud_.attributes) {
            if (is_64_bit_integer(attribute)) converted_.push_back({offset, attribute.type, attribute.components});
            offset += attribute.size_bytes();
            attribute = stored_form(attribute);
        }
        record_size_ = offset;
    }

    void encode(std::span<const std::byte> records, uint32_t points, std::vector<std::byte>& out) const override {
        std::vector<std::byte> changed;
        if (!converted_.empty()) {
            changed.assign(records.begin(), records.end());
            for (size_t at = 0; at < changed.size(); at += record_size_) convert_integers(changed.data() + at);
            records = changed;
        }
        if (settings_.encoding == PotreeEncoding::brotli)
            append_brotli_node(records, points, cloud_.attributes, settings_.brotli_quality, out);
        else
            out.insert(out.end(), records.begin(), records.end());
    }

    void append(std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) override {
        const uint64_t begin = points_file_.size();
        points_file_.write(bytes);
        for (BuiltNode node : nodes) {
            node.byte_offset += begin;
            nodes_.push_back(node);
        }
    }

    void finish() override {
        output_bytes_ = points_file_.size();
        points_file_.commit(settings_.durability);
        const PotreeHierarchyFile hierarchy = write_potree_hierarchy(std::move(nodes_));
        write_file(kHierarchyName, hierarchy.bytes);
        const std::string text = metadata(hierarchy).dump(1, '\t', false, ordered_json::error_handler_t::replace);
        write_file(kMetadataName, std::as_bytes(std::span(text)));
        folder_.commit(settings_.durability);
    }

    uint64_t output_bytes() const override { return output_bytes_; }

private:
    struct Converted {
        size_t offset;
        ScalarType type;
        int components;
    };

    void convert_integers(std::byte* record) const {
        for (const Converted& converted : converted_)
            for (int c = 0; c < converted.components; ++c) {
                const double value = load_scalar(converted.type, record + converted.offset + 8 * size_t(c));
                std::memcpy(record + converted.offset + 8 * size_t(c), &value, 8);
            }
    }

    void write_file(const char* name, std::span<const std::byte> bytes) {
        OutputFile file(folder_.path_of(name), true);
        file.write(bytes);
        file.commit(settings_.durability);
        output_bytes_ += bytes.size();
    }

    ordered_json attribute_json(const Attribute& attribute, const ordered_json& least, const ordered_json& greatest) const {
        const size_t components = size_t(attribute.components);
        ordered_json json = {{"name", attribute.name},
                             {"description", attribute.description},
                             {"size", attribute.size_bytes()},
                             {"numElements", attribute.components},
                             {"elementSize", scalar_size(attribute.type)},
                             {"type", scalar_name(attribute.type)},
                             {"min", least},
                             {"max", greatest},
                             {"scale", std::vector<double>(components, attribute.scale)},
                             {"offset", std::vector<double>(components, attribute.offset)}};
        if (std::isfinite(attribute.no_data)) json["noData"] = std::vector<double>(components, attribute.no_data);  // a key of ours
        return json;
    }

    ordered_json metadata(const PotreeHierarchyFile& hierarchy) const {
        const Vec3d scale = cloud_.quantization.scale;
        // The lowest corner, as the source's own integers give it; record quanta count from there.
        const Vec3d corner = cloud_.source_quantization.world_from_quanta(cloud_.min_quanta);
        const Vec3d highest = cloud_.source_quantization.world_from_quanta(cloud_.max_quanta);
        ordered_json attributes = ordered_json::array();
        attributes.push_back(attribute_json({.name = "position", .type = ScalarType::int32, .components = 3}, array_of(corner), array_of(highest)));
        for (size_t a = 0; a < cloud_.attributes.size(); ++a)
            attributes.push_back(attribute_json(cloud_.attributes[a], array_of(cloud_.attribute_min[a]), array_of(cloud_.attribute_max[a])));
        return {{"version", "2.0"},
                {"name", std::filesystem::path(folder_.path()).filename().string()},
                {"description", ""},
                {"points", cloud_.points},
                {"projection", cloud_.crs},
                {"hierarchy", {{"firstChunkSize", hierarchy.first_chunk_bytes}, {"stepSize", kHierarchyStep}, {"depth", hierarchy.depth}}},
                {"offset", array_of(corner)},
                {"scale", array_of(scale)},
                {"spacing", cloud_.spacing},
                {"boundingBox", {{"min", array_of(corner)}, {"max", array_of(Vec3d(corner.array() + cloud_.cube_side))}}},
                {"encoding", settings_.encoding == PotreeEncoding::brotli ? "BROTLI" : "DEFAULT"},
                {"attributes", attributes},
                // What export needs to give the source's own integers back: source = stored * 2^coarseningBits + shift.
                {"source",
                 {{"scale", array_of(cloud_.source_quantization.scale)},
                  {"offset", array_of(cloud_.source_quantization.offset)},
                  {"shift", {cloud_.min_quanta.x(), cloud_.min_quanta.y(), cloud_.min_quanta.z()}},
                  {"coarseningBits", cloud_.coarsening_bits}}}};
    }

    PotreeWriteSettings settings_;
    OutputFolder folder_;
    OutputFile points_file_;
    BuiltCloud cloud_;
    std::vector<Converted> converted_;
    size_t record_size_ = 12;
    std::vector<BuiltNode> nodes_;
    uint64_t output_bytes_ = 0;
};

}  // namespace

std::unique_ptr<NodeWriter> make_potree_writer(const std::string& folder, const PotreeWriteSettings& settings) {
    return std::make_unique<Writer>(folder, settings);
}

}  // namespace strata
