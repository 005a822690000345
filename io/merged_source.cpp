#include "io/merged_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "core/cloud/rgb_depth.h"
#include "core/error.h"
#include "core/parallel.h"
#include "io/crs/crs_text.h"
#include "io/las/las_promotion.h"

namespace strata {
namespace {

using namespace attribute_name;

constexpr double kLeastQuanta = std::numeric_limits<int32_t>::min(), kMostQuanta = std::numeric_limits<int32_t>::max();

enum class Conversion { absent, copy, widen_rgb, rank_to_angle, promote_class, promote_flags, to_double };

// How one column of the merged cloud comes from a source.
struct ColumnPlan {
    Conversion conversion = Conversion::absent;
    int index = -1;  // of the source's attribute; -1: it has none
};

struct SourcePlan {
    std::vector<ColumnPlan> columns;  // one per attribute of the merged cloud
    int old_class = -1;               // index of the classification that promote_flags looks at
    // quanta of the merged cloud = quanta * ratio + shift; both whole where scales agree
    std::array<double, 3> ratio, shift;
};

bool is_scan_angle(const Attribute& attribute) {
    return attribute.name == kScanAngle && attribute.type == ScalarType::int16 && attribute.components == 1;
}

bool is_rank(const Attribute& attribute) { return attribute.name == kScanAngleRank && attribute.size_bytes() == 1; }

std::string merged_name(const Attribute& attribute, bool with_scan_angle) {
    return with_scan_angle && is_rank(attribute) ? std::string(kScanAngle) : attribute.name;
}

bool stored_alike(const Attribute& a, const Attribute& b) {
    return a.type == b.type && a.scale == b.scale && a.offset == b.offset &&
           (a.no_data == b.no_data || (std::isnan(a.no_data) && std::isnan(b.no_data)));
}

int standard_rank(const Attribute& attribute) {
    constexpr std::array kOrder = {kIntensity, kReturnNumber, kNumberOfReturns, kClassificationFlags, kClassification, kScanAngleRank,
                                   kScanAngle, kUserData, kPointSourceId, kGpsTime, kRgb, kNearInfrared};
    return int(std::find(kOrder.begin(), kOrder.end(), std::string_view(attribute.name)) - kOrder.begin());
}

std::vector<Attribute> unite_attributes(const std::vector<std::unique_ptr<PointSource>>& sources, const std::vector<std::string>& names,
                                        bool with_scan_angle) {
    std::vector<Attribute> all;
    for (size_t s = 0; s < sources.size(); ++s)
        for (Attribute attribute : sources[s]->info().attributes) {
            if (with_scan_angle && is_rank(attribute)) continue;
            const int index = find_attribute(all, attribute.name);
            if (index < 0) {
                all.push_back(std::move(attribute));
                continue;
            }
            Attribute& seen = all[size_t(index)];
            if (seen.components != attribute.components)
                throw Error(ErrorKind::unsupported, names[s] + ": attribute '" + attribute.name + "' has " + std::to_string(attribute.components) +
                                                        " components, in the files before it " + std::to_string(seen.components));
            if (!stored_alike(seen, attribute))
                seen = {.name = seen.name, .description = seen.description, .type = ScalarType::float64, .components = seen.components};
        }
    std::stable_sort(all.begin(), all.end(), [](const Attribute& a, const Attribute& b) { return standard_rank(a) < standard_rank(b); });
    return all;
}

// The finest scale and the first offset, unless int32 cannot hold the bounds so.
Quantization unite_quantization(const std::vector<std::unique_ptr<PointSource>>& sources, const Box3d& bounds, std::vector<std::string>& notes) {
    Quantization united = sources.front()->info().quantization;
    for (const auto& source : sources) united.scale = united.scale.cwiseMin(source->info().quantization.scale);
    for (int axis = 0; axis < 3; ++axis) {
        double& scale = united.scale[axis];
        double& offset = united.offset[axis];
        const double low = bounds.min[axis], high = bounds.max[axis];
        if (!std::isfinite(low) || !std::isfinite(high)) continue;
        const auto fits = [&] { return (low - offset) / scale > kLeastQuanta && (high - offset) / scale < kMostQuanta; };
        if (fits()) continue;
        const double finest = scale;
        while ((high - low) / scale > kMostQuanta - kLeastQuanta - 2.0) scale *= 10.0;
        if (scale != finest)
            notes.push_back(std::string("the ") + "xyz"[axis] + " scale is widened to " + std::to_string(scale) + " to hold all files");
        offset += std::round((0.5 * (low + high) - offset) / scale) * scale;
    }
    return united;
}

template <typename To, typename From, typename Function>
void convert(const std::vector<std::byte>& in, std::vector<std::byte>& out, Function function) {
    const size_t count = in.size() / sizeof(From);
    for (size_t i = 0; i < count; ++i) {
        From from;
        std::memcpy(&from, in.data() + i * sizeof from, sizeof from);
        const To to = function(from);
        std::memcpy(out.data() + i * sizeof to, &to, sizeof to);
    }
}

void convert_to_double(const Attribute& attribute, const std::vector<std::byte>& in, std::vector<std::byte>& out) {
    const size_t size = scalar_size(attribute.type), count = in.size() / size;
    for (size_t i = 0; i < count; ++i) {
        const double stored = load_scalar(attribute.type, in.data() + i * size);
        const double value = stored == attribute.no_data ? std::numeric_limits<double>::quiet_NaN() : stored * attribute.scale + attribute.offset;
        std::memcpy(out.data() + i * sizeof value, &value, sizeof value);
    }
}

class MergedSource : public PointSource {
public:
    MergedSource(std::vector<std::unique_ptr<PointSource>> sources, std::vector<std::string> names)
        : sources_(std::move(sources)), names_(std::move(names)) {
        first_batch_.push_back(0);
        const bool with_scan_angle = std::any_of(sources_.begin(), sources_.end(), [](const auto& source) {
            return std::any_of(source->info().attributes.begin(), source->info().attributes.end(), is_scan_angle);
        });
        for (size_t s = 0; s < sources_.size(); ++s) {
            const CloudInfo& info = sources_[s]->info();
            first_batch_.push_back(first_batch_.back() + sources_[s]->batch_count());
            info_.points += info.points;
            if (info.points > 0) info_.bounds.extend(info.bounds);
            for (const std::string& text : info.notes) note(s, text);
            if (with_scan_angle && std::any_of(info.attributes.begin(), info.attributes.end(), is_rank)) note(s, std::string(las::kPromotionNote));
            unite_crs(s);
            if (!info_.adjusted_gps_time) info_.adjusted_gps_time = info.adjusted_gps_time;
            if (info.adjusted_gps_time && info.adjusted_gps_time != info_.adjusted_gps_time)
                note(s, std::string("GPS times are ") + (*info.adjusted_gps_time ? "standard time" : "seconds of the week") +
                            ", in the files before it they are not; they are kept as they are");
        }
        for (const FileNote& said : file_notes_) {
            const std::string others = said.files > 1 ? " and " + std::to_string(said.files - 1) + " more" : "";
            info_.notes.push_back(names_[said.first] + others + ": " + said.text);
        }
        info_.format = sources_.front()->info().format + ", " + std::to_string(sources_.size()) + " files";
        info_.quantization = unite_quantization(sources_, info_.bounds, info_.notes);
        info_.attributes = unite_attributes(sources_, names_, with_scan_angle);
        plan(with_scan_angle);
    }

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return first_batch_.back(); }

    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t s = size_t(std::upper_bound(first_batch_.begin(), first_batch_.end(), index) - first_batch_.begin()) - 1;
        const SourcePlan& plan = plans_[s];
        std::vector<int> source_wanted;
        const auto want = [&](int column) {
            if (column >= 0 && std::find(source_wanted.begin(), source_wanted.end(), column) == source_wanted.end()) source_wanted.push_back(column);
        };
        for (const int i : wanted) {
            want(plan.columns[size_t(i)].index);
            if (plan.columns[size_t(i)].conversion == Conversion::promote_flags) want(plan.old_class);
        }
        thread_local PointBatch batch;
        sources_[s]->read_batch(index - first_batch_[s], source_wanted, batch);
        resize_batch(out, batch.size, info_.attributes, wanted);
        convert_axis(s, 0, batch.x, out.x);
        convert_axis(s, 1, batch.y, out.y);
        convert_axis(s, 2, batch.z, out.z);
        for (const int i : wanted) convert_column(s, plan.columns[size_t(i)], batch, out.columns[size_t(i)]);
    }

private:
    // The first that is known. Files say one system in several ways, but seldom in more than two: what was compared is kept.
    void unite_crs(size_t s) {
        const CloudInfo& info = sources_[s]->info();
        if (s == 0) info_.crs_records = info.crs_records;
        if (info.crs_records != info_.crs_records) info_.crs_records.clear();
        if (info.crs.empty()) return;
        if (info_.crs.empty()) info_.crs = info.crs;
        const auto known = same_systems_.find(info.crs);
        const bool same = known != same_systems_.end() ? known->second : (same_systems_[info.crs] = same_crs(info.crs, info_.crs));
        if (!same)
            note(s, "its coordinate reference system, " + crs_name(info.crs) + ", differs from that of the files before it, " +
                        crs_name(info_.crs) + ", which is kept; convert --out-crs brings all to one");
    }

    // A thousand tiles with one note say it once.
    struct FileNote {
        std::string text;
        size_t first = 0, files = 0;
    };

    void note(size_t s, const std::string& text) {
        const auto [place, is_new] = note_places_.try_emplace(text, file_notes_.size());
        if (is_new) file_notes_.push_back({text, s, 0});
        ++file_notes_[place->second].files;
    }

    void plan(bool with_scan_angle) {
        std::vector<int> depths;
        for (const auto& source : sources_) depths.push_back(rgb_depth(*source, default_thread_count()));
        const bool deep_rgb = std::find(depths.begin(), depths.end(), 16) != depths.end();
        for (size_t s = 0; s < sources_.size(); ++s) {
            const CloudInfo& info = sources_[s]->info();
            SourcePlan& plan = plans_.emplace_back();
            plan.columns.resize(info_.attributes.size());
            bool from_older_format = false;
            for (size_t i = 0; i < info.attributes.size(); ++i) {
                const Attribute& attribute = info.attributes[i];
                const int merged = find_attribute(info_.attributes, merged_name(attribute, with_scan_angle));
                ColumnPlan& column = plan.columns[size_t(merged)];
                column = {Conversion::copy, int(i)};
                if (attribute.name != info_.attributes[size_t(merged)].name) {
                    const bool steps = is_scan_angle(info_.attributes[size_t(merged)]);
                    column.conversion = steps ? Conversion::rank_to_angle : Conversion::to_double;
                    from_older_format = true;
                } else if (!stored_alike(attribute, info_.attributes[size_t(merged)]))
                    column.conversion = Conversion::to_double;
                else if (attribute.name == kRgb && deep_rgb && depths[s] == 8)
                    column.conversion = Conversion::widen_rgb;
            }
            if (from_older_format) promote_overlap(s, plan);
            for (int axis = 0; axis < 3; ++axis) {
                const double scale = info_.quantization.scale[axis];
                const double shift = (info.quantization.offset[axis] - info_.quantization.offset[axis]) / scale;
                plan.ratio[size_t(axis)] = info.quantization.scale[axis] / scale;
                plan.shift[size_t(axis)] = plan.ratio[size_t(axis)] == 1.0 ? std::round(shift) : shift;
                // Where every step lands on a step nothing is rounded but what the double arithmetic of offsets leaves.
                const double ratio = plan.ratio[size_t(axis)], off_step = std::abs(shift - std::round(shift));
                const bool whole_steps = ratio == std::round(ratio);
                const double rounding = (whole_steps ? off_step : 0.5) * scale;
                info_.worst_rounding = std::max(info_.worst_rounding, info.worst_rounding + (rounding > 1e-6 * scale ? rounding : 0.0));
            }
        }
    }

    // Among points of formats 6 to 10 class 12 would mean nothing. A data set that came from elsewhere may lack the flags.
    void promote_overlap(size_t s, SourcePlan& plan) const {
        const int old_class = find_attribute(sources_[s]->info().attributes, kClassification);
        const int merged_class = find_attribute(info_.attributes, kClassification), flags = find_attribute(info_.attributes, kClassificationFlags);
        if (old_class < 0 || flags < 0) return;
        ColumnPlan &class_column = plan.columns[size_t(merged_class)], &flag_column = plan.columns[size_t(flags)];
        if (info_.attributes[size_t(merged_class)].size_bytes() != 1 || class_column.conversion != Conversion::copy) return;
        if (info_.attributes[size_t(flags)].size_bytes() != 1 || flag_column.conversion == Conversion::to_double) return;
        plan.old_class = old_class;
        class_column.conversion = Conversion::promote_class;
        flag_column.conversion = Conversion::promote_flags;
    }

    void convert_axis(size_t s, size_t axis, const std::vector<int32_t>& in, std::vector<int32_t>& out) const {
        const double ratio = plans_[s].ratio[axis], shift = plans_[s].shift[axis];
        const auto convert_all = [&](auto convert_one) {
            double least = 0.0, most = 0.0;
            for (size_t i = 0; i < in.size(); ++i) {
                const double quanta = convert_one(double(in[i]));
                least = std::min(least, quanta);
                most = std::max(most, quanta);
                out[i] = int32_t(std::clamp(quanta, kLeastQuanta, kMostQuanta));
            }
            return least >= kLeastQuanta && most <= kMostQuanta;
        };
        // Whole shifts are exact in double, and need no rounding.
        const bool held = ratio == 1.0 ? convert_all([&](double quanta) { return quanta + shift; })
                                       : convert_all([&](double quanta) { return std::round(quanta * ratio + shift); });
        if (!held)
            throw Error(ErrorKind::limit, names_[s] + ": points lie beyond what 32 bits hold at a scale of " +
                                              std::to_string(info_.quantization.scale[Eigen::Index(axis)]) +
                                              ", and beyond the bounds of the headers");
    }

    void convert_column(size_t s, const ColumnPlan& plan, PointBatch& batch, std::vector<std::byte>& out) const {
        if (plan.index < 0) std::fill(out.begin(), out.end(), std::byte{0});
        if (plan.conversion == Conversion::promote_flags) {
            if (plan.index >= 0) out = batch.columns[size_t(plan.index)];
            const std::vector<std::byte>& classes = batch.columns[size_t(plans_[s].old_class)];
            for (size_t i = 0; i < out.size(); ++i) out[i] |= std::byte(las::flags_of_class(uint8_t(classes[i])));
            return;
        }
        if (plan.index < 0) return;
        const std::vector<std::byte>& in = batch.columns[size_t(plan.index)];
        switch (plan.conversion) {
            case Conversion::absent:
            case Conversion::promote_flags:
            case Conversion::copy: std::copy(in.begin(), in.end(), out.begin()); break;
            case Conversion::widen_rgb: convert<uint16_t, uint16_t>(in, out, [](uint16_t channel) { return uint16_t(channel * 257); }); break;
            case Conversion::rank_to_angle:
                convert<int16_t, int8_t>(in, out, las::angle_of_rank);
                break;
            case Conversion::promote_class: convert<uint8_t, uint8_t>(in, out, las::promoted_class); break;
            case Conversion::to_double: convert_to_double(sources_[s]->info().attributes[size_t(plan.index)], in, out); break;
        }
    }

    std::vector<std::unique_ptr<PointSource>> sources_;
    std::vector<std::string> names_;
    std::vector<FileNote> file_notes_;           // in the order of the files that say them first
    std::map<std::string, size_t> note_places_;  // [text] in file_notes_
    std::map<std::string, bool> same_systems_;  // by text: whether it means info_.crs
    std::vector<SourcePlan> plans_;      // one a source
    std::vector<uint64_t> first_batch_;  // one a source, then the count of all
    CloudInfo info_;
};

}  // namespace

std::unique_ptr<PointSource> merge_sources(std::vector<std::unique_ptr<PointSource>> sources, std::vector<std::string> names) {
    return std::make_unique<MergedSource>(std::move(sources), std::move(names));
}

}  // namespace strata
