#!/usr/bin/env bash
# Installs every package, builds everything and runs every test; ctest's own summary comes last.
#   scripts/test.sh            Release, warnings are errors, all tests
#   scripts/test.sh --asan     core, io and the kept fuzz inputs under address and undefined-behaviour sanitizers
#   scripts/test.sh --tsan     core and io under the thread sanitizer
# Words after that go to ctest: scripts/test.sh -R render
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/packages.sh

preset=release
case "${1:-}" in
    --asan | --tsan) preset=${1#--}; shift ;;
    --help | -h) sed -n '2,6s/^# \?//p' "$0"; exit ;;
esac

install_packages "${packages_strata[@]}" "${packages_tests[@]}" "${packages_fuzz[@]}" "${packages_interop[@]}"

# The sanitized builds run what reads files and what runs in threads; GL drivers are not instrumented.
if [ "$preset" = release ]; then
    scripts/build.sh release -DSTRATA_WERROR=ON -DSTRATA_TESTS=ON
    if [ -f tests/interop/package-lock.json ] && [ ! -e tests/interop/node_modules/.package-lock.json ]; then
        echo "== fetching what the interop test needs"
        (cd tests/interop && npm ci --silent --no-fund --no-audit) || echo "npm ci failed: the interop test will say that it is skipped"
    fi
else
    scripts/build.sh "$preset" -DSTRATA_WERROR=ON -DSTRATA_TESTS=ON -- sanitized_tests
    set -- -L sanitized "$@"
fi

echo "== testing $preset"
ctest --test-dir "build/$preset" --output-on-failure --no-tests=error --parallel "$(nproc)" "$@"
