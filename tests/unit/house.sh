#!/usr/bin/env bash
# No file above 600 lines (above 500: said), no function above 80, a README.md in every folder with sources,
# formatting as clang-format has it, and lines of at most 120 columns where it does not look (.inl).
cd "$1" || exit 2
status=0
files=$(find engine lod streaming shaders apps tests -name '*.cpp' -o -name '*.h' -o -name '*.inl' -o -name '*.comp' -o -name '*.glsl')
long=$(wc -l $files | awk '$1 > 600 && $2 != "total"')
[ -z "$long" ] || { printf 'above 600 lines:\n%s\n' "$long"; status=1; }
wc -l $files | awk '$1 > 500 && $2 != "total" { print "note: above 500 lines: " $2 ", " $1 }'
# The functions that are to be cut yet; what is cut is struck from the list, and nothing is added to it. (renderFrame
# and buildStore are the two that may be long.)
known=''
count_functions() { awk -f tests/unit/function_lines.awk "$@"; }
[ "$(count_functions tests/unit/function_lines_sample.txt | tr '\n' ';')" = "$(head -1 tests/unit/function_lines_sample.txt | sed 's/^# //')" ] ||
    { echo "function_lines.awk does not count what it should:"; count_functions tests/unit/function_lines_sample.txt; status=1; }
long=$(count_functions $files | awk -v known="$(echo $known)" '
    BEGIN { n = split(known, names, " "); for (i = 1; i <= n; ++i) left[names[i]] = 1 }
    $2 > 80 && $3 !~ /(^|:)(renderFrame|buildStore)$/ {
        split($1, at, ":"); name = $3; sub(/^.*::/, "", name); key = at[1] ":" name
        if (key in left) delete left[key]; else print $1 " " name ": " $2 " lines"
    }
    END { for (key in left) print key ": is no longer above 80 lines: strike it from the list in house.sh" }')
[ -z "$long" ] || { printf 'functions above 80 lines:\n%s\n' "$long"; status=1; }
for folder in $(dirname $files | sort -u); do
    [ -f "$folder/README.md" ] || [ -f "$(dirname "$folder")/README.md" ] || { echo "no README.md in $folder"; status=1; }
done
wide=$(printf '%s\n' $files | grep -E '\.inl$' | xargs awk 'length > 120 { print FILENAME ":" FNR ": " length }')
[ -z "$wide" ] || { printf 'above 120 columns:\n%s\n' "$wide"; status=1; }
if command -v clang-format >/dev/null; then
    clang-format --dry-run -Werror $(printf '%s\n' $files | grep -E '\.(cpp|h)$') 2>&1 | grep -E 'error:' | head -20
    [ "${PIPESTATUS[1]}" -ne 0 ] || status=1
fi
exit $status
