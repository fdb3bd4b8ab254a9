#!/usr/bin/env bash
# No file above 600 lines, a README.md in every folder with sources, formatting as clang-format has it.
cd "$1" || exit 2
status=0
files=$(find engine lod streaming shaders apps tests -name '*.cpp' -o -name '*.h' -o -name '*.inl' -o -name '*.comp' -o -name '*.glsl')
long=$(wc -l $files | awk '$1 > 600 && $2 != "total"')
[ -z "$long" ] || { printf 'above 600 lines:\n%s\n' "$long"; status=1; }
for folder in $(dirname $files | sort -u); do
    [ -f "$folder/README.md" ] || [ -f "$(dirname "$folder")/README.md" ] || { echo "no README.md in $folder"; status=1; }
done
if command -v clang-format >/dev/null; then
    clang-format --dry-run -Werror $(printf '%s\n' $files | grep -E '\.(cpp|h)$') 2>&1 | grep -E 'error:' | head -20
    [ "${PIPESTATUS[1]}" -ne 0 ] || status=1
fi
exit $status
