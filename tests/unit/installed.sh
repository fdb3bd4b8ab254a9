#!/usr/bin/env bash
# installed.sh SOURCE BUILD: installs a build tree into a folder of its own and uses it from outside, as others do: the
# examples with find_package and with pkg-config, and a project that takes the sources in (configured only; built in
# ./test --full, with STIPPLE_BUILD_INCLUDED=1).
set -euo pipefail
source=$1 build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export XDG_CACHE_HOME=$work/cache
fail() { echo "installed.sh: $*" >&2; exit 1; }

cmake --install "$build" --prefix "$work/usr" >"$work/install.log" || { cat "$work/install.log"; exit 1; }
[ -z "$(find "$work/usr/include" -name '*.h' | xargs grep -lE '#include [<"](glm|tl/|engine|lod|fmt|nlohmann|CLI)')" ] ||
    fail 'public headers bring others along'
for header in "$work"/usr/include/stipple/*.h; do
    echo "#include <stipple/$(basename "$header")>" |
        g++ -std=c++20 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror -fsyntax-only -I"$work/usr/include" -x c++ - ||
        fail "$header does not stand alone"
done
lib=$(find "$work/usr" -name libstipple.so)
# What it shows are its own names, and what every program may have of the C++ library.
nm -DC --defined-only "$lib" >"$work/names"
grep -q 'stipple::v1::Renderer::render(' "$work/names" || fail 'no names are shown'
grep -E ' [TDB] ' "$work/names" | grep -vE ' (stipple::v1::|stipple_[a-z_]+$)' >"$work/others" && fail "other names are shown: $(head -5 "$work/others")"

# Away from the build tree: the module of pictures has to be found beside the library.
cp -r "$source/apps/examples" "$work/examples"
cmake -S "$work/examples" -B "$work/made" -DCMAKE_PREFIX_PATH="$work/usr" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CXX_FLAGS='-Wall -Wextra -Wconversion -Wshadow -Werror' >"$work/configure.log" || { cat "$work/configure.log"; exit 1; }
cmake --build "$work/made" >"$work/build.log" || { cat "$work/build.log"; exit 1; }
"$work/made/points" "$work/ball.stipple" 2>/dev/null | grep -q '1000000 points' || fail 'points: other numbers'
"$work/usr/bin/stipple" study --help | grep -q calibrate || fail "the program of studies is not found"
"$work/usr/bin/stipple" info --verify "$work/ball.stipple" >/dev/null || fail 'points: the store is not true'
"$work/made/picture" "$work/ball.stipple" "$work/a.png" | grep -q 'within' || fail 'picture'
"$work/usr/bin/stipple" render "$work/ball.stipple" -o "$work/b.png" --size 1280x720 --device cpu --quiet
cmp "$work/a.png" "$work/b.png" || fail 'picture: not what the program draws'
"$work/made/picture" "$work/none.ply" "$work/x.png" 2>"$work/said" && fail 'picture: of nothing'
grep -q 'none.ply' "$work/said" || fail "picture: $(cat "$work/said")"
PKG_CONFIG_PATH=$(dirname "$(find "$work/usr" -name stipple.pc)")
export PKG_CONFIG_PATH
# shellcheck disable=SC2046
cc -std=c99 -Wall -Wextra -Werror "$source/apps/examples/picture.c" $(pkg-config --cflags --libs stipple) -o "$work/picture_c"
LD_LIBRARY_PATH=$(dirname "$lib") "$work/picture_c" "$work/ball.stipple" "$work/c.png" | grep -q 'within' || fail 'picture.c'
"$work/usr/bin/stipple" render "$work/ball.stipple" -o "$work/d.png" --size 640x360 --device cpu --quiet
cmp "$work/c.png" "$work/d.png" || fail 'picture.c: not what the program draws'
if [ -x "$work/made/window" ] && command -v xvfb-run >/dev/null; then
    timeout 120 xvfb-run -a "$work/made/window" "$work/ball.stipple" 30 "$work/w.png" || fail 'window'
    "$work/usr/bin/stipple" render "$work/ball.stipple" -o "$work/v.png" --size 960x540 --device cpu --quiet
    "$work/usr/bin/stipple" compare "$work/w.png" "$work/v.png" --json | grep -q '"max_diff": 0' ||
        fail "window: not what the program draws: $("$work/usr/bin/stipple" compare "$work/w.png" "$work/v.png" --json)"
fi

# The sources within another project: nothing is forced on it.
mkdir "$work/host"
cat >"$work/host/CMakeLists.txt" <<END
cmake_minimum_required(VERSION 3.25)
project(host LANGUAGES C CXX)
add_subdirectory($source stipple)
add_executable(picture $source/apps/examples/picture.cpp)
target_link_libraries(picture PRIVATE stipple::stipple)
if(CMAKE_BUILD_TYPE OR CLI11_FOUND OR TARGET stipple OR TARGET api_tests OR TARGET stipple_window)
  message(FATAL_ERROR "the host gets what it did not ask for")
endif()
get_directory_property(options COMPILE_OPTIONS)
if(options)
  message(FATAL_ERROR "the host is compiled with \${options}")
endif()
END
cmake -S "$work/host" -B "$work/host/build" -G Ninja >"$work/host.log" 2>&1 || { cat "$work/host.log"; exit 1; }
ninja -C "$work/host/build" -t commands picture >"$work/plan" || fail 'the host cannot be built'
grep -q 'engine/api' "$work/plan" || fail 'the host does not build the library'
if [ "${STIPPLE_BUILD_INCLUDED:-0}" = 1 ]; then
    ninja -C "$work/host/build" picture >"$work/host.log" 2>&1 || { tail -50 "$work/host.log"; exit 1; }
    "$work/host/build/picture" "$work/ball.stipple" "$work/h.png" >/dev/null
    cmp "$work/h.png" "$work/b.png" || fail 'the host draws something else'
fi
