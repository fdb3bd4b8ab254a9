#!/usr/bin/env bash
# Every loop of the cpu backend's kernels that is said to be one for SIMD (`#pragma GCC ivdep`) is one, says GCC's own
# report: a branch, a call or a store under a condition turns such a loop back into one pixel after another, draws the
# same picture, and takes ten times as long.
#
#   loops_are_vectorised.sh SOURCE_FOLDER BUILD_FOLDER [--self-test]
#
# Other compilers, or a build without compile_commands.json: SKIP. --self-test: in a copy of the kernels two loops are
# spoilt, one of them in a single instance of its template, and both must be found.
source=$1 build=$2
kernel=engine/cpu/kernels_avx512.cpp
folder=$(mktemp -d) || exit 2
trap 'rm -rf "$folder"' EXIT
skip() { echo "SKIP: $1: whether loops are vectorised is not known"; exit 0; }

[ "$(uname -m)" = x86_64 ] || skip "no x86-64"
[ -f "$build/compile_commands.json" ] || skip "no compile_commands.json"
command -v python3 >/dev/null || skip "no python3"
# The compiler's own words, without what caches compilations.
mapfile -d '' -t words < <(python3 - "$build" "$source/$kernel" <<'PYTHON'
import json, os, shlex, sys
for entry in json.load(open(os.path.join(sys.argv[1], "compile_commands.json"))):
    if os.path.realpath(entry["file"]) == os.path.realpath(sys.argv[2]):
        words = shlex.split(entry["command"])
        words = words[1:] if os.path.basename(words[0]) == "ccache" else words
        out = words.index("-o")
        del words[out:out + 2]
        at = words.index("-c")
        del words[at:at + 2]
        sys.stdout.write("".join(word + "\0" for word in words))
PYTHON
)
[ "${#words[@]}" -gt 0 ] || skip "$kernel is not compiled here"
"${words[0]}" --version | head -1 | grep -qiE 'gcc|g\+\+|c\+\+ \(' || skip "no GCC"
printf '%s\n' "${words[@]}" | grep -qx -- '-O3' || skip "no optimised build"

mkdir -p "$folder/engine" && cp -r "$source/engine/cpu" "$folder/engine/cpu" || exit 2
if [ "$3" = --self-test ]; then
    # A branch that the compiler cannot turn into a selection: a store to what it knows nothing of. And one in a single
    # instance of a template.
    sed -i 's/^        if (wideToo) {/        if (wideToo \&\& cz > 7.0f) __asm__ volatile("");\n&/' "$folder/engine/cpu/kernels.inl"
    awk '{ print } /^#pragma GCC ivdep/ && !done { getline; print; print "if (b.isNear[l] > 7.0f) __asm__ volatile(\"\");"; done = 1 }' \
        "$source/engine/cpu/splat.inl" >"$folder/engine/cpu/splat.inl"
fi
"${words[@]}" -I"$source" -iquote "$folder" -c "$folder/$kernel" -o "$folder/kernels.o" \
    -fopt-info-loop-vec-optimized-missed="$folder/report" || exit 1

# Of what these read (tables by level, wrapping by material; two triangles of a cell; second surfaces) GCC makes control
# flow in so many of their instances; to be mended, and nothing added.
declare -A known=([engine/cpu/sample.inl:32]=all [engine/cpu/patch_splats.inl:21]=1 [engine/cpu/ewa_fronts.inl:29]=1)
status=0 loops=0 spoilt=
while IFS=: read -r file line _; do
    # (Copies and fills become calls of the library.) The loop begins in one of the lines below the pragma that speaks of it.
    at=$((line + 1))
    loops=$((loops + 1))
    [ "${known[$file:$at]:-}" = all ] && continue
    # A template's loop is one for each of its instances, and of them all.
    few=$(grep -cE "/${file##*/}:$at:[0-9]+: missed: +couldn't vectorize loop" "$folder/report")
    grep -qE "/${file##*/}:$at:[0-9]+: optimized: +(loop vectorized|Loop [0-9]+ distributed: split to 0 loops and [1-9])" "$folder/report" &&
        [ "$few" -le "${known[$file:$at]:-0}" ] && continue
    echo "$file:$at: not vectorised (instances: $few): $(sed -n "${at}p" "$folder/$file")"
    status=1
    spoilt+=" $(basename "$file" .inl)"
done < <(cd "$folder" && grep -n '^ *#pragma GCC ivdep' engine/cpu/*.inl | tr -d ' ')
echo "$loops loops"
[ "$loops" -gt 50 ] || { echo "they are not found"; status=1; }
if [ "$3" = --self-test ]; then
    [ "$spoilt" = ' splat kernels' ] || [ "$spoilt" = ' kernels splat' ] && exit 0
    echo "of the spoilt loops of splat.inl and kernels.inl only these were found:$spoilt"
    exit 1
fi
exit $status
