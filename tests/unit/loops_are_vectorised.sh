#!/usr/bin/env bash
# Every loop of the cpu backend's kernels that is said to be one for SIMD (`#pragma GCC ivdep`) is one, says GCC's own
# report: a branch, a call or a store under a condition turns such a loop back into one pixel after another, draws the
# same picture, and takes ten times as long.
#
#   loops_are_vectorised.sh SOURCE_FOLDER BUILD_FOLDER avx2|avx512
#
# Other compilers, or a build without compile_commands.json: SKIP. The control is compiled beside them (a compilation takes
# half a minute): of three loops more one is spoilt, and one in a single instance of its template.
source=$1 build=$2 set=$3
kernel=engine/cpu/kernels_$set.cpp
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
cat >"$folder/engine/cpu/control.inl" <<'CONTROL'
template <bool isSpoilt>
void controlOf(float* values, uint32_t count) {
#pragma GCC ivdep
    for (uint32_t i = 0; i < count; ++i) {  // instance
        if (isSpoilt && values[i] > 7.0f) __asm__ volatile("");
        values[i] *= 2.0f;
    }
}
template void controlOf<false>(float*, uint32_t);
template void controlOf<true>(float*, uint32_t);
void control(float* values, uint32_t count) {
#pragma GCC ivdep
    for (uint32_t i = 0; i < count; ++i) {  // spoilt
        if (values[i] > 7.0f) __asm__ volatile("");
        values[i] *= 3.0f;
    }
#pragma GCC ivdep
    for (uint32_t i = 0; i < count; ++i) values[i] += 5.0f;  // sound
}
CONTROL
echo '#include "engine/cpu/control.inl"' >>"$folder/$kernel"
# What comes behind the loops takes a quarter of the time, and is not wanted.
"${words[@]}" -I"$source" -iquote "$folder" -S "$folder/$kernel" -o /dev/null \
    -fno-tree-slp-vectorize -fno-gcse -fno-gcse-after-reload -fno-schedule-insns2 \
    -fopt-info-loop-vec-optimized-missed="$folder/report" || exit 1

# Of what these read (tables by level, wrapping by material; two triangles of a cell; second surfaces) GCC makes control
# flow in so many of their instances; to be mended, and nothing added.
declare -A known=([engine/cpu/patch_splats.inl:21]=1)
[ "$set" = avx512 ] && known+=([engine/cpu/sample.inl:32]=all [engine/cpu/ewa_fronts.inl:29]=1)
status=0 loops=0 control=
while IFS=: read -r file line _; do
    # (Copies and fills become calls of the library.) The loop begins in one of the lines below the pragma that speaks of it.
    at=$((line + 1))
    loops=$((loops + 1))
    [ "${known[$file:$at]:-}" = all ] && continue
    # A template's loop is one for each of its instances, and of them all.
    few=$(grep -cE "/${file##*/}:$at:[0-9]+: missed: +couldn't vectorize loop" "$folder/report")
    grep -qE "/${file##*/}:$at:[0-9]+: optimized: +(loop vectorized|Loop [0-9]+ distributed: split to 0 loops and [1-9])" "$folder/report" &&
        [ "$few" -le "${known[$file:$at]:-0}" ] && continue
    line=$(sed -n "${at}p" "$folder/$file")
    [ "$file" = engine/cpu/control.inl ] && control+="${line##*//}" && continue
    echo "$file:$at: not vectorised (instances: $few): $line"
    status=1
done < <(cd "$folder" && grep -n '^ *#pragma GCC ivdep' engine/cpu/*.inl | tr -d ' ')
echo "$loops loops"
[ "$loops" -gt 50 ] || { echo "they are not found"; status=1; }
[ "$control" = " instance spoilt" ] || { echo "of the control's loops these are found:$control"; status=1; }
exit $status
