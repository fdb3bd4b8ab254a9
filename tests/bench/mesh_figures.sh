#!/usr/bin/env bash
# tests/bench/mesh_figures.sh [PROGRAM]: the figures of meshes as Markdown, with the command of each. Needs an idle
# machine and about five minutes; STIPPLE_DATA for the statue.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$work"
export XDG_CACHE_HOME=$work/cache
difference() { "$program" compare "$1" "$2" | tr '\n' ' ' | sed 's/, largest[^,]*//; s/ $//'; }

echo "# Figures of meshes, $(date +%F)"
echo
echo "Machine: $(machine). Medians. 1920x1080, cpu backend unless said."
echo
echo '| what | figure | command |'
echo '|---|---|---|'
frame='"%.1f ms (p95 %.1f): " % (d["frame_ms"]["median"], d["frame_ms"]["p95"]) + ", ".join("%s %.1f" % (p["name"], p["ms"]) for p in d["passes"]) + "; %.2fM triangles" % (d["triangles_drawn"]/1e6)'
build='"%.2f M triangles/s (%.1f s), peak %.0f MB, %.1f bytes a triangle with all levels; " % (d["points_per_second"]/1e6, d["seconds"], d["peak_rss_bytes"]/1e6, d["bytes_out"]/d["points_out"]) + ", ".join("%s %.1f s" % (k, v) for k, v in d["stage_seconds"].items())'
for spec in "rock 1M" "building 1M" "terrain 10M"; do
    set -- $spec
    "$program" grow "$1" -o "$1.glb" --triangles "$2" >/dev/null
    json build build "$1.glb" -o "$1.stipple" --quiet
    row "build of a $1, $2 triangles, textured" "$(value build.json "$build")" "stipple grow $1 -o $1.glb --triangles $2; stipple build $1.glb -o $1.stipple --json"
done
view='--size 1920x1080 --device cpu --frames 60'
for kind in rock building; do
    json render render $kind.stipple -o $kind.png $view --error 0.0001
    row "$kind of 1M triangles drawn in full, textured, lit" "$(value render.json "$frame")" "stipple render $kind.stipple -o f.png $view --error 0.0001 --json"
done
json render render rock.stipple -o f.png $view --error 0.0001 --shade unlit
row "the same rock, unlit" "$(value render.json "$frame")" "... --shade unlit"
for where in "" "--eye=-700,260,700 --target=0,80,0"; do
    json render render terrain.stipple -o terrain.png $view --error 1 $where
    row "terrain of 10M triangles at 1 px ${where:-as a whole}" "$(value render.json "$frame")" "stipple render terrain.stipple -o f.png $view --error 1 $where --json"
done
"$program" grow terrain -o plain.glb --triangles 10M --texture 0 >/dev/null
"$program" build plain.glb -o plain.stipple --quiet >/dev/null
for where in "" "--eye=-700,260,700 --target=0,80,0"; do
    json render render plain.stipple -o plain.png $view --error 1 $where
    row "the same without textures ${where:-as a whole}" "$(value render.json "$frame")" "stipple grow terrain ... --texture 0; as above"
done
small='--size 960x540'
for kind in rock building terrain; do
    "$program" render $kind.stipple -o o.png --alpha $small --device reference --quiet
    for device in cpu gpu:llvmpipe; do
        "$program" render $kind.stipple -o a.png --alpha $small --device $device --quiet 2>/dev/null || continue
        row "implementation error, $kind, $device against fp64, cut at 1 px" "$(difference a.png o.png)" "stipple render $kind.stipple -o a.png $small --device $device; ... --device reference; stipple compare"
    done
    "$program" render $kind.stipple -o full.png --alpha $small --device cpu --error 0.0001 --quiet
    for tau in 0.5 1 2 4; do
        "$program" render $kind.stipple -o a.png --alpha $small --device cpu --error $tau --json >r.json 2>/dev/null
        row "level-of-detail error, $kind, $tau px against all triangles" "$(value r.json '"%.0fk triangles: " % (d["triangles_drawn"]/1e3)')$(difference a.png full.png)" "stipple render $kind.stipple -o a.png $small --error $tau; ... --error 0.0001; stipple compare"
    done
done
if [ -n "$data" ] && [ -e "$data/01_meshes/stanford-dragon/dragon_vrip.ply.gz" ]; then
    gunzip -c "$data/01_meshes/stanford-dragon/dragon_vrip.ply.gz" >statue.ply
    "$program" build statue.ply -o mesh.stipple --quiet >/dev/null
    "$program" build statue.ply -o points.stipple --only-points --quiet >/dev/null
    # Normals instead of light: what is compared is the surface, not the shading model.
    "$program" render mesh.stipple -o truth.png --alpha --size 1920x1080 --device reference --error 0.0001 --debug normals --quiet
    for tau in 0.25 0.5 1 2 4 8; do
        for kind in mesh points; do
            json r render $kind.stipple -o a.png --alpha $view --error $tau --debug normals
            row "statue, $kind at $tau px: time, and normals against the full mesh (fp64)" "$(value r.json '"%.1f ms, %.0fk primitives: " % (d["frame_ms"]["median"], (d["triangles_drawn"]+d["records_drawn"])/1e3)')$(difference a.png truth.png)" "stipple render $kind.stipple -o a.png $view --error $tau --debug normals; stipple compare"
        done
    done
fi
