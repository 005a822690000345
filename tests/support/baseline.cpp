#include "tests/support/baseline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata::test {

namespace fs = std::filesystem;

void expect_baseline(const std::string& name, std::vector<std::string> words) {
    const TemporaryFolder folder;
    words.insert(words.begin(), "render");
    if (std::find(words.begin(), words.end(), "--size") == words.end()) words.insert(words.end(), {"--size", "320x200"});
    words.insert(words.end(), {"-o", folder.file(name + ".png"), "--reference", STRATA_SOURCE_DIR "/tests/baselines/" + name + ".png", "--threshold", "2"});
    const ProgramResult result = run_strata(words);
    EXPECT_EQ(result.exit_code, 0) << name << ": " << result.err;
    if (result.exit_code == 0) return;
    for (const std::string& kept : {name + ".png", name + ".difference.png"})
        if (fs::exists(folder.file(kept))) fs::copy_file(folder.file(kept), kept, fs::copy_options::overwrite_existing);
}

}  // namespace strata::test
