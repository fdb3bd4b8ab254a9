#!/usr/bin/env bash
# tests/laz_perf/run.sh compare|bench BUILD_FOLDER: our LAZ reader beside laz-perf's, on the real files in $STIPPLE_DATA.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
what=$1
build=$(realpath "$2")
if [ ! -d "${STIPPLE_DATA:-}" ]; then
    echo "SKIPPED: laz_perf.$what needs real files: set STIPPLE_DATA" | tee -a "${STIPPLE_SKIP_FILE:-/dev/null}"
    exit 0
fi
mkdir -p "$build/laz_perf"
cp "$here"/package.json "$here"/*.mjs "$build/laz_perf/"
cd "$build/laz_perf"
[ -d node_modules/laz-perf ] || npm install --no-audit --no-fund --loglevel=error >&2
exec node "$what.mjs" "$build/tests/laz_records"
