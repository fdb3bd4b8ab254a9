#!/usr/bin/env bash
# Everything off against a build without effects: passes, bytes, pictures, and time beside that of the same program.
#
#     tests/bench/effects_off.sh WITH WITHOUT [ROUNDS]
#
# WITH, WITHOUT: programs, the second configured with -DSTIPPLE_EFFECTS=OFF. Every round (60) draws with WITH, WITH
# again and WITHOUT, in random order. Fails where effects that are off have a pass, a byte or another picture, or where
# the 99.9 % interval of what WITHOUT takes longer than WITH the second time, round by round, leaves 0 out.
set -euo pipefail
with=$(realpath "$1") without=$(realpath "$2") rounds=${3:-60}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$with" grow scan -o g.las --points 1M
"$with" build g.las -o g.stipple --quiet
python3 - "$with" "$without" "$rounds" <<'PYTHON'
import hashlib, json, random, statistics, subprocess, sys

with_, without, rounds = sys.argv[1], sys.argv[2], int(sys.argv[3])


def run(program, picture):
    command = [program, 'render', 'g.stipple', '-o', picture, '--size', '1920x1080', '--device', 'cpu', '--effects',
               'none', '--frames', '15', '--json', '--force', '--quiet']
    told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return told, hashlib.sha256(open(picture, 'rb').read()).hexdigest()


faults, times, pictures = [], {'A': [], "A'": [], 'B': []}, set()
for _ in range(rounds):
    order = list(times)
    random.shuffle(order)
    for name in order:
        told, picture = run(without if name == 'B' else with_, f'{name[0]}.png')
        times[name].append(told['frame_ms']['median'])
        pictures.add(picture)
        for effect in told['effects']:
            if effect['name'] in ('light', 'environment', 'refraction', 'transparency'):
                continue  # of every build: what surfaces send
            if effect['active'] or effect['passes'] or effect['bytes']:
                faults.append(f"{effect['name']}: {effect['passes']} passes, {effect['bytes']} bytes")
if len(pictures) != 1:
    faults.append('pictures differ')
print(f"{len(pictures)} picture, medians:", ', '.join(f'{n} {statistics.median(t):.2f} ms' for n, t in times.items()))


def interval(values, share=0.999, draws=20000):
    medians = sorted(statistics.median(random.choices(values, k=len(values))) for _ in range(draws))
    cut = int((1 - share) / 2 * draws)
    return medians[cut], medians[draws - 1 - cut]


def ratios(name):
    return [100 * (b / a - 1) for a, b in zip(times['A'], times[name])]


for name in ("A'", 'B'):
    least, most = interval(ratios(name))
    print(f'{name} against A: median {statistics.median(ratios(name)):+.2f} %, 99.9 % {least:+.2f} to {most:+.2f} %')
low, high = interval([b - a for a, b in zip(ratios("A'"), ratios('B'))])
if not low <= 0 <= high:
    faults.append("the times of B and A' differ: 99.9 % interval %+.2f to %+.2f %%" % (low, high))
print('\n'.join(sorted(set(faults))) or "off costs nothing that can be told from the same program's own spread")
sys.exit(1 if faults else 0)
PYTHON
