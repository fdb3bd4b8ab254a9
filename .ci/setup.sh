# Sourced by ./run, ./test and .ci/run: goes to the project's folder and installs what .ci/packages.txt lists and the
# machine lacks (apt, as root or through sudo; elsewhere it names the packages and goes on).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }

# install_packages run|test|full: what running needs; what the tests need, too; what ./test --full needs, too.
install_packages() {
    local wanted missing=() before='^no such mark'
    [ "$1" = run ] && before='^# what the tests need'
    [ "$1" = test ] && before='^# only .\/test --full'
    wanted=$(sed "/$before/,\$d" .ci/packages.txt | grep -v '^#')
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

all_kernels='sse;avx2;avx512'
# build_program: what the first picture needs on this machine: what is not compiled keeps nobody waiting.
build_program() {
    local kernels=sse
    grep -qs avx2 /proc/cpuinfo && kernels=avx2
    grep -qs 'avx512bw.*avx512vl' /proc/cpuinfo && kernels=avx512
    [ -f build/build.ninja ] ||
        configure release -DBUILD_TESTING=OFF -DCMAKE_UNITY_BUILD=ON -DSTIPPLE_KERNELS=$kernels || return 1
    compile build --target stipple
}
# build_rest: for any machine, with the reader of OpenVDB files and the library for other programs.
build_rest() {
    grep -qs "^STIPPLE_KERNELS:STRING=$all_kernels" build/CMakeCache.txt ||
        configure release -DSTIPPLE_KERNELS="$all_kernels" || return 1
    compile build
}

# build_preset PRESET: all of it, with the tests.
build_preset() {
    local folder=build-$1
    [ "$1" = release ] && folder=build
    if [ ! -f "$folder/build.ninja" ] || grep -q '^BUILD_TESTING:BOOL=OFF' "$folder/CMakeCache.txt"; then
        configure "$1" -DBUILD_TESTING=ON -DSTIPPLE_KERNELS="$all_kernels" $([ "$1" = release ] && echo -DCMAKE_UNITY_BUILD=ON) || return 1
    fi
    compile "$folder"
}

# configure PRESET [cmake options]; compile FOLDER [cmake options]: quiet unless they fail.
configure() {
    local log
    log=$(mktemp)
    cmake --preset "$@" >"$log" 2>&1 || { cat "$log" >&2; return 1; }
    rm -f "$log"
}
compile() {
    if [ -t 2 ]; then cmake --build "$@" >&2; else cmake --build "$@" -- --quiet >&2; fi
}
