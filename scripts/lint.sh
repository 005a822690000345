#!/usr/bin/env bash
# Checks the format of every source, and with --tidy runs clang-tidy too (minutes; not part of CI).
#   scripts/lint.sh            names the files that clang-format would change
#   scripts/lint.sh --fix      changes them
#   scripts/lint.sh --tidy [FILE...]
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/packages.sh
install_packages "${packages_strata[@]}" "${packages_lint[@]}"

mapfile -t sources < <(git ls-files '*.cpp' '*.h' '*.c')
case "${1:-}" in
    --fix) clang-format -i "${sources[@]}" ;;
    --tidy)
        shift
        [ $# -gt 0 ] || mapfile -t files < <(git ls-files 'core/*.cpp' 'io/*.cpp' 'render/*.cpp' 'app/*.cpp')
        cmake --preset release --log-level=WARNING >/dev/null
        printf '%s\0' "${@:-${files[@]}}" | xargs -0 -n 1 -P "$(nproc)" clang-tidy --quiet -p build/release
        ;;
    *) clang-format --dry-run --Werror "${sources[@]}" && echo "the format of ${#sources[@]} files is right" ;;
esac
