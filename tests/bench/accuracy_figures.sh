#!/usr/bin/env bash
# tests/bench/accuracy_figures.sh [PROGRAM]: writes results/accuracy.md and its plots again: what accuracy costs, of the
# grown scenes and, with STIPPLE_DATA, of real data. Ten minutes of an idle machine. STUDY=FOLDER takes a study that is
# there already.
set -euo pipefail
here=$(realpath "$(dirname "${BASH_SOURCE[0]}")")
source "$here/common.sh"
study=${STUDY:-}
if [ -z "$study" ]; then
    study=$work/accuracy
    cd "$work"
    export XDG_CACHE_HOME=$work/cache
    "$program" grow demo -o demo >/dev/null
    "$program" grow scan -o grove.las --points 2M >/dev/null
    scenes=(demo/demo.glb grove.las)
    if [ -n "$data" ]; then
        cp "$data/01_meshes/bunny/bun_zipper.ply" bunny.ply
        cp "$data/02_scans/outcrop_rgb_cloudcompare/example_data.laz" outcrop.laz
        scenes+=(bunny.ply outcrop.laz)
    fi
    "$program" study "${scenes[@]}" -o "$study" --quick --blocks 3 --resident 3G >/dev/null
fi
python3 "$here/accuracy_tables.py" "$study" "$here/results"
