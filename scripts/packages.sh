# The one list of Debian packages, by what needs them; sourced by the other scripts.
# Ubuntu 24.04 has the same names, but for clang-16 (clang-18 there) and chromium (a snap there); it is untested.

# Building and running `strata`.
packages_strata=(
    g++ cmake ninja-build ccache pkg-config
    libcli11-dev libeigen3-dev libtbb-dev
    libbrotli-dev libpng-dev libdraco-dev nlohmann-json3-dev
    libproj-dev libgeotiff-dev libblosc-dev libopenvdb-dev
    libepoxy-dev libegl-dev libgl1-mesa-dri
)
# Building and running the tests: locales-all because a locale test cannot fail without other locales.
packages_tests=(libgtest-dev libbenchmark-dev libflann-dev liblz4-dev libtinygltf-dev strace locales-all)
packages_fuzz=(clang-16 libclang-rt-16-dev)
# Opening our output in viewers that others wrote. Where node comes from elsewhere, it stays.
packages_interop=(chromium)
command -v node >/dev/null || packages_interop+=(nodejs)
command -v npm >/dev/null || packages_interop+=(npm)
# scripts/lint.sh only.
packages_lint=(clang-format clang-tidy)

if [ -r /etc/os-release ] && grep -q '^ID=ubuntu' /etc/os-release; then
    packages_fuzz=(clang-18 libclang-rt-18-dev)
    packages_interop=("${packages_interop[@]/chromium/}")  # a snap, which a headless machine seldom has
fi

# install_packages NAME... : installs those that are missing, and never removes any. Does nothing when all are there.
install_packages() {
    local name missing=()
    local installed
    installed=" $(dpkg-query -W -f='${db:Status-Abbrev}${Package} ' "$@" 2>/dev/null || true) "  # it fails on names it never saw
    for name in "$@"; do
        [ -n "$name" ] && [[ "$installed" != *" ii $name "* && "$installed" != *" hi $name "* ]] && missing+=("$name")
    done
    [ ${#missing[@]} -eq 0 ] && return 0

    if ! command -v apt-get >/dev/null; then
        echo "apt-get is not here; install these by hand: ${missing[*]}" >&2
        return 1
    fi
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "neither root nor sudo; ask an administrator for: apt-get install ${missing[*]}" >&2
            return 1
        fi
        as_root=(sudo)
    fi
    echo "== installing ${#missing[@]} packages with ${as_root[*]:+sudo }apt-get (none is removed): ${missing[*]}"
    # A list that cannot be fetched is no failure yet: the packages may all be in another.
    "${as_root[@]}" apt-get -qq update || true
    local log
    log=$(mktemp)
    if ! "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get -o Dpkg::Use-Pty=0 install -y --no-install-recommends --no-remove "${missing[@]}" >"$log" 2>&1; then
        tail -n 40 "$log" >&2
        rm -f "$log"
        return 1
    fi
    rm -f "$log"
}
