#!/usr/bin/env bash
# Times conversion and the first picture as whole processes, beside copying the same bytes, and prints a Markdown table.
# usage: convert_bench.sh STRATA FOLDER [MILLIONS_OF_POINTS...]   (default: 10 50; FOLDER takes 4 x the largest cloud)
# PEER=/path/to/PotreeConverter adds that program to the same run; RUNS=3 runs of each, medians shown;
# CAP=1G is the memory cap; LAS=file times that file instead of a simulated scan.
set -euo pipefail
strata=$1 folder=$2
shift 2
runs=${RUNS:-3} cap=${CAP:-1G}
mkdir -p "$folder"

# run NAME COMMAND...: wall, processor and memory of the run with the median wall time.
run() {
    local name=$1
    shift
    local results=()
    for _ in $(seq "$runs"); do
        results+=("$( { /usr/bin/time -f '%e %U %S %M' "$@" >/dev/null 2>"$folder/log"; tail -1 "$folder/log"; } )")
    done
    printf '%s\n' "${results[@]}" | sort -n | sed -n "$(((runs + 1) / 2))p" | {
        read -r wall user system memory
        awk -v n="$name" -v p="$points" -v w="$wall" -v u="$user" -v s="$system" -v m="$memory" -v b="$(size_of_output)" 'BEGIN {
            printf "| %s | %.2f | %.2f | %.2f | %.0f | %s |\n", n, w, u + s, p / w / 1e6, m / 1024, b }'
    }
}

size_of_output() {
    if [ -e "$folder/out/octree.bin" ]; then
        awk -v b="$(stat -c %s "$folder/out/octree.bin")" -v p="$points" 'BEGIN { printf "%.2f", b / p }'
    else
        echo -
    fi
}

echo "$(grep -m1 'model name' /proc/cpuinfo | cut -d: -f2 | xargs), $(nproc) threads, $(free -g | awk '/Mem:/ { print $2 }') GiB; medians of $runs, warm page cache"
for millions in "${@:-10}"; do
    points=$((millions * 1000000))
    input=${LAS:-$folder/$millions.las}
    [ -e "$input" ] || "$strata" sample "$input" --points "$points" --mode airborne --quiet
    cat "$input" >/dev/null
    echo
    echo "| $millions M points, $(stat -c %s "$input" | awk '{ printf "%.2f GB", $1 / 1e9 }') | wall s | processor s | M points/s | peak MiB | bytes/point |"
    echo "|---|---|---|---|---|---|"
    rm -rf "$folder/out"
    run "read the input (cat)" cat "$input"
    run "copy the input, synced (dd conv=fsync)" dd if="$input" of="$folder/copy" bs=8M conv=fsync
    rm -f "$folder/copy"
    run "strata, DEFAULT, not synced" "$strata" convert "$input" "$folder/out" --overwrite --quiet --no-sync --memory "$cap"
    run "strata, DEFAULT" "$strata" convert "$input" "$folder/out" --overwrite --quiet --memory "$cap"
    run "strata, first picture 1920x1080" "$strata" render "$folder/out" -o "$folder/shot.png" --overwrite
    for quality in ${QUALITIES:-1 2 3 5}; do
        run "strata, BROTLI quality $quality, not synced" "$strata" convert "$input" "$folder/out" --overwrite --quiet --no-sync \
            --memory "$cap" --encoding brotli --quality "$quality"
    done
    if [ -n "${PEER:-}" ]; then
        for encoding in DEFAULT BROTLI; do
            rm -rf "$folder/out"
            run "PotreeConverter, $encoding (never syncs)" "$PEER" "$input" -o "$folder/out" --encoding "$encoding"
        done
    fi
    rm -rf "$folder/out"
done
