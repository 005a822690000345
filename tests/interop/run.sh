#!/bin/sh
# The interop test: a simulated scan, converted by strata, is opened by viewers and decoders that others wrote.
#   run.sh STRATA    the program. Exit 77: skipped, saying why
strata=$1
here=$(dirname "$0")
command -v node >/dev/null || { echo "skipped: no node"; exit 77; }

work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT INT TERM
set -e
"$strata" sample "$work/scan.las" --points 200000 --seed 7 --quiet
"$strata" convert "$work/scan.las" "$work/plain" --format potree --encoding default --quiet
"$strata" convert "$work/scan.las" "$work/brotli" --format potree --encoding brotli --quiet
"$strata" convert "$work/scan.las" "$work/scan.copc.laz" --quiet
"$strata" convert "$work/scan.las" "$work/scan.laz" --quiet
"$strata" convert "$work/scan.copc.laz" "$work/nodes.laz" --quiet
node "$here/check_laz.mjs" "$work/scan.las" "$work/scan.laz" "$work/nodes.laz" "$work/scan.copc.laz"
node "$here/check_potree.mjs" "$work/plain" "$work/brotli"
