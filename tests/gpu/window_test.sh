#!/usr/bin/env bash
# A real window under Xvfb, with validation: it draws, takes a picture and closes; without a display it says so.
set -eu
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export XDG_CACHE_HOME=$folder
"$program" grow scan -o "$folder/a.las" --points 20000
if DISPLAY= WAYLAND_DISPLAY= "$program" view "$folder/a.las" 2>"$folder/err"; then
    echo 'view without a display should fail'
    exit 1
fi
grep -q 'there is no display' "$folder/err"
STIPPLE_VALIDATION=1 xvfb-run -a -s '-screen 0 800x600x24' "$program" view "$folder/a.las" --size 640x480 --frames 5 --screenshot "$folder/a.png"
[ "$(head -c 4 "$folder/a.png" | tail -c 3)" = PNG ]
# It shows the scene: below the text it is the picture of `render`, which a black one and one of nothing are not.
likeness() { "$program" compare "$1" "$folder/scene.png" --json | sed -n 's/.*"psnr": "*\([a-z0-9.]*\).*/\1/p'; }
"$program" render "$folder/a.las" -o "$folder/scene.png" --size 640x480 --budget-points 2M >/dev/null
"$program" render "$folder/a.las" -o "$folder/black.png" --size 640x480 --background 0,0,0 --eye 0,0,9000 --target 0,0,9001 --no-wait >/dev/null || true
"$program" render "$folder/a.las" -o "$folder/empty.png" --size 640x480 --eye 0,0,9000 --target 0,0,9001 --no-wait >/dev/null || true
shown=$(likeness "$folder/a.png") black=$(likeness "$folder/black.png") empty=$(likeness "$folder/empty.png")
echo "PSNR of the window against the scene $shown dB; of black $black dB, of an empty window $empty dB"
python3 -c "import sys; shown, black, empty = map(float, sys.argv[1:]); sys.exit(not shown > 6 + max(black, empty))" "$shown" "$black" "$empty"
# In another mode it is the picture of that mode, and no longer that of the first.
STIPPLE_VALIDATION=1 xvfb-run -a -s '-screen 0 800x600x24' "$program" view "$folder/a.las" --mode points --size 640x480 --frames 5 --screenshot "$folder/points.png"
"$program" render "$folder/a.las" -o "$folder/scene.png" --force --mode points --size 640x480 --budget-points 2M >/dev/null
points=$(likeness "$folder/points.png") other=$(likeness "$folder/a.png")
echo "PSNR of the window in mode points against that of render $points dB, in its usual mode $other dB"
python3 -c "import sys; points, other = map(float, sys.argv[1:]); sys.exit(not points > 6 + other)" "$points" "$other"
