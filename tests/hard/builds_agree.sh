#!/usr/bin/env bash
# tests/hard/builds_agree.sh PROGRAM OTHER: two builds of the program (Release, Debug, another compiler) make the same
# stores, byte by byte, whatever the number of threads and the order of the input, and pictures alike: in every mode at
# least 60 dB, and on every instruction set of this machine. Part of ./test --full. Exit code 1: something differs.
set -u
program=$(realpath "$1") other=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 2
export XDG_CACHE_HOME=$work/cache
status=0
complain() {
    echo "$1"
    status=1
}

"$program" grow scan -o scan.las --points 30k >/dev/null 2>&1 && "$program" grow demo -o demo >/dev/null 2>&1 || exit 2
for of in scan.las; do
    "$program" build $of -o a.stipple --quiet --threads 1 || exit 2
    for threads in 1 3; do
        "$other" build $of -o b.stipple --quiet --threads $threads || exit 2
        cmp -s a.stipple b.stipple || complain "$of: stores differ with $threads threads"
    done
done
modes=$("$program" render --help | grep -oE 'surface|pullpush-exact|pullpush|points|splat|ewa' | sort -u)
for mode in $modes; do
    STIPPLE_SIMD=sse "$program" render a.stipple -o "$mode.png" --mode "$mode" --size 320x200 --device cpu --quiet || exit 2
    for simd in sse avx2 avx512; do
        grep -q "${simd/sse/sse2}" /proc/cpuinfo || continue
        STIPPLE_SIMD=$simd "$other" render a.stipple -o other.png --mode "$mode" --size 320x200 --device cpu --quiet || exit 2
        decibels=$("$program" compare "$mode.png" other.png --json | python3 -c '
import json, sys
d = json.load(sys.stdin)["psnr"]
print(999 if d is None or d == "inf" else d)') || exit 2
        python3 -c "import sys; sys.exit(not $decibels >= 60)" || complain "$mode on $simd: $decibels dB"
    done
done
# The control: it would see another picture.
"$other" render a.stipple -o other.png --mode points --size 320x200 --device cpu --quiet
cmp -s surface.png other.png && complain "the pictures of two modes are the same: this script sees nothing"
[ $status -eq 0 ] && echo "the two builds agree"
exit $status
