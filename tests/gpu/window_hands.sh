#!/usr/bin/env bash
# [WINDOW_DEVICE=cpu|gpu] window_hands.sh PROGRAM DROP_FILES CASE: what a user does to a real window, under Xvfb with a window manager, the
# validation layers on. Keys and mouse come from xdotool; pictures that the program takes and pixels of the screen say
# what came of it. Runs itself again inside Xvfb.
set -u
program=$1 drop=$2 case=$3
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if [ "${4:-}" != inside ]; then
    for tool in xdotool openbox wmctrl xprop setxkbmap xvfb-run python3; do
        command -v $tool >/dev/null || { echo "$tool is missing (see .ci/packages.txt)"; exit 1; }
    done
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    folder=$folder xvfb-run -a -s "-screen 0 1000x800x24 -fbdir $folder" "$0" "$program" "$drop" "$case" inside
    exit
fi

export XDG_CACHE_HOME=$folder/cache STIPPLE_VALIDATION=1 LIBGL_ALWAYS_SOFTWARE=1
mkdir "$folder/work" && cd "$folder/work" || exit 1

fail() {
    echo "FAILED: $*"
    tail -n 5 "$folder/out" "$folder/err"
    exit 1
}
# await SECONDS COMMAND...: until it succeeds.
await() {
    local tries=$(($1 * 20))
    shift
    until "$@"; do
        tries=$((tries - 1))
        [ $tries -gt 0 ] || return 1
        sleep 0.05
    done
}
pixel() { python3 "$here/screen.py" "$folder/Xvfb_screen0" "$@"; }
lines() { wc -l <"$1"; }
hasLines() { [ "$(lines "$1")" -ge "$2" ]; }
isAlive() { kill -0 "$viewer" 2>/dev/null; }
findWindow() { isAlive || fail "it ended"; window=$(xdotool search --onlyvisible --pid "$viewer" 2>/dev/null | tail -1) && [ -n "$window" ]; }
isFocused() { [ "$(xdotool getwindowfocus 2>/dev/null)" = "$window" ] || { xdotool windowactivate "$window" 2>/dev/null; false; }; }
# The window's own corner on the screen.
isDrawn() { [ "$(pixel $((X + 12)) $((Y + HEIGHT - 12)))" = "$background" ]; }
geometry() { eval "$(xdotool getwindowgeometry --shell "$window")"; }
hasSize() { geometry && [ "$WIDTH" = "$1" ] && [ "$HEIGHT" = "$2" ]; }
ticks() { awk '{print $14 + $15}' "/proc/$viewer/stat"; }
pngSize() { python3 -c 'import struct,sys; print("%dx%d" % struct.unpack(">2I", open(sys.argv[1], "rb").read(24)[16:]))' "$1"; }

size=640x480
accumulate=1 # a picture is the same at any time
# view ARGUMENTS...: starts the program and waits for its window.
view() {
    # On a crowded machine GLFW sometimes waits for ever for the window manager to show the window (1 of about 100
    # starts): it is started again.
    for _ in 1 2 3; do
        : >"$folder/out" && : >"$folder/err"
        window=
        "$program" view --device "${WINDOW_DEVICE:-cpu}" --size "$size" --accumulate "$accumulate" "$@" >>"$folder/out" 2>>"$folder/err" &
        viewer=$!
        await 15 findWindow && break
        echo "no window: once more" && kill -9 "$viewer" && wait "$viewer" 2>/dev/null
    done
    [ -n "$window" ] || fail "no window"
    await 20 isFocused || fail "the window has no focus"
}
# shoot: presses P; the picture's path is in $shot.
shoot() {
    local before
    before=$(lines "$folder/out")
    xdotool key p
    await 60 hasLines "$folder/out" $((before + 1)) || fail "no picture"
    shot=$(tail -n 1 "$folder/out")
}
settle() { # pictures until two are alike: everything is there
    local last
    shoot
    for _ in $(seq 50); do
        last=$shot
        shoot
        cmp -s "$last" "$shot" && return 0
    done
    fail "the picture never settles"
}
differs() { # presses a key until the picture is another one than $1
    shoot
    ! cmp -s "$1" "$shot"
}
finish() { # closes the window by Escape: rc 0, no complaint of the validation layers
    xdotool key Escape
    await 20 eval '! isAlive' || fail "Escape does not close the window"
    wait "$viewer"
    local rc=$?
    [ $rc -eq 0 ] || fail "exit code $rc"
}
grow() { "$program" grow "$@" >/dev/null || fail "grow $*"; }
scan() { grow scan -o "$folder/a.las" --points 20000; }

errors_stay_in_the_window() {
    grow rock -o "$folder/rock.glb" --triangles 2000 --texture 0
    view "$folder/rock.glb"
    settle
    local plain=$shot
    xdotool key c
    await 10 grep -q 'cannot be coloured' "$folder/err" || fail "C on a mesh says nothing"
    shoot
    cmp -s "$plain" "$shot" || fail "C on a mesh changed its colours"
    finish
    # A folder that is gone cannot be written, not even by root.
    mkdir gone && cd gone && rmdir ../gone
    view "$folder/rock.glb"
    xdotool key p
    await 10 grep -q 'stipple_001.png' "$folder/err" || fail "P where nothing can be written says nothing"
    isAlive || fail "P where nothing can be written closes the window"
    xdotool key p
    refusedTwice() { [ "$(grep -c 'stipple_001.png' "$folder/err")" -ge 2 ]; }
    await 10 refusedTwice || fail "the second P does nothing"
    finish
}

pictures_are_of_the_scene() {
    scan
    echo mine >stipple_001.png
    view "$folder/a.las"
    # What writes pictures is loaded behind the first frame: the first P does not wait for it.
    hasLoaded() { grep -q libstipple_oiio "/proc/$viewer/maps"; }
    await 60 hasLoaded || fail "what writes pictures was not loaded"
    settle
    [ "$(cat stipple_001.png)" = mine ] || fail "P wrote over an earlier picture"
    [ -f stipple_002.png ] || fail "no picture of the first free number"
    [ "$(pngSize "$shot")" = 640x480 ] || fail "the picture is $(pngSize "$shot")"
    local plain=$shot
    for key in Tab Tab h; do # all figures, none, the help
        xdotool key $key
        shoot
        cmp -s "$plain" "$shot" || fail "the overlay is in the picture"
    done
    xdotool key h
    finish
}

window_changes_its_size() {
    scan
    view "$folder/a.las"
    settle
    geometry
    background=$(pixel $((X + 12)) $((Y + HEIGHT - 12)))
    resized() { # all of the window is drawn, to its far corner
        geometry
        [ "$(pixel $((X + WIDTH - 12)) $((Y + HEIGHT - 12)))" = "$background" ] &&
            [ "$(pixel $((X + WIDTH - 12)) $((Y + HEIGHT / 2)))" = "$background" ]
    }
    sized() { shoot && [ "$(pngSize "$shot")" = "${WIDTH}x$HEIGHT" ]; }
    for wanted in "800 600" "420 300" "801 601"; do
        xdotool windowsize "$window" $wanted
        await 20 hasSize $wanted || fail "not resized to $wanted"
        await 20 resized || fail "at $wanted the far corner is $(pixel $((X + WIDTH - 12)) $((Y + HEIGHT - 12))), not $background"
        await 10 sized || fail "the picture is $(pngSize "$shot") at $wanted"
    done
    wmctrl -i -r "$window" -b add,maximized_vert,maximized_horz
    await 20 eval 'geometry; [ "$WIDTH" -gt 900 ]' || fail "not maximised"
    await 20 resized || fail "maximised, the far corner is not drawn"
    wmctrl -i -r "$window" -b remove,maximized_vert,maximized_horz
    await 20 hasSize 801 601 || fail "not restored"
    await 20 resized || fail "restored, the far corner is not drawn"
    xdotool windowminimize "$window"
    await 20 eval '! findWindow' || fail "not minimised"
    window=$(xdotool search --pid "$viewer" | tail -1)
    xdotool windowmap "$window" windowactivate "$window"
    await 20 eval 'findWindow && resized' || fail "after minimising, nothing is drawn"
    finish
}

quiet() { local before; before=$(ticks) && sleep 1 && [ "$(ticks)" -eq "$before" ]; }

edges_become_smooth_at_rest() {
    scan
    accumulate=1
    view "$folder/a.las"
    settle
    local plain=$shot
    finish
    accumulate=16
    view "$folder/a.las"
    settle # (each key begins the waiting anew: no frame is added while pictures are taken)
    await 20 quiet || fail "it never comes to rest"
    shoot
    local smooth=$shot
    cmp -s "$plain" "$smooth" && fail "nothing is added up at rest"
    shoot
    cmp -s "$smooth" "$shot" || fail "the mean changes when all frames are there"
    # The error that it has: drawn anew, and what was added up is dropped. Pressed before each picture: where the
    # machine is busy, frames are added again before the first one is taken, and stay.
    isPlain() { xdotool key 3 && shoot && cmp -s "$plain" "$shot"; }
    await 10 isPlain || fail "what was added up stays"
    finish
}

rests_when_nothing_changes() {
    scan
    view "$folder/a.las"
    settle
    local before after
    await 5 quiet || fail "it never comes to rest"
    before=$(ticks) && sleep 3 && after=$(ticks)
    echo "idle: $((after - before)) hundredths of a second of CPU in 3 s"
    [ $((after - before)) -le 15 ] || fail "it works while nothing changes"
    xdotool windowminimize "$window"
    await 20 eval '! findWindow' || fail "not minimised"
    before=$(ticks) && sleep 3 && after=$(ticks)
    echo "minimised: $((after - before)) hundredths of a second of CPU in 3 s"
    [ $((after - before)) -le 15 ] || fail "it works while it is minimised"
    kill -INT "$viewer"
    await 20 eval '! isAlive' || fail "SIGINT does not end it"
    wait "$viewer"
    local rc=$?
    [ $rc -eq 7 ] || fail "exit code $rc after SIGINT"
    grep -q interrupted "$folder/err" || fail "nothing is said about the interruption"
}

keys_follow_the_layout() {
    scan
    setxkbmap fr
    view "$folder/a.las"
    settle
    local plain=$shot
    for key in ctrl+m alt+m super+m ctrl+c; do
        xdotool key $key
        shoot
        cmp -s "$plain" "$shot" || fail "$key does what a plain key does"
    done
    xdotool key m
    await 10 differs "$plain" || fail "M of a French keyboard does nothing"
    local pulled=$shot
    xdotool key m
    await 10 differs "$pulled" || fail "the second M does nothing"
    local splats=$shot
    xdotool key m
    await 10 differs "$splats" || fail "the third M does nothing"
    local blended=$shot
    xdotool key m
    await 10 differs "$blended" || fail "the fourth M does nothing"
    local points=$shot
    xdotool key m
    await 10 differs "$points" || fail "the fifth M does nothing"
    xdotool key m
    settle
    cmp -s "$plain" "$shot" || fail "M six times, once round the modes, is not what was before"
    # Keycode 25 is W on a US keyboard and Z on a French one.
    xdotool key f
    xdotool keydown 25
    await 10 differs "$plain" || fail "the key at the place of W does not fly"
    xdotool keyup 25
    settle
    plain=$shot
    xdotool key Up
    await 10 differs "$plain" || fail "the arrow does not fly"
    finish
    setxkbmap us
}

mouse_goes_through_the_overlay() {
    scan
    view "$folder/a.las"
    xdotool key Tab # all figures
    settle
    local plain=$shot
    xdotool mousemove --window "$window" 60 60 click 4
    await 10 differs "$plain" || fail "the overlay swallows the wheel"
    settle
    plain=$shot
    xdotool mousemove --window "$window" 60 60 mousedown 1 mousemove_relative 30 10 mousemove_relative 30 10 mouseup 1
    await 10 differs "$plain" || fail "the overlay swallows a drag"
    finish
}

dropped_files_are_opened() {
    scan
    grow rock -o "$folder/rock.glb" --triangles 2000 --texture 0
    view "$folder/a.las"
    settle
    local plain=$shot
    for _ in 1 2 3; do "$drop" "$window" --vanish; done
    shoot
    cmp -s "$plain" "$shot" || fail "a drag that was given up changed the picture"
    echo 'not a scan' >"$folder/bad.las"
    "$drop" "$window" "$folder/bad.las" || fail "bad.las was not taken"
    await 20 grep -q 'bad.las' "$folder/err" || fail "nothing is said about bad.las"
    shoot
    cmp -s "$plain" "$shot" || fail "a file that cannot be read changed the picture"
    "$drop" "$window" "$folder/rock.glb" || fail "rock.glb was not taken"
    await 60 eval 'xdotool getwindowname "$window" | grep -q rock' || fail "rock.glb is not shown"
    settle
    ! cmp -s "$plain" "$shot" || fail "the picture is the same"
    "$drop" "$window" "$folder/a.las" || fail "a.las was not taken"
    await 60 eval 'xdotool getwindowname "$window" | grep -q a.las' || fail "a.las is not shown again"
    settle
    cmp -s "$plain" "$shot" || fail "the scan looks otherwise than before"
    finish
}

cameras_and_paths() {
    scan
    view "$folder/a.las"
    settle
    local plain=$shot key
    xdotool key u
    await 10 differs "$plain" || fail "U does nothing"
    xdotool key u u
    settle
    cmp -s "$plain" "$shot" || fail "U three times is not the first view"
    finish
    # The window shows what render draws.
    "$program" render --device cpu --budget-points 2000000 --size 640x480 --quiet \
        --eye 3,-30,20 --target 0,0,2 "$folder/a.las" -o rendered.png || fail "render"
    view "$folder/a.las" --eye 3,-30,20 --target 0,0,2
    settle
    "$program" compare rendered.png "$shot" >compared || fail "compare"
    grep -qE 'inf|identical' compared || fail "the window differs from render: $(cat compared)"
    finish
    view "$folder/a.las" --orbit 120
    shoot
    await 10 differs "$shot" || fail "nothing turns"
    xdotool key space
    settle
    finish
}

trap 'kill $viewer $manager 2>/dev/null' EXIT
viewer=
surfels_are_weighed_while_it_moves() { # mode ewa: per surfel while something changes, per pixel when it rests
    scan
    "$program" build "$folder/a.las" -o "$folder/a.stipple" --surfel-weights >/dev/null 2>&1 || fail "build"
    # Two looks at rest: a second apart at most. (Keys are no rest.)
    rested() { sleep 2 && shoot; }
    view "$folder/a.stipple" --mode ewa
    settle
    rested
    local rest=$shot before moved
    # 3 asks for the error of a pixel that there is already: a change that leaves everything as it was. The picture is
    # taken before two looks at rest.
    before=$(lines "$folder/out")
    xdotool keydown --delay 0 3 keydown --delay 0 p keyup 3 keyup p
    await 60 hasLines "$folder/out" $((before + 1)) || fail "no picture"
    moved=$(tail -n 1 "$folder/out")
    ! cmp -s "$rest" "$moved" || fail "while something changes the picture is that of rest"
    rested
    cmp -s "$rest" "$shot" || fail "at rest it is another picture than before"
    # Which is which, by pictures that are asked for by name.
    for way in pixel surfel; do
        "$program" render "$folder/a.stipple" --mode ewa --normalise $way --size 640x480 -o "$folder/$way.png" >/dev/null ||
            fail "render --normalise $way"
    done
    ! cmp -s "$folder/pixel.png" "$folder/surfel.png" || fail "the control: both ways are alike"
    cmp -s "$rest" "$folder/pixel.png" || fail "at rest it is not per pixel"
    cmp -s "$moved" "$folder/surfel.png" || fail "while it moves it is not per surfel"
    finish
}

letters_follow_the_desktop() {
    scan
    below() { geometry; pixel $((X + 30)) $((Y + 45)); } # under a line of figures of plain letters, in one of large ones
    for dpi in 96 192; do
        xprop -root -f RESOURCE_MANAGER 8s -set RESOURCE_MANAGER "$(printf 'Xft.dpi:\t%s' $dpi)"
        size=900x700 view "$folder/a.las"
        settle
        geometry
        local background
        background=$(pixel $((X + 30)) $((Y + 120)))
        if [ $dpi = 96 ]; then
            [ "$(below)" = "$background" ] || fail "plain letters reach too far"
        else
            [ "$(below)" != "$background" ] || fail "the letters do not grow with the desktop's scale"
        fi
        finish
    done
}

# Without frames around windows, xdotool says truly where they are.
cat >"$folder/openbox.xml" <<'XML'
<openbox_config xmlns="http://openbox.org/3.4/rc">
  <applications><application class="*"><decor>no</decor></application></applications>
</openbox_config>
XML
# On a crowded machine it sometimes starts before the display takes it, and ends: it is started again.
hasManager() { wmctrl -m >/dev/null 2>&1; }
for _ in 1 2 3; do
    openbox --config-file "$folder/openbox.xml" >"$folder/openbox.err" 2>&1 &
    manager=$!
    await 15 hasManager && break
    kill -9 "$manager" 2>/dev/null
done
hasManager || { echo "no window manager"; cat "$folder/openbox.err"; exit 1; }
"$case"
