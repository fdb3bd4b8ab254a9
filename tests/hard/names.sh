#!/usr/bin/env bash
# Every test that README.md names exists; all 58 cases have a row, and a naive formula in mutations.list that still
# stands in the tree, or are said not to need one. Prints what is missing.
cd "$1" || exit 2
status=0
exists() { grep -rqE "^TEST(_F|_P)?\(${1%.*}, ${1#*.}\)" tests --include='*_test.cpp'; }
for name in $(grep -oE '`[A-Za-z]+\.[A-Z][A-Za-z0-9]+`' tests/hard/README.md | tr -d '`' | sort -u); do
    exists "$name" || { echo "tests/hard/README.md names a test that is not there: $name"; status=1; }
done
rows=$(grep -cE '^\| [0-9]+ \|' tests/hard/README.md)
[ "$rows" -eq 58 ] || { echo "tests/hard/README.md has $rows cases, not 58"; status=1; }
exists Cut.ThereIsNoTestOfThisName && { echo 'the check cannot fail'; status=1; }

hasMutation() { grep -qE "mutant $1 [a-z]+/|\\(case $1\\)" tests/hard/mutations.list; }
for case in $(seq 1 58); do
    grep -qE "^\\| $case \\|.*\\| not needed: " tests/hard/README.md || hasMutation "$case" ||
        { echo "tests/hard/mutations.list has nothing of case $case"; status=1; }
done
hasMutation 59 && { echo 'the check of cases cannot fail'; status=1; }
tests/hard/mutations.sh --check || status=1
# Lists that are wrong are found to be: each differs from the first one in one thing.
planted=$(mktemp)
check() { echo "$1" >"$planted" && LIST=$planted tests/hard/mutations.sh --check >/dev/null 2>&1; }
right="mutant 1 hard/transforms_test.cpp 'Transforms.SixtyFour*' 'of names.sh' engine/base/rng.h '#pragma once' ''"
check "$right" || { echo 'a right list is refused'; status=1; }
while IFS= read -r wrong; do
    check "$wrong" && { echo "not refused: $wrong"; status=1; }
done <<END
${right/pragma once/pragma twice}
${right/pragma once/}
${right/rng.h/no_such.h}
${right/hard\/transforms/hard/no_such}
${right/SixtyFour/SixtyFive}
only='tests/no_such*.cpp' $right
${right% ??}
${right% ??} '#pragma once'
${right% engine*}
$right engine/base/rng.h '#pragma once' ''
$right '
END
rm "$planted"
exit $status
