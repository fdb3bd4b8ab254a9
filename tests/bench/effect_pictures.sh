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
[ -f dusk.hdr ] || python3 - dusk.hdr <<'END' || exit 1
# A sky with a low sun, hills and a ground, 1024 x 512: Radiance's four bytes a texel, plain.
import math, sys
def texel(x, y, w, h):
    a, e = (x + 0.5) / w * 2 * math.pi, math.pi * (0.5 - (y + 0.5) / h)
    d = (math.cos(e) * math.sin(a), math.sin(e), -math.cos(e) * math.cos(a))
    hill = 0.09 + 0.035 * math.sin(5 * a) + 0.02 * math.sin(13 * a + 1) + 0.008 * math.sin(41 * a)
    if e < 0: return (0.10 + 0.05 * e, 0.09 + 0.045 * e, 0.07 + 0.035 * e)
    if e < hill: return (0.05, 0.06, 0.07)
    sun = (0.5, 0.3, -0.81)
    c = sum(p * q for p, q in zip(d, sun))
    glow = max(c, 0) ** 32
    if c > math.cos(0.02): return (90, 70, 40)
    t = max(0.0, min(1.0, e / 1.2))
    return (0.75 - 0.6 * t + 0.9 * glow, 0.55 - 0.3 * t + 0.5 * glow, 0.5 + 0.15 * t + 0.15 * glow)
def rgbe(c):
    m = max(c)
    if m < 1e-32: return bytes(4)
    f, e = math.frexp(m)
    return bytes([min(255, int(v / m * f * 256)) for v in c] + [e + 128])
w, h = 1024, 512
with open(sys.argv[1], "wb") as out:
    out.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (h, w))
    for y in range(h):
        out.write(b"".join(rgbe(texel(x, y, w, h)) for x in range(w)))
END
[ -f balls/demo.glb ] || "$program" grow demo -o balls --points 100k --leaves 20k >/dev/null || exit 1
shot background-off house.glb --environment dusk.hdr
shot background-on house.glb --environment dusk.hdr --background environment
shot background-wide scan.las --up z --mode ewa --shade lit --environment dusk.hdr --background environment --fov 90
balls="--eye 0,4,40 --target 0,3.2,24 --environment dusk.hdr"
shot background-glass-off balls/demo.glb $balls --effects none
shot background-glass balls/demo.glb $balls --effects background --background environment
smooth="--eye 2,4,36 --target 6,3,23"
shot reflection-off balls/demo.glb $smooth --environment dusk.hdr --effects shadow
shot reflection-on balls/demo.glb $smooth --environment dusk.hdr --effects shadow,reflection
shot opacity-scan scan.las --up z --opacity 0.5
shot opacity-house house.glb --opacity 0.4
