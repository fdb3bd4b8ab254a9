#!/usr/bin/env bash
# Who may include whom (ARCHITECTURE, one direction). Fails with the offending lines.
cd "$1" || exit 2
status=0
# allow FOLDER REGEX [BUT]: includes of project headers in FOLDER, and not in BUT, must match REGEX.
allow() {
    local bad
    bad=$(grep -rnE '^#include "(engine|lod|streaming|shaders|apps|tests)/' "$1" --include='*.h' --include='*.cpp' --include='*.inl' | grep -vE "#include \"($2)/" | grep -v "^${3:-/}/")
    if [ -n "$bad" ]; then
        printf '%s may include only %s:\n%s\n' "$1" "$2" "$bad"
        status=1
    fi
}
allow shaders/shared 'shaders/shared'
allow engine/base 'engine/base|shaders/shared'
# Of lod's own rooms, `primitives` has the table of kinds, which names what each of the others does with a kind.
allow lod/primitives 'engine/base|shaders/shared|lod/(primitives|store|cut|verify)'
allow lod/store 'engine/base|shaders/shared|lod/(primitives|store)'
allow lod/cut 'engine/base|shaders/shared|lod/(primitives|store|cut)'
allow lod/verify 'engine/base|shaders/shared|lod/(primitives|store|cut|verify)'
allow lod/import 'engine/base|shaders/shared|lod'
allow lod/builder 'engine/base|shaders/shared|lod'
allow streaming 'engine/base|shaders/shared|lod|streaming'
allow engine/scene 'engine/base|engine/scene|shaders/shared|lod' engine/scene/open
allow engine/scene/open 'engine/(base|scene|render|image)|shaders/shared|lod|streaming'
allow engine/render 'engine/base|engine/render|engine/scene|shaders/shared|lod|streaming'
allow engine/cpu 'engine/base|engine/render|engine/cpu|shaders/shared|lod|streaming'
allow engine/gpu 'engine/base|engine/render|engine/gpu|shaders/shared|lod|streaming'
allow engine/reference 'engine/base|engine/render|engine/reference|shaders/shared|lod|streaming'
allow engine/image 'engine/base|engine/render|engine/image'
bad=$(grep -rlE 'vulkan/vulkan|GLFW/glfw3' engine lod streaming apps --include='*.h' --include='*.cpp' | grep -vE '^(engine/gpu|apps/examples)/')
[ -z "$bad" ] || { printf 'only engine/gpu may include Vulkan or GLFW:\n%s\n' "$bad"; status=1; }
bad=$(grep -rlE '\bstd::(mutex|condition_variable)\b' engine lod streaming apps --include='*.h' --include='*.cpp' | grep -vE '^engine/(base|gpu/device)')
[ -z "$bad" ] || { printf 'no mutex outside base (and the message list of the validation layer):\n%s\n' "$bad"; status=1; }
# Negative control: the check itself must be able to fail.
control=$(mktemp -d)
mkdir -p "$control/engine/base"
echo '#include "lod/store/store.h"' >"$control/engine/base/x.h"
(cd "$control" && grep -rnE '^#include "(engine|lod)/' engine/base --include='*.h' | grep -qvE '#include "(engine/base)/') || { echo 'the check cannot fail'; status=1; }
rm -rf "$control"
exit $status
