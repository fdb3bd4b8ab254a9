#!/usr/bin/env bash
# tests/bench/gpu_card.sh [OPTIONS] FOLDER: the whole measurement of the gpu backend on a card, in under eight minutes,
# into FOLDER: frames.jsonl (stipple_gpu_frame), scenes.jsonl (stipple render), card.md (both as tables). Needs nothing
# but the programs and python3; nothing else should run there.
set -uo pipefail
export LC_ALL=C
usage() {
    cat <<'U'
usage: gpu_card.sh [OPTIONS] FOLDER
  --program PROGRAM   stipple [build/stipple]
  --frame PROGRAM     stipple_gpu_frame [tests/stipple_gpu_frame beside it]
  --device NAME       part of the device's name [the first]
  --seconds N         nothing is begun after so many [450]; what is left out is said
  --small N           N times fewer records and pixels, two frames: to try the script
U
    exit 2
}
program=build/stipple frame= device= seconds=450 small=1 folder=
while [ $# -gt 0 ]; do
    case $1 in
        --program | --frame | --device | --seconds | --small) [ $# -ge 2 ] || usage; declare "${1#--}=$2"; shift ;;
        -*) usage ;;
        *) [ -z "$folder" ] || usage; folder=$1 ;;
    esac
    shift
done
[ -n "$folder" ] || usage
program=$(realpath "$program") frame=$(realpath "${frame:-$(dirname "$program")/tests/stipple_gpu_frame}")
for p in "$program" "$frame"; do [ -x "$p" ] || { echo "gpu_card.sh: no program $p" >&2; exit 2; }; done
mkdir -p "$folder" && folder=$(realpath "$folder") || exit 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export XDG_CACHE_HOME=$work/cache
: >"$folder/frames.jsonl" && : >"$folder/scenes.jsonl" && : >"$folder/left_out"
cd "$work" || exit 2
status=0

# step WHAT COMMAND...: what takes longer than there is time for is ended.
step() {
    local left=$((seconds - SECONDS)) what=$1
    shift
    if [ $left -le 0 ]; then echo "$what: no time left" >>"$folder/left_out"; return 1; fi
    timeout "$((left + 20))" "$@" 2>"$work/error" && return
    echo "$what: $(tail -1 "$work/error")" >>"$folder/left_out"
    status=1
    return 1
}
edge() { # edge WxH: of a picture N times smaller
    python3 -c 'import sys; w, h = map(int, sys.argv[1].split("x")); s = float(sys.argv[2]) ** 0.5; print("%dx%d" % (w / s, h / s))' "$1" "$small"
}
frames=100
[ "$small" -eq 1 ] || frames=2
full=$(edge 1920x1080) fourk=$(edge 3840x2160)

# --- records made on the device
records() { # records RESIDENT DRAWN SIZE MODES [OPTIONS...]
    local resident=$(($1 / small)) drawn=$(($2 / small)) size=$3 modes=$4
    shift 4
    step "$resident resident, $drawn drawn, $size, $modes $*" "$frame" --device "$device" --resident "$resident" --drawn "$drawn" \
        --size "$size" --modes "$modes" --frames "$frames" "$@" >>"$folder/frames.jsonl"
}
million=1000000
records $((1000 * million)) $((1000 * million)) "$full" pullpush,splat
records $((1000 * million)) $((10 * million)) "$full" pullpush,splat
records $((1000 * million)) $((10 * million)) "$fourk" pullpush,splat
records $((10 * million)) $((10 * million)) "$full" pullpush,points,surface,splat,ewa,pullpush-exact
records $((10 * million)) $((10 * million)) "$fourk" pullpush,points,surface,splat,ewa,pullpush-exact
records $((100 * million)) $((100 * million)) "$full" pullpush,points,splat
records $((100 * million)) $((100 * million)) "$fourk" pullpush,splat
records $((10 * million)) $((10 * million)) "$full" pullpush --replaced 2
records $((10 * million)) $((10 * million)) "$full" pullpush --filled host

# --- all primitives
grown() { # grown FILE KIND OPTIONS...
    local file=$1
    shift
    step "grow $file" "$program" grow "$@" -o "$file" --force >/dev/null
}
built() { # built INPUT STORE OPTIONS...
    local input=$1 store=$2
    shift 2
    step "build $store" "$program" build "$input" -o "$store" --quiet --force "$@" >/dev/null
}
drawn() { # drawn NAME SCENE OPTIONS...: at both sizes
    local name=$1 scene=$2 size
    shift 2
    [ -e "$scene" ] || { echo "$name: no $scene" >>"$folder/left_out"; status=1; return; }
    for size in "$full" "$fourk"; do
        if step "$name, $size" "$program" render "$scene" -o picture.png --force --quiet --device "gpu${device:+:$device}" \
            --size "$size" --frames "$frames" --json "$@" >render.json; then
            python3 -c 'import json, sys
d = json.load(open("render.json")); d["scene"], d["size"], d["options"] = sys.argv[1:]
print(json.dumps(d))' "$name" "$size" "$*" >>"$folder/scenes.jsonl"
        fi
    done
}
of() { local n=$(($1 / small)); echo $((n > $2 ? n : $2)); }  # of N times fewer, and the least
grown scan.las scan --points "$(of 5000000 2000)" && built scan.las scan.stipple
grown terrain.glb terrain --triangles "$(of 1000000 500)" && built terrain.glb terrain.stipple
grown rock.glb rock --triangles "$(of 300000 500)" --texture 64 && built rock.glb rock.stipple --patches
grown tree.glb tree --leaves "$(of 40000 100)" && built tree.glb tree.stipple
grown forest.glb forest --trees "$(of 2000 3)"
for mode in surface pullpush splat ewa; do drawn "scan, $mode" scan.stipple --error 1 --mode $mode; done
drawn terrain terrain.stipple --error 1
for as in strips splats samples; do drawn "patches as $as" rock.stipple --error 1 --patch-as $as; done
drawn tree tree.stipple --error 1
drawn forest forest.glb --error 2
drawn 'scan, effects' scan.stipple --error 1 --shade lit --effects edl,occlusion

# --- as tables
python3 - "$folder" "$SECONDS" <<'P' || status=1
import json, os, sys
folder, took = sys.argv[1], sys.argv[2]
read = lambda name: [json.loads(line) for line in open(os.path.join(folder, name))]
frames, scenes = read("frames.jsonl"), read("scenes.jsonl")
def most(passes, few=4):
    return ", ".join("%s %.3f" % p for p in sorted(passes, key=lambda p: -p[1])[:few] if p[1] > 0)
with open(os.path.join(folder, "card.md"), "w") as out:
    say = lambda text="": print(text, file=out)
    say("# The gpu backend on %s" % (frames or scenes or [{"device": "no device"}])[0]["device"])
    say()
    say("`tests/bench/gpu_card.sh`, %s s. Milliseconds, medians. Records are made on the device by a hash (`shaders/shared/ground.h`)." % took)
    say()
    say("| drawn | resident | mode, size | passes | in flight | alone | project | of the passes |")
    say("|---|---|---|---|---|---|---|---|")
    for f in frames:
        extra = (", %d MiB replaced" % f["replaced"] if f["replaced"] else "") + (", from the host" if f["filled"] == "host" else "")
        say("| %.4g M | %.4g M | `%s`, %s%s | %.3f | %.3f | %.3f | %s | %s |" % (f["drawn"] / 1e6, f["resident"] / 1e6, f["mode"], f["size"], extra,
            f["passes_ms"], f["in_flight_ms"], f["alone_ms"], "%.0f GB/s" % f["project_gb_per_s"] if "project_gb_per_s" in f else "", most(f["passes"].items())))
    say()
    say("Scenes, with the picture read back:")
    say()
    say("| scene | size | frame | passes | of them |")
    say("|---|---|---|---|---|")
    for s in scenes:
        passes = [(p["name"], p["ms"]) for p in s["passes"]]
        say("| %s | %s | %.2f | %.2f | %s |" % (s["scene"], s["size"], s["frame_ms"]["median"], sum(ms for _, ms in passes), most(passes)))
    left = open(os.path.join(folder, "left_out")).read().splitlines()
    if left:
        say()
        say("Left out:")
        say()
        for line in left: say("- " + line)
P
cat "$folder/left_out" >&2
[ -s "$folder/frames.jsonl" ] && [ -s "$folder/scenes.jsonl" ] || status=1
exit $status
