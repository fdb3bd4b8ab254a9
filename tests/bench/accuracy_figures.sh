#!/usr/bin/env bash
# tests/bench/accuracy_figures.sh [PROGRAM]: writes results/accuracy.md and its plots again: what accuracy costs, of
# grown scenes and, with STIPPLE_DATA, of real data. Half an hour of an idle machine. STUDIES=FOLDER makes the studies
# there, one a scene, and keeps them: the same command goes on where it was stopped. SCENES=WORDS: only these.
# OPTIONS=...: of `stipple study`, for less or more than that; the page says what it is of. PAGE=accuracy-WORD: where it
# is not to take the place of accuracy.md (another machine or device).
set -euo pipefail
page=${PAGE:-accuracy}
[[ $page =~ ^accuracy[-a-z0-9]*$ ]] || { echo "PAGE=$page: the name of a page is accuracy-WORD" >&2; exit 2; }
here=$(realpath "$(dirname "${BASH_SOURCE[0]}")")
source "$here/common.sh"
studies=$(realpath -m "${STUDIES:-$work/studies}")
mkdir -p "$studies"
cd "$studies"
export XDG_CACHE_HOME=$studies/cache
made=()
# study NAME INPUT [options]: all modes, unless they say otherwise
study() {
    local name=$1 input=$2
    shift 2
    [[ -z ${SCENES:-} || " $SCENES " == *" $name "* ]] || return 0
    "$program" study "$input" -o "of-$name" --quick --resident 2G --quiet ${OPTIONS:-} "$@" >/dev/null
    made+=("of-$name")
}
real() { # NAME FILE: the file under a name that says what it is
    [ -n "$data" ] && ln -sfn "$data/$2" "$1"
}
[ -e grove.las ] || "$program" grow scan -o grove.las --points 2M >/dev/null
[ -e oak.glb ] || "$program" grow tree -o oak.glb --leaves 50k >/dev/null
[ -e demo ] || "$program" grow demo -o demo >/dev/null
# (Modes are ways of drawing points: of what has none one shows all.)
if real bunny.ply 01_meshes/bunny/bun_zipper.ply; then
    study bunny bunny.ply --modes surface
fi
study oak oak.glb --modes surface
study grove grove.las
if real outcrop.laz 02_scans/outcrop_rgb_cloudcompare/example_data.laz; then
    study outcrop outcrop.laz
    real huacayccancha 02_scans/utm_huacayccancha_potree_laz_rgb_cc0/pointclouds/index
    study huacayccancha huacayccancha
    gunzip -c "$data/05_tubes/streamlines_niivue/stroke.trk.gz" >stroke.trk
    study stroke stroke.trk --modes surface
fi
study demo demo/demo.glb
python3 "$here/accuracy_tables.py" "${made[@]}" "$here/results" "$page"
