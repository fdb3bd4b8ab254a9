#!/usr/bin/env bash
# tests/bench/same_pictures.sh [OPTIONS] OLD [NEW]: the same pictures and stores of two programs, one line a case; 1 if
# any differs. See README.md here.
set -euo pipefail
export LC_ALL=C
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source_tree=$(cd "$here/../.." && pwd)
usage() {
    cat <<'U'
usage: same_pictures.sh [OPTIONS] OLD [NEW]
OLD, NEW: a commit, which is built, or a stipple program; NEW is build/stipple where it is not given.
  --decoded              stores by their decoded records instead of their bytes
  --same-stores          NEW draws OLD's stores: pictures differ by drawing alone
  --expect-changed FILE  names (patterns, one a line) that may differ
  --only REGEX           cases whose names match, and the stores that they need
  --jobs N               cases at a time [number of cores]
  --keep FOLDER          where NEW's pictures and stores stay [a temporary folder]
  --self-test PROGRAM    shows that a changed picture and a changed store are found
U
    exit 2
}
decoded=0 same_stores=0 expected=/dev/null only=. jobs=$(nproc) keep= self_test=
while [ $# -gt 0 ]; do
    case $1 in
        --decoded) decoded=1 ;;
        --same-stores) same_stores=1 ;;
        --expect-changed) expected=$(realpath "$2"); shift ;;
        --only) only=$2; shift ;;
        --jobs) jobs=$2; shift ;;
        --keep) keep=$2; shift ;;
        --self-test) self_test=$(realpath "$2"); shift ;;
        -*) usage ;;
        *) break ;;
    esac
    shift
done
data=${STIPPLE_DATA:-}
cache=${STIPPLE_SAME_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/stipple-same}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# --- the two programs

# program_of OLD|NEW: path of the program; a commit is built, once, into the cache.
program_of() {
    if [ -f "$1" ] && [ -x "$1" ]; then realpath "$1"; return; fi
    local commit bin tree
    commit=$(git -C "$source_tree" rev-parse --verify --quiet "$1^{commit}") || { echo "neither a program nor a commit: $1" >&2; return 2; }
    bin=$cache/$commit/bin
    if [ ! -x "$bin/stipple" ]; then
        tree=$work/tree
        mkdir -p "$tree" "$bin/tests"
        echo "building $commit" >&2
        git -C "$source_tree" archive "$commit" | tar -x -C "$tree"
        # A compiler cache then takes the files for those of any other tree.
        (export CCACHE_BASEDIR=$tree CCACHE_NOHASHDIR=1
            cd "$tree" && cmake --preset release && cmake --build build -j "$jobs" --target stipple &&
            { ! grep -q stipple_same tests/CMakeLists.txt || cmake --build build -j "$jobs" --target stipple_same; }) >"$work/build.log" 2>&1 ||
            { tail -20 "$work/build.log" >&2; return 2; }
        [ ! -f "$tree/build/tests/stipple_same" ] || cp "$tree/build/tests/stipple_same" "$bin/tests/"
        cp "$tree/build/libstipple_oiio.so" "$bin/"
        cp "$tree/build/stipple" "$bin/"
        rm -rf "$tree"
    fi
    echo "$bin/stipple"
}

# --- the cases: each is a line `kind<TAB>name<TAB>environment<TAB>arguments`

skipped=0
environment=
declare -A wanted_stores=()
add() { # add LIST KIND NAME ARGS...
    local list=$1 kind=$2 name=$3 argument line=
    shift 3
    for argument in "$@"; do
        case $argument in
            @*.gz) argument=${argument#@}; [ -f "$data/$argument" ] || { skip "$name" "$argument"; return; }
                line+=" inputs/$(basename "${argument%.gz}")"
                [ -f "$work/unpacked/$(basename "${argument%.gz}")" ] || { mkdir -p "$work/unpacked"; zcat "$data/$argument" >"$work/unpacked/$(basename "${argument%.gz}")"; } ;;
            @*) [ -e "$data/${argument#@}" ] || { skip "$name" "${argument#@}"; return; }; line+=" $data/${argument#@}" ;;
            %*.gltf) line+=" drawn/${argument#%}" ;;
            %*) line+=" drawn/${argument#%}.stipple" ;;
            {*}) argument=${argument#\{}; line+=" inputs/${argument%\}}" ;;
            *) line+=" $argument" ;;
        esac
    done
    printf '%s\t%s\t%s\t%s\n' "$kind" "$name" "$environment" "$line" >>"$work/$list"
}
skip() { [[ $1 =~ $only ]] || return 0; skipped=$((skipped + 1)); printf 'SKIP     %-24s %s is missing\n' "$1" "$2"; }
on() { environment=$1; shift; "$@"; environment=; }
grown() { add grown grow "$@"; }
store() { add stores build "$@"; }
converted() { add stores convert "$@"; }
placed() { add stores place "$@"; }
picture() {
    local name=$1
    shift
    [[ $name =~ $only ]] || return 0
    [[ $name == *.exr ]] || name+=.png
    add pictures render "$name" "$@"
}
# What pictures need is made even where its own name does not match.
select_cases() {
    touch "$work/grown" "$work/stores" "$work/pictures"
    source "$here/same_pictures_cases.sh"
    cp "$work/stores" "$work/all_stores"
    needed pictures stores drawn/
    cat "$work/stores" "$work/pictures" >"$work/rest"
    needed rest all_stores drawn/  # what is placed needs stores too
    mv "$work/all_stores" "$work/stores"
    cat "$work/stores" "$work/pictures" >"$work/rest"
    needed rest grown inputs/
}
# needed BY LIST PREFIX: leaves in LIST what matches by name, or what the lines of BY mention with that prefix.
needed() {
    awk -F'\t' -v only="$only" -v by="$work/$1" -v prefix=" $3" '
        BEGIN { while ((getline line < by) > 0) all = all " " line " " }
        $2 ~ only || index(all, prefix $2 " ") || index(all, prefix $2 ".stipple ") || index(all, prefix $2 ".gltf ")' \
        "$work/$2" >"$work/s" && mv "$work/s" "$work/$2"
}

# --- one side: a folder with grown/ inputs/ stores/ drawn/ pictures/ exit/ log/

place() { # place STORE SCALE,X,Y,Z ...: a scene of stores
    local nodes=() numbers
    while [ $# -gt 1 ]; do
        IFS=, read -ra numbers <<<"$2"
        nodes+=("{\"scale\":[${numbers[0]},${numbers[0]},${numbers[0]}],\"translation\":[${numbers[1]},${numbers[2]},${numbers[3]}],\"extensions\":{\"STIPPLE_store\":{\"uri\":\"${1#drawn/}\"}}}")
        shift 2
    done
    printf '{"asset":{"version":"2.0"},"extensionsUsed":["STIPPLE_store"],"scene":0,"scenes":[{"nodes":[%s]}],"nodes":[%s]}\n' \
        "$(seq -s, 0 $((${#nodes[@]} - 1)))" "$(IFS=,; echo "${nodes[*]}")"
}
run_case() { # run_case PROGRAM LINE, in the side's folder
    local program=$1 kind name environment arguments folder output
    IFS=$'\t' read -r kind name environment arguments < <(printf '%s\n' "$2" | sed 's/\t\t/\t-\t/')
    [ "$environment" != - ] || environment=
    case $kind in
        grow) output=grown/$name ;;
        render) output=pictures/$name ;;
        *) output=stores/$name.stipple ;;
    esac
    case $kind in grow) ;; *) arguments+=' --quiet' ;; esac
    [ "$kind" != convert ] || arguments=${arguments% --quiet}
    [ "$kind" != place ] || { place $arguments >"stores/$name.gltf"; return; }
    local status=0
    # The arguments are words without blanks, as the cases have them.
    # shellcheck disable=SC2086
    env $environment XDG_CACHE_HOME="$PWD/cache" timeout 300 "$program" $kind $arguments -o "$output" --force >"log/$kind-$name" 2>&1 || status=$?
    echo "$status" >"exit/$kind-$name"
}
export -f run_case place
run_list() { xargs -r -d '\n' -P "$jobs" -I{} bash -c 'run_case "$1" "$2"' _ "$1" {} <"$2"; }

# run_side PROGRAM FOLDER INPUTS STORES: INPUTS and STORES are folders of the other side, or empty.
run_side() {
    local program=$1 folder=$2
    mkdir -p "$folder"/{grown,stores,pictures,exit,log}
    cd "$folder"
    run_list "$program" "$work/grown"
    if [ -n "$3" ]; then
        ln -sfn "$3" inputs
    else
        mkdir -p inputs
        cp grown/* inputs/ 2>/dev/null || true
        "$helper" ball inputs/ball.ply
        [ ! -d "$work/unpacked" ] || cp "$work/unpacked/"* inputs/
    fi
    run_list "$program" "$work/stores"
    ln -sfn "${4:-stores}" drawn
    run_list "$program" "$work/pictures"
    rm -rf cache
    cd "$work"
}

# hashes FOLDER HELPER: `hash name` of everything that a side made. HELPER reads stores of the side's own version.
hashes() {
    cd "$1"
    find grown stores pictures -type f | sort >"$work/files"
    {
        grep '^pictures/' "$work/files" | xargs -r "$helper" pictures
        if [ $decoded -eq 1 ]; then
            grep '\.stipple$' "$work/files" | xargs -r "$2" stores | awk '{print $1 " " $NF}'
            grep -vE '^pictures/|\.stipple$' "$work/files" | xargs -r sha256sum | awk '{print $1 " " $2}'
        else
            grep -v '^pictures/' "$work/files" | xargs -r sha256sum | awk '{print $1 " " $2}'
        fi
        for f in exit/*; do echo "$(cat "$f") $f"; done
    } | sort -k2
    cd "$work"
}

# --- what differs

is_expected() {
    local pattern
    while read -r pattern; do
        case $pattern in '' | '#'*) continue ;; esac
        # shellcheck disable=SC2053
        [[ $1 != $pattern ]] || return 0
    done <"$expected"
    return 1
}
how_far() { # how_far NAME
    case $1 in
        pictures/*) "$helper" compare "$old_side/$1" "$new_side/$1" ;;
        exit/*) echo "exit code $(cat "$old_side/$1"), now $(cat "$new_side/$1"): $(tail -1 "$new_side/log/${1#exit/}")" ;;
        *) echo "$(stat -c %s "$old_side/$1") bytes, now $(stat -c %s "$new_side/$1")" ;;
    esac
}
report() {
    local same=0 changed=0 allowed=0 failed=0 name old new word
    while read -r name old new; do
        if [ "$old" = "$new" ]; then
            if [[ $name != exit/* ]]; then
                same=$((same + 1))
                printf 'same     %s\n' "$name"
            elif [ "$old" != 0 ]; then  # a case that shows nothing
                failed=$((failed + 1))
                printf 'FAILS    %s: %s\n' "$name" "$(tail -1 "$new_side/log/${name#exit/}")"
            fi
            continue
        fi
        word=DIFFERS
        if is_expected "$name"; then
            word=expected
            allowed=$((allowed + 1))
        else
            changed=$((changed + 1))
        fi
        if [ "$old" = - ] || [ "$new" = - ]; then
            printf '%-8s %s: only of %s\n' "$word" "$name" "$([ "$old" = - ] && echo NEW || echo OLD)"
        else
            printf '%-8s %s: %s\n' "$word" "$name" "$(how_far "$name")"
        fi
    done < <(join -1 2 -2 2 -a 1 -a 2 -e - -o 0,1.1,2.1 "$work/old.hash" "$work/new.hash")
    printf '%d same, %d differ, %d differ as expected, %d fail on both sides, %d skipped for want of data; %d s\n' \
        $same $changed $allowed $failed $skipped $SECONDS
    [ $changed -eq 0 ] && [ $failed -eq 0 ]
}

# --- the self-test: a program that draws one picture and builds one store differently

if [ -n "$self_test" ]; then
    cat >"$work/changed" <<W
#!/usr/bin/env bash
case "\$*" in
    *pictures/ball_normals.png*) exec "$self_test" "\$@" --background 39,39,45 ;;
    *stores/ball_kept.stipple*) a=("\$@"); exec "$self_test" "\${a[@]/%keep/auto}" ;;
    *pictures/ball_holes.png*) exit 3 ;;
esac
exec "$self_test" "\$@"
W
    chmod +x "$work/changed"
    mkdir -p "$work/tests"
    cp "$(dirname "$self_test")/tests/stipple_same" "$work/tests/"
    script=$here/$(basename "${BASH_SOURCE[0]}")
    fail() { echo "self-test: $1"; cat "$work/out"; exit 1; }
    "$script" --only '^ball' "$self_test" "$self_test" >"$work/out" || fail 'a program differs from itself'
    if "$script" --only '^ball' "$self_test" "$work/changed" >"$work/out"; then fail 'changes were not found'; fi
    for name in pictures/ball_normals.png stores/ball_kept.stipple exit/render-ball_holes.png pictures/ball_holes.png; do
        grep -q "^DIFFERS  $name" "$work/out" || fail "a change of $name was not found"
    done
    grep -q '^same     pictures/ball_level.png' "$work/out" || fail 'what did not change is said to differ'
    grep -o '^DIFFERS  [^:]*' "$work/out" | sed 's/DIFFERS  //' >"$work/list"
    "$script" --only '^ball' --expect-changed "$work/list" "$self_test" "$work/changed" >"$work/out" || fail 'expected changes count as unexpected'
    echo 'self-test: changes of a picture, a store and an exit code are found, nothing else is'
    exit 0
fi

# Read whole before it runs: the file may change meanwhile.
main() {
    [ $# -ge 1 ] && [ $# -le 2 ] || usage
    old=$(program_of "$1") new=$(program_of "${2:-$source_tree/build/stipple}")
    for helper in "$(dirname "$new")/tests/stipple_same" "$(dirname "$old")/tests/stipple_same" ''; do
        [ -n "$helper" ] || { echo 'neither side has tests/stipple_same: build that target' >&2; exit 2; }
        [ ! -x "$helper" ] || break
    done
    old_helper=$(dirname "$old")/tests/stipple_same
    [ -x "$old_helper" ] || old_helper=$helper
    select_cases
    old_side=$work/old new_side=${keep:-$work/new}
    mkdir -p "$new_side"
    new_side=$(realpath "$new_side")
    if [[ $old == "$cache"/*/bin/stipple ]]; then
        key=$( (cat "$work"/grown "$work"/stores "$work"/pictures; grep -m1 'model name' /proc/cpuinfo) | sha256sum | head -c 16)
        old_side=$cache/$(basename "$(dirname "$(dirname "$old")")")/$key
    fi
    if [ ! -f "$old_side/done" ]; then
        run_side "$old" "$old_side" '' ''
        touch "$old_side/done"
    fi
    run_side "$new" "$new_side" "$old_side/inputs" "$([ $same_stores -eq 0 ] || echo "$old_side/stores")"
    hashes "$old_side" "$old_helper" >"$work/old.hash"
    hashes "$new_side" "$helper" >"$work/new.hash"
    report
}
main "$@"
exit
