#!/usr/bin/env bash
# tests/bench/build_figures.sh [PROGRAM]: the figures of out-of-core builds as Markdown, with the command of each. Needs an idle
# machine, about ten minutes and 20 GB of disk.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
bench=$(dirname "$program")/tests/stipple_bench
cd "$work"
stages='", ".join("%s %.2f" % (k, v) for k, v in d["stage_seconds"].items())'
report="\"%.2f s, peak %.0f MB, %.2f bytes a point, %.1f GB of temporary files; seconds: \" % (d['seconds'], d['peak_rss_bytes']/1e6, d['bytes_out']/d['points_out'], d['temporary_bytes']/1e9) + $stages"
median() { # median NAME COMMAND...: the run of three with the middle time
    local name=$1 i
    shift
    for i in 1 2 3; do json $name$i "$@"; done
    python3 -c "
import json
runs = sorted((json.load(open('$name%d.json' % i)) for i in (1, 2, 3)), key=lambda d: d['seconds'])
json.dump(runs[1], open('$name.json', 'w'))"
}
echo "# Figures of out-of-core builds, $(date +%F)"
echo
echo "Machine: $(machine). Medians of three. LAS, point format 2, a scan of several stations; warm page cache, output not synced."
echo
echo '| what | figure | command |'
echo '|---|---|---|'
scan() { # scan MILLIONS: made once; SCANS names a folder with such files
    if [ -e "${SCANS:-}/$1.las" ]; then ln -s "$SCANS/$1.las" "$1.las"; else "$program" grow scan -o "$1.las" --points "${1}000000" >/dev/null; fi
}
scan 10
floor=$(python3 - <<'P'
import time, os
def best(f):
    t = []
    for _ in range(3):
        a = time.time(); f(); t.append(time.time() - a)
    return min(t)
def read():
    with open('10.las', 'rb', buffering=0) as f:
        while f.read(1 << 20): pass
def write():
    with open('w', 'wb', buffering=0) as f:
        for _ in range(105): f.write(block)
block = bytes(1 << 20)
r, w = best(read), best(write)
print('read 260 MB %.2f s, write 105 MB %.2f s' % (r, w))
os.remove('w')
P
)
for options in "--normals none --radii keep" "--normals none" "--normals auto" "--normals fine"; do
    median build build 10.las -o s.stipple --memory 1G --quiet $options
    row "10M points, $options" "$(value build.json "$report")" "stipple build 10.las -o s.stipple --memory 1G $options --json"
done
row "floor of these: bytes over bandwidth (one core); a Morton sort is in 'load, sort'" "$floor" "cat 10.las; dd"
median one build 10.las -o s.stipple --memory 1G --quiet --threads 1
median two build 10.las -o s.stipple --memory 1G --quiet --threads 2
row "2 threads against 1" "$(python3 -c "
import json; a, b = (json.load(open(n + '.json'))['seconds'] for n in ('one', 'two')); print('%.2f x (%.2f s, %.2f s)' % (a / b, a, b))")" "stipple build 10.las -o s.stipple --threads 1 | 2"
[ ! -x "$bench" ] || { "$bench" --benchmark_filter=Decode --benchmark_format=json >decode.json 2>/dev/null
    row "decode, one core" "$(value decode.json "'%.0f M records/s' % (d['benchmarks'][0]['items_per_second']/1e6)")" "build/tests/stipple_bench --benchmark_filter=Decode"; }
scan 50
for options in "--normals none --radii keep" "--normals auto"; do
    median build build 50.las -o s.stipple --memory 1G --quiet $options
    row "50M points, $options" "$(value build.json "$report")" "stipple build 50.las -o s.stipple --memory 1G $options --json"
done
# Five tiles of 50M points side by side: the same records, another offset in the header.
for tile in 1 2 3 4; do
    cp 50.las tile$tile.las
    python3 - tile$tile.las $tile <<'P'
import struct, sys
with open(sys.argv[1], 'r+b') as f:
    f.seek(155); x = struct.unpack('<d', f.read(8))[0]
    f.seek(155); f.write(struct.pack('<d', x + 200.0 * int(sys.argv[2])))
    f.seek(179); hi, lo = struct.unpack('<dd', f.read(16))
    f.seek(179); f.write(struct.pack('<dd', hi + 200.0 * int(sys.argv[2]), lo + 200.0 * int(sys.argv[2])))
P
done
json build build 50.las tile1.las tile2.las tile3.las tile4.las -o s.stipple --memory 1G --quiet
row "250M points in five tiles, normals auto (once)" "$(value build.json "$report")" "stipple build 50.las tile1.las ... -o s.stipple --memory 1G --json"
