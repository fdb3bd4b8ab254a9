# Sourced by ./run, ./test and .ci/run: goes to the project's folder and installs what .ci/packages.txt lists and the
# machine lacks (apt, as root or through sudo; elsewhere it names the packages and goes on).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }

# install_packages [full]: without `full`, what follows the mark "only ./test --full" is left out.
install_packages() {
    local wanted missing=()
    wanted=$(if [ "${1:-}" = full ]; then cat .ci/packages.txt; else sed '/^# only .\/test --full/,$d' .ci/packages.txt; fi |
        grep -v '^#')
    if ! command -v dpkg-query >/dev/null; then
        say "This is not a Debian system. Stipple needs these packages (names as in Debian 12):"
        say "$(printf '%s ' $wanted)"
        return 0
    fi
    for package in $wanted; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' && continue
        command -v "$package" >/dev/null || missing+=("$package")  # a tool that came some other way will do
    done
    [ ${#missing[@]} -eq 0 ] && return 0
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            say "Please install as root: apt-get install ${missing[*]}"
            return 1
        fi
        as_root=(sudo)
    fi
    say "installing: ${missing[*]}"
    "${as_root[@]}" apt-get update -qq >&2
    DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# build PRESET [cmake options]: configures once, builds, quiet unless it fails.
build_preset() {
    local preset=$1 folder=build log
    log=$(mktemp)
    shift
    [ "$preset" = release ] || folder=build-$preset
    if [ ! -f "$folder/build.ninja" ] || [ $# -gt 0 ]; then
        cmake --preset "$preset" "$@" >"$log" 2>&1 || { cat "$log" >&2; return 1; }
        rm -f "$log"
    fi
    if [ -t 2 ]; then cmake --build "$folder" >&2; else cmake --build "$folder" -- --quiet >&2; fi
}
