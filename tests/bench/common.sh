# What the figure scripts share: sourced, not run. `program` is the first argument of the script.
program=$(realpath "${1:-build/stipple}")
data=${STIPPLE_DATA:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

value() { python3 -c "import json,sys; d=json.load(open('$1')); print($2)"; }
row() { printf '| %s | %s | `%s` |\n' "$1" "$2" "$3"; }
json() { # json NAME COMMAND...: runs stipple and keeps its JSON
    local name=$1
    shift
    "$program" "$@" --json >"$name.json" 2>/dev/null
}
machine() { echo "$(grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //'), $(nproc) cores, no GPU"; }
