#!/usr/bin/env bash
# Every test that README.md names exists; all 58 cases have a row. Prints what is missing.
cd "$1" || exit 2
status=0
exists() { grep -rqE "^TEST(_F|_P)?\(${1%.*}, ${1#*.}\)" tests --include='*_test.cpp'; }
for name in $(grep -oE '`[A-Za-z]+\.[A-Z][A-Za-z0-9]+`' tests/hard/README.md | tr -d '`' | sort -u); do
    exists "$name" || { echo "tests/hard/README.md names a test that is not there: $name"; status=1; }
done
rows=$(grep -cE '^\| [0-9]+ \|' tests/hard/README.md)
[ "$rows" -eq 58 ] || { echo "tests/hard/README.md has $rows cases, not 58"; status=1; }
exists Cut.ThereIsNoTestOfThisName && { echo 'the check cannot fail'; status=1; }
exit $status
