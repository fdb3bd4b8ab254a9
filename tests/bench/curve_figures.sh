#!/usr/bin/env bash
# tests/bench/curve_figures.sh [PROGRAM]: the figures of ribbons and tubes as Markdown, with the command of each. Needs
# an idle machine, about two minutes, and STIPPLE_DATA.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$work"
export XDG_CACHE_HOME=$work/cache
difference() { "$program" compare "$1" "$2" | tr '\n' ' ' | sed 's/, largest[^,]*//; s/ $//'; }
if [ -z "$data" ]; then echo "set STIPPLE_DATA" >&2; exit 1; fi

echo "# Figures of ribbons and tubes, $(date +%F)"
echo
echo "Machine: $(machine). Medians. 1920x1080, cpu backend unless said."
echo
echo '| what | figure | command |'
echo '|---|---|---|'
frame='"%.1f ms (p95 %.1f): " % (d["frame_ms"]["median"], d["frame_ms"]["p95"]) + ", ".join("%s %.1f" % (p["name"], p["ms"]) for p in d["passes"]) + "; %.0fk segments" % (d["records_drawn"]/1e3)'
build='"%.2f M segments/s (%.2f s), peak %.0f MB, %.1f bytes a segment with all levels" % (d["points_per_second"]/1e6, d["seconds"], d["peak_rss_bytes"]/1e6, d["bytes_out"]/d["points_out"])'
gunzip -c "$data/05_tubes/streamlines_niivue/stroke.trk.gz" >lines.trk
cp "$data/05_tubes/hair/fur.hair" fur.hair
cp "$data/05_tubes/qsm/Tree_1_TreeQSM.txt" tree.txt
for file in lines.trk fur.hair; do
    json build build $file -o $file.stipple --quiet
    row "build of $file" "$(value build.json "$build")" "stipple build $file -o $file.stipple --json"
done
"$program" build tree.txt -o tree.txt.stipple --quiet >/dev/null
view='--size 1920x1080 --device cpu --frames 60'
while read -r file what where; do
    json render render $file.stipple -o f.png $view $where
    row "$file, $what" "$(value render.json "$frame")" "stipple render $file.stipple -o f.png $view $where --json"
done <<'VIEWS'
lines.trk whole
lines.trk close --eye=0,-260,0 --target=0,0,0 --fov=40
lines.trk within --eye=0,-90,20 --target=0,0,0 --fov=60
fur.hair whole
fur.hair close --eye=0.3,0.3,4 --target=0,0,0 --fov=40
fur.hair within --eye=0.2,0.2,1.7 --target=0,0.1,0 --fov=60
VIEWS
for rows in 1 3; do
    for as in curves triangles; do
        if [ $rows = 1 ]; then grown="tree"; else grown="orchard --rows $rows"; fi
        "$program" grow $grown -o plant.glb --leaves 200k --as $as >/dev/null
        for tau in 1 2; do
            json render render plant.glb -o plant.png $view --error $tau --resident 4G
            row "$((rows * rows)) oaks of 200k leaves as $as, $tau px" "$(value render.json '"%.1f ms; %.2fM segments, %.2fM triangles" % (d["frame_ms"]["median"], d["records_drawn"]/1e6, d["triangles_drawn"]/1e6)')" "stipple grow $grown -o plant.glb --leaves 200k --as $as; stipple render plant.glb -o f.png $view --error $tau --json"
        done
    done
done
near='--eye=0,15,3.5 --target=4.4,19.4,4 --fov=40 --size 900x700'
"$program" render tree.txt.stipple -o truth.png --alpha $near --mode reference --quiet
for exact in 2 4 8 1e9; do
    json render render tree.txt.stipple -o a.png --alpha $near --device cpu --error 0.01 --curve-exact $exact --frames 30
    row "accuracy of a trunk against traced rays, curves filled from $exact px on" "$(value render.json '"%.1f ms: " % d["frame_ms"]["median"]')$(difference a.png truth.png)" "stipple render tree.txt.stipple -o a.png $near --curve-exact $exact; ... --mode reference; stipple compare"
done
for file in lines.trk fur.hair tree.txt; do
    "$program" render $file.stipple -o o.png --alpha --size 960x540 --device reference --quiet
    for device in cpu gpu:llvmpipe; do
        "$program" render $file.stipple -o a.png --alpha --size 960x540 --device $device --quiet 2>/dev/null || continue
        row "implementation error, $file, $device against fp64, cut at 1 px" "$(difference a.png o.png)" "stipple render $file.stipple -o a.png --size 960x540 --device $device; ... --device reference; stipple compare"
    done
done
