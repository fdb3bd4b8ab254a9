#!/usr/bin/env bash
# tests/hard/mutations.sh [WORD]: swaps the naive formulas of hard cases in, one at a time, and requires that the test
# that stands for the case then fails. In a copy of the tree (build/mutations), so that nothing of the tree is touched;
# every test is first seen to pass there. WORD: only the mutations in whose line it occurs. Prints a line each, with what
# the test says of the naive formula. Minutes for each change of a shared header: part of ./test --full.
set -u
tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
copy=$tree/build/mutations
word=${1:-}
status=0
count=0

refresh() {  # the tree's files as they are now; those that did not change keep their times
    local f
    while IFS= read -r -d '' f; do
        cmp -s "$tree/$f" "$copy/$f" && continue
        [ -f "$tree/$f" ] || continue
        mkdir -p "$copy/$(dirname "$f")"
        cp "$tree/$f" "$copy/$f"
    done < <(git -C "$tree" ls-files -z)
}
build() { ninja -C "$copy/build" "$@" >"$copy/build.log" 2>&1; }
run() {  # TARGET FILTER: the test's own exit code; 200 where no test of that name ran
    "$copy/build/tests/$1" --gtest_filter="$2" >"$copy/run.log" 2>&1
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
# CASE TARGET FILTER WORDS FILE OLD NEW [FILE OLD NEW ...]
mutant() {
    local case=$1 target=$2 filter=$3 words=$4
    shift 4
    [[ "$case $target $filter $words" == *"$word"* ]] || return 0
    count=$((count + 1))
    local line="case $case: $words ($filter)"
    local said files=()
    if ! build "$target" || ! run "$target" "$filter"; then
        echo "NOT MEASURED  $line: it fails without the mutation, or does not build (exit $?)"
        status=1
        return
    fi
    while [ $# -gt 0 ]; do
        files+=("$1")
        swap "$1" "$2" "$3" || { echo "NOT MEASURED  $line: the formula is no longer there"; status=1; refresh; return; }
        shift 3
    done
    if ! build "$target"; then
        echo "NOT MEASURED  $line: the naive formula does not compile"
        grep -m3 'error' "$copy/build.log"
        status=1
    elif run "$target" "$filter"; then
        echo "SURVIVED      $line"
        status=1
    else
        said=$(grep -aA6 -m1 ': Failure' "$copy/run.log" | tail -n +2 | tr -s ' \n' ' ' | cut -c -150)
        echo "killed        $line: $(grep -ac ': Failure' "$copy/run.log") failures; $said"
    fi
    for f in "${files[@]}"; do cp "$tree/$f" "$copy/$f"; done
}

refresh
cmake -S "$copy" -B "$copy/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS=-w -DSTIPPLE_GPU=OFF \
    -DCMAKE_CXX_COMPILER_LAUNCHER="$(command -v ccache || true)" >"$copy.log" 2>&1 ||
    { echo "the copy is not configured: $copy.log"; exit 1; }
source "$tree/tests/hard/mutations.list"
[ $count -gt 0 ] || { echo "no mutation has '$word' in its line"; exit 2; }
echo "$count mutations"
exit $status
