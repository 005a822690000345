#!/usr/bin/env bash
# From a fresh Debian 12 to pictures: installs what is needed, builds, makes a scan, converts it, renders it.
# Everything lands in demo/; run again, it skips what is there already.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/packages.sh

install_packages "${packages_strata[@]}"
scripts/build.sh release -- strata
strata=build/release/strata

mkdir -p demo
if [ ! -e demo/village.las ]; then
    echo "== scanning a simulated village"
    "$strata" sample demo/village.las --points 4000000 --mode both --overwrite
fi
if [ ! -e demo/village/metadata.json ] || [ demo/village.las -nt demo/village/metadata.json ]; then
    echo "== building its levels of detail"
    "$strata" convert demo/village.las demo/village --overwrite
fi

echo "== taking pictures"
picture() {
    "$strata" render demo/village --quiet --overwrite -o "demo/$1" "${@:2}"
    echo "   demo/$1"
}
picture village.png                                                          # the whole, in its colors
picture church.png --eye 548055,5327930,488 --target 548000,5328010,468      # from a camera of our own
picture elevation.png --color elevation
picture classes.png --view top --ortho --color classification                # a map, with its world file

cat <<END

Done. Look at the pictures in $PWD/demo, then try:
  $strata info demo/village
  $strata render demo/village -o demo/mine.png --view left --color lod
  $strata convert YOUR_SCAN.las demo/your_scan && $strata render demo/your_scan -o demo/your_scan.png
END
