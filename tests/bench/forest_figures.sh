#!/usr/bin/env bash
# tests/bench/forest_figures.sh [PROGRAM]: the figures of forests and of converted plants as Markdown, with the command of
# each. Needs an idle machine, about four minutes and 2 GB of disk.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scenes=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../scenes")
cd "$work"
export XDG_CACHE_HOME=$work/cache
difference() { "$program" compare "$1" "$2" | tr '\n' ' ' | sed 's/, largest[^,]*//; s/ $//'; }
cover() { python3 - "$1" <<'P'
import struct, sys, zlib
d = open(sys.argv[1], 'rb').read()
w, h = struct.unpack('>II', d[16:24])
at, data = 8, b''
while at < len(d):
    n, kind = struct.unpack('>I4s', d[at:at + 8])
    if kind == b'IDAT': data += d[at + 8:at + 8 + n]
    at += 12 + n
raw, bpp, prev, total = zlib.decompress(data), 4, bytearray(4 * w), 0
for y in range(h):
    f, row = raw[y * (4 * w + 1)], bytearray(raw[y * (4 * w + 1) + 1:(y + 1) * (4 * w + 1)])
    for i in range(4 * w):
        a, b, c = (row[i - 4] if i >= 4 else 0), prev[i], (prev[i - 4] if i >= 4 else 0)
        p = a + b - c
        row[i] = (row[i] + [0, a, b, (a + b) // 2, min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]][f]) & 255
    total += sum(row[3::4])
    prev = row
print('%.0f' % (total / 255))
P
}

echo "# Figures of forests, $(date +%F)"
echo
echo "Machine: $(machine). Medians. 1920x1080, cpu backend."
echo
echo '| what | figure | command |'
echo '|---|---|---|'
frame='"%.0f ms (p95 %.0f): " % (d["frame_ms"]["median"], d["frame_ms"]["p95"]) + ", ".join("%s %.1f" % (p["name"], p["ms"]) for p in d["passes"]) + "; %.1fM records, cut %.1f ms, delivered %.2f px, resident %.0f MB, peak %.0f MB" % (d["records_drawn"]/1e6, d["counters"]["cut_ms"], d["tau_eff_px"], d["resident_bytes"]/1e6, d["peak_rss_bytes"]/1e6)'
"$program" grow forest -o forest.glb --trees 100k --leaves 200k >/dev/null
json first render forest.glb -o f.png --size 64x64
row "100,000 trees: first picture, all levels built" "$(value first.json '"%.0f s, peak %.0f MB" % (d["first_image_ms"]/1e3, d["peak_rss_bytes"]/1e6)')" "stipple grow forest -o forest.glb --trees 100k --leaves 200k; stipple render forest.glb -o f.png --json"
json first render forest.glb -o f.png --size 64x64
row "the same from the cache" "$(value first.json '"%.1f s, peak %.0f MB" % (d["first_image_ms"]/1e3, d["peak_rss_bytes"]/1e6)')" "the same again"
view='--size 1920x1080 --device cpu --frames 20'
for tau in 1 2 4; do
    json render render forest.glb -o p.png --size 1920x1080 --device cpu --camera-path "$scenes/forest_path.json" --frames 40 --error $tau
    row "path from 1 km to 10 cm, $tau px" "$(value render.json "$frame")" "stipple render forest.glb -o p.png --size 1920x1080 --camera-path tests/scenes/forest_path.json --frames 40 --error $tau --json"
    while read -r what where; do
        json render render forest.glb -o f.png $view $where --error $tau
        row "$what, $tau px" "$(value render.json "$frame")" "stipple render forest.glb -o f.png $view $where --error $tau --json"
    done <<'VIEWS'
from_afar --eye=0,120,1400 --target=0,0,0 --fov=60
over_the_crowns --eye=0,30,200 --target=0,10,0 --fov=60
in_the_clearing --eye=0,1.8,14 --target=0,6,-40 --fov=60
VIEWS
done
for as in triangles curves; do "$program" grow tree -o $as.glb --leaves 50k --as $as >/dev/null; done
"$program" convert triangles.glb --curves -o converted.glb --json >convert.json
row "a polygon oak of 566k triangles to curves" "$(value convert.json '"%.1f s; %d ribbons, %d tubes, %d triangles left; %.1f mm off on average, %.1f mm for 95 %%" % (d["seconds"], d["ribbons"], d["tubes"], d["triangles_left"], 1e3*d["deviation"]["mean"], 1e3*d["deviation"]["p95"])')" "stipple grow tree -o t.glb --leaves 50k --as triangles; stipple convert t.glb --curves -o c.glb --json"
for distance in 6 40; do
    where="--size 1920x1080 --eye=0,5,$distance --target=0,5,0"
    "$program" render triangles.glb -o truth.png --alpha $where --mode reference --samples 3 --quiet
    "$program" render converted.glb -o traced.png --alpha $where --mode reference --samples 3 --quiet
    row "its cover at $distance m, traced" "$(python3 -c "print('%+.2f %%' % (100 * ($(cover traced.png) / $(cover truth.png) - 1)))")" "both with --mode reference --samples 3"
    for plant in triangles converted; do
        for tau in 0.5 2; do
            json render render $plant.glb -o a.png --alpha $where --device cpu --error $tau --frames 20
            row "$plant at $distance m, $tau px, against traced triangles" "$(value render.json '"%.1f ms: " % d["frame_ms"]["median"]')$(difference a.png truth.png); cover $(python3 -c "print('%+.2f %%' % (100 * ($(cover a.png) / $(cover truth.png) - 1)))")" "stipple render $plant.glb -o a.png $where --error $tau --frames 20 --json; stipple compare"
        done
    done
done
