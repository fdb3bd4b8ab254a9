#!/usr/bin/env bash
# tests/hard/mutations.sh [WORD]: swaps the naive formulas of hard cases in, one at a time, and requires that the test
# that stands for the case then fails. In a copy of the tree (build/mutations), so that nothing of the tree is touched;
# every test is first seen to pass there. WORD: only the mutations in whose line (case, file,
# test, words) this regular expression is found: '^9 ' is case 9. Prints a line each, with what
# the test says of the naive formula. Part of ./test --full.
#
# Each test file is a program of its own there, built as the tree's build folder is, so that ccache has what did not
# change. Of a formula in a header that half of the tree includes, a mutation names the files that are compiled with it
# (only=GLOBS): the test itself, where it looks at values, or the kernels of this machine ($kernels), where it draws.
# All others keep the right formula. Without only=, all that includes the header is compiled anew.
set -u
tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
copy=$tree/build/mutations
word=${1:-}
status=0
count=0
declare -A passed=()
kernels=engine/cpu/kernels_sse.cpp
grep -q avx2 /proc/cpuinfo && kernels=engine/cpu/kernels_avx2.cpp
grep -q avx512bw /proc/cpuinfo && kernels=engine/cpu/kernels_avx512.cpp

refresh() {  # the tree's files as they are now; those that did not change keep their times
    local f
    while IFS= read -r -d '' f; do
        cmp -s "$tree/$f" "$copy/$f" && continue
        [ -f "$tree/$f" ] || continue
        mkdir -p "$copy/$(dirname "$f")"
        cp "$tree/$f" "$copy/$f"
    done < <(git -C "$tree" ls-files -z --cached --others --exclude-standard)
}
# What compiles: through ccache, if there is one. A naive formula may leave something unused: no warnings of it.
write_compiler() {
    printf '#!/bin/sh\nno=\n[ -e "%s/mutated" ] && no=-w\nexec %s "$@" $no\n' "$copy" "$(command -v ccache)" >"$copy/compiler"
    chmod +x "$copy/compiler"
}
build() { ninja -C "$copy/build" "$1" >"$copy/build.log" 2>&1; }
run() {  # PROGRAM FILTER: the test's own exit code; 200 where no test of that name ran
    timeout 900 "$copy/build/tests/$1" --gtest_filter="$2" >"$copy/run.log" 2>&1
    local code=$?
    grep -qE '^\[==========\] [1-9][0-9]* tests? from .* ran\.' "$copy/run.log" || [ $code -ne 0 ] || code=200
    return $code
}
# FILE OLD NEW: the only place where OLD stands.
swap() {
    FROM=$2 TO=$3 perl -0777 -pi -e '
        my $n = () = /\Q$ENV{FROM}\E/g;
        die "stands $n times in $ARGV: $ENV{FROM}\n" if $n != 1;
        s/\Q$ENV{FROM}\E/$ENV{TO}/;' "$copy/$1"
}
# CASE TEST_FILE FILTER WORDS FILE OLD NEW [FILE OLD NEW ...]; before it: only='GLOB ...'
mutant() {
    local case=$1 program=single_$(basename "$2" .cpp) filter=$3 words=$4 globs=${only:-}
    [[ "$case $2 $filter $words" =~ $word ]] || return 0
    if [ -n "${isListing:-}" ]; then files+=("$2"); return 0; fi
    shift 4
    count=$((count + 1))
    local line="case $case: $words ($filter)"
    local changed=() compiled=() f said
    if ! build "$program" || { [ -z "${passed[$filter]:-}" ] && ! run "$program" "$filter"; }; then
        echo "NOT MEASURED  $line: it fails without the mutation, or does not build (exit $?)"
        status=1
        return
    fi
    passed[$filter]=1
    touch "$copy/mutated"
    while [ $# -gt 0 ]; do
        if [ ! -e "$copy/before/$1" ]; then
            changed+=("$1")
            mkdir -p "$copy/before/$(dirname "$1")"
            cp -p "$copy/$1" "$copy/before/$1"
        fi
        if ! swap "$1" "$2" "$3"; then
            echo "NOT MEASURED  $line: the formula is no longer there"
            status=1
            changedBack
            return
        fi
        shift 3
    done
    if [ -n "$globs" ]; then  # all but these keep what they were compiled from
        for f in "${changed[@]}"; do touch -r "$copy/before/$f" "$copy/$f"; done
        read -ra compiled < <(cd "$copy" && echo $globs)
        (cd "$copy" && touch "${compiled[@]}")
    fi
    if ! build "$program"; then
        echo "NOT MEASURED  $line: the naive formula does not compile"
        grep -m3 'error' "$copy/build.log"
        status=1
    elif run "$program" "$filter" 2>/dev/null; then
        echo "SURVIVED      $line"
        status=1
    else
        local code=$?
        said=$(grep -aA6 -m1 ': Failure' "$copy/run.log" | tail -n +2 | tr -s ' \n' ' ' | cut -c -150)
        [ -n "$said" ] || said="it stops with $code"
        echo "killed        $line: $(grep -ac ': Failure' "$copy/run.log") failures; $said"
    fi
    changedBack
}
changedBack() {
    rm -f "$copy/mutated"
    for f in "${changed[@]}"; do
        cp -p "$copy/before/$f" "$copy/$f"
        rm "$copy/before/$f"
        [ ${#compiled[@]} -gt 0 ] || touch "$copy/$f"
    done
    [ ${#compiled[@]} -eq 0 ] || (cd "$copy" && touch "${compiled[@]}")
}

mkdir -p "$copy"
rm -rf "$copy/mutated" "$copy/before"
refresh
write_compiler
files=()
isListing=1
source "$tree/tests/hard/mutations.list"
isListing=
[ ${#files[@]} -gt 0 ] || { echo "no mutation has '$word' in its line"; exit 2; }
unity=OFF
grep -qs '^CMAKE_UNITY_BUILD:[A-Z]*=ON' "$tree/build/CMakeCache.txt" && unity=ON
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$tree} CCACHE_NOHASHDIR=1
cmake -S "$copy" -B "$copy/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTIPPLE_GPU=OFF -DCMAKE_UNITY_BUILD=$unity \
    -DCCACHE="$copy/compiler" -DSTIPPLE_SINGLE_TESTS="$(printf '%s\n' "${files[@]}" | sort -u | paste -sd ';')" \
    >"$copy/configure.log" 2>&1 || { echo "the copy is not configured: $copy/configure.log"; exit 1; }
source "$tree/tests/hard/mutations.list"
echo "$count mutations"
exit $status
