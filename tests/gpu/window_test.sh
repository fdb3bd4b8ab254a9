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
