#!/usr/bin/env bash
# Pictures with and without each effect, and what `--json` says of it, into tests/bench/results/effects.
#
#   effect_pictures.sh PROGRAM [FOLDER]      FOLDER: for what is grown (default: a temporary one)
program=$(realpath "$1") || exit 2
here=$(cd "$(dirname "$0")" && pwd)/results/effects
folder=${2:-$(mktemp -d)}
mkdir -p "$folder" "$here" && cd "$folder" || exit 2
[ -f scan.las ] || "$program" grow scan -o scan.las --points 1M >/dev/null || exit 1
[ -f house.glb ] || "$program" grow building -o house.glb --triangles 20k --texture 64 >/dev/null || exit 1
[ -f forest.glb ] || "$program" grow forest -o forest.glb --trees 2k >/dev/null || exit 1
shot() {  # NAME INPUT OPTIONS...
    local name=$1 input=$2
    shift 2
    # shellcheck disable=SC2086
    "$program" render "$input" -o "$here/$name.png" --force --quiet --size 480x270 --device cpu "$@" || exit 1
    echo "$name: $input $*"
}
wood="--error 1 --eye 0,14,-60 --target 30,6,60"  # from among the crowns
shot edl-off scan.las --shade unlit --up z
shot edl-on scan.las --shade unlit --up z --effects edl
shot edl-scales scan.las --shade unlit --up z --effects edl --set edl.scales=3 --set edl.radius=2
shot fog-off forest.glb $wood
shot fog-on forest.glb $wood --set fog.density=0.02 --set fog.height=15 --set fog.colour=178,190,205
shot fog-air forest.glb $wood --set fog.density=0.006 --set fog.kind=air --set fog.colour=150,180,225
shot tone-off forest.glb $wood
shot tone-bright forest.glb $wood --set tone.exposure=2
shot tone-filmic forest.glb $wood --set tone.exposure=2 --set tone.curve=filmic
shot shadow-off forest.glb $wood --effects none --sun 135,35
shot shadow-on forest.glb $wood --sun 135,35
shot shadow-soft forest.glb $wood --sun 135,35 --sun-size 3
shot occlusion-off house.glb
shot occlusion-on house.glb --effects occlusion
shot opacity-scan scan.las --up z --opacity 0.5
shot opacity-house house.glb --opacity 0.4
