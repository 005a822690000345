// Damaged volume files, seeded: small MetaImage, NRRD and VTK files, mutated where it hurts, which is their header.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string_view>

#include "tests/robust/fault.h"
#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

constexpr int kFullCases = 2000;

class Mutator {
public:
    explicit Mutator(uint64_t seed) : random_(seed) {}

    std::string damaged_file() {
        std::string bytes = whole_file();
        for (uint64_t n = 1 + below(3); n > 0; --n) mutate(bytes);
        return bytes;
    }

private:
    uint64_t below(uint64_t n) { return random_() % n; }

    // A blob in 6 x 5 x 4 samples of 16 bits.
    std::string whole_file() {
        std::string samples, text;
        for (int i = 0; i < 120; ++i) {
            const int x = i % 6, y = i / 6 % 5, z = i / 30, value = 12 - (x - 3) * (x - 3) - (y - 2) * (y - 2) - (z - 1) * (z - 1);
            samples += {char(value), char(value >> 8)};
            text += std::to_string(value) + ' ';
        }
        std::string deflated(compressBound(samples.size()), '\0');
        uLongf size = deflated.size();
        compress(reinterpret_cast<Bytef*>(deflated.data()), &size, reinterpret_cast<const Bytef*>(samples.data()), samples.size());
        deflated.resize(size);
        const std::string meta = "ObjectType = Image\nNDims = 3\nBinaryDataByteOrderMSB = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 1 1 2\nDimSize = 6 5 4\nElementType = MET_SHORT\n";
        const std::string nrrd = "NRRD0004\ntype: short\ndimension: 3\nsizes: 6 5 4\nspace directions: (1,0,0) (0,1,0) (0,0,2)\nspace origin: (1,2,3)\nendian: little\nkinds: domain domain domain\n";
        const std::string vtk = "DATASET STRUCTURED_POINTS\nDIMENSIONS 6 5 4\nSPACING 1 1 2\nORIGIN 1 2 3\nPOINT_DATA 120\nSCALARS s short 1\nLOOKUP_TABLE default\n";
        switch (below(7)) {
            case 0: return meta + "ElementDataFile = LOCAL\n" + samples;
            case 1: return meta + "CompressedData = True\nCompressedDataSize = " + std::to_string(deflated.size()) + "\nElementDataFile = LOCAL\n" + deflated;
            case 2: return meta + "BinaryData = False\nElementDataFile = LOCAL\n" + text;
            case 3: return nrrd + "encoding: raw\n\n" + samples;
            case 4: return nrrd + "encoding: gzip\n\n" + deflated;  // zlib's, which is read too
            case 5: return nrrd + "encoding: ascii\n\n" + text;
            default: return "# vtk DataFile Version 3.0\ntitle\nASCII\n" + vtk + text;
        }
    }

    void mutate(std::string& bytes) {
        if (bytes.empty()) return;
        const size_t at = size_t(below(below(5) ? std::min<size_t>(bytes.size(), 320) : bytes.size()));
        constexpr std::string_view kMarks = "0123456789.-+e \n\r:=(),TF%/";
        switch (below(7)) {
            case 0: bytes[at] = char(bytes[at] ^ 1 << below(8)); break;
            case 1: bytes[at] = kMarks[below(kMarks.size())]; break;
            case 2: bytes.resize(at); break;
            case 3:
            case 4: {  // a number of the header becomes another
                const size_t digit = bytes.find_first_of("0123456789", at);
                if (digit == std::string::npos) break;
                const size_t end = std::min(bytes.find_first_not_of("0123456789.", digit), bytes.size());
                constexpr std::array<const char*, 16> kNumbers = {"0", "-1", "1", "2", "7", "1e308", "1e-320", "nan", "inf", "4294967295", "4294967296", "18446744073709551615", "99999999999999999999", "0.5", "none", "True"};
                bytes.replace(digit, end - digit, kNumbers[below(kNumbers.size())]);
                break;
            }
            case 5: bytes.erase(at, size_t(below(40))); break;
            case 6: bytes.insert(size_t(below(bytes.size())), bytes.substr(at, size_t(below(40)))); break;
        }
    }

    std::mt19937_64 random_;
};

// Whether as many samples as were said can be in the file.
std::string verdict_of_info(const test::ProgramResult& result, const TemporaryFolder& folder) {
    const std::string path = folder.file("volume.nrrd");
    if (result.exit_code != 0) return result.err.starts_with("strata: " + path + ": ") ? "" : "the file is not named: " + result.err;
    const nlohmann::json report = nlohmann::json::parse(result.out, nullptr, false);
    if (report.is_discarded() || !report.contains("dimensions")) return "wrong result: " + result.out;
    double samples = 1.0;
    for (const nlohmann::json& size : report["dimensions"]) samples *= size.get<double>();
    const bool raw = report["encoding"].get<std::string>().starts_with("raw");
    const double most = raw ? double(std::filesystem::file_size(path)) : 1032.0 * double(std::filesystem::file_size(path));
    if (!(samples <= most)) return "wrong-accept: " + result.out;
    for (const nlohmann::json& step : report["spacing"])
        if (!step.is_number() || !(step.get<double>() > 0.0)) return "wrong-accept: " + result.out;
    return "";
}

// A mesh that is whole, or none.
std::string verdict_of_surface(const test::ProgramResult& result, const TemporaryFolder& folder) {
    const std::string path = folder.file("volume.nrrd"), out = folder.file("out.ply");
    if (result.exit_code != 0) {
        if (test::entries(folder.path()) != 1) return "partial-output";
        return result.err.starts_with("strata: " + path) ? "" : "the file is not named: " + result.err;
    }
    return test::entries(folder.path()) == 2 && test::file_contents(out).starts_with("ply\n") ? "" : "no output";
}

}  // namespace

std::vector<FaultCase> damaged_volumes(bool full) {
    std::vector<FaultCase> cases;
    for (int seed = 0; seed < (full ? kFullCases : kFullCases / 10); ++seed) {
        const bool surface = seed % 2 != 0;
        cases.push_back({"seed " + std::to_string(seed),
                         [seed, surface](const TemporaryFolder& folder) -> std::vector<std::string> {
                             const std::string path = folder.file("volume.nrrd");
                             std::ofstream(path, std::ios::binary) << Mutator(uint64_t(seed)).damaged_file();
                             if (surface) return {"surface", path, "-o", folder.file("out.ply"), "--iso", "5", "--quiet", "--no-sync", "--threads", "2", "--memory", "256M"};
                             return {"info", "--json", path};
                         },
                         surface ? verdict_of_surface : verdict_of_info});
    }
    return cases;
}

}  // namespace strata::robust
