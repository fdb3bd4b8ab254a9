#!/usr/bin/env bash
# tests/bench/rounds_figures.sh [PROGRAM]: the figures of out-of-core builds of triangles and curves, and of builds by several
# MPI ranks, as Markdown with the command of each. Needs an idle machine, ten minutes and 8 GB of disk. SCANS: see build_figures.sh.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$work"
report="\"%.1f s, peak %.0f MB, %.1f bytes each with all levels, %.2f GB of temporary files; seconds: \" % (d['seconds'], d['peak_rss_bytes']/1e6, d['bytes_out']/d['points_out'], d['temporary_bytes']/1e9) + \", \".join('%s %.1f' % (k, v) for k, v in d['stage_seconds'].items())"
cat >make.py <<'P'
# make.py ground EDGE OUT | scattered EDGE OUT | lawn CURVES OUT: a wavy ground as PLY (scattered: no face beside the one
# before), blades of 20 segments as hair.
import array, math, random, struct, sys
kind, n, out = sys.argv[1], int(sys.argv[2]), open(sys.argv[3], 'wb')
if kind != 'lawn':
    out.write(('ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n'
               'element face %d\nproperty list uchar int vertex_indices\nend_header\n' % (n * n, 2 * (n - 1) ** 2)).encode())
    across = [(0.3 * math.sin(i * 0.01), 0.02 * math.sin(i * 0.11), i * 0.01) for i in range(n)]
    for j in range(n):
        c, s = math.cos(j * 0.013), math.cos(j * 0.07)
        row = array.array('f')
        for a, b, x in across: row.extend((x, a * c + b * s + 0.002 * ((j * 7919) % 97) / 97, j * 0.01))
        row.tofile(out)
    faces = 2 * (n - 1) ** 2
    step = int(faces * 0.6180339887) | 1
    while math.gcd(step, faces) != 1: step += 2
    for f in range(faces if kind == 'scattered' else 0):
        square, half = divmod(f * step % faces, 2)
        k = square // (n - 1) * n + square % (n - 1)
        out.write(struct.pack('<Biii', 3, *((k + 1, k + n, k + n + 1) if half else (k, k + n, k + 1))))
    for j in range(0 if kind == 'scattered' else n - 1):
        k = j * n
        out.write(b''.join(struct.pack('<BiiiBiii', 3, k + i, k + i + n, k + i + 1, 3, k + i + 1, k + i + n, k + i + n + 1)
                           for i in range(n - 1)))
else:
    head = b'HAIR' + struct.pack('<IIIIfffff', n, n * 21, 2, 20, 0.004, 0, 0.3, 0.5, 0.2)
    out.write(head.ljust(128, b'\0'))
    rng = random.Random(3)
    for s in range(n):
        x, z, turn, length = 100 * rng.random(), 100 * rng.random(), 6.28 * rng.random(), 0.5 + rng.random()
        sn, cs, blade = math.sin(turn) * length, math.cos(turn) * length, array.array('f')
        for k in range(21):
            t = k / 20
            blade.extend((x + sn * t * t, 2 * length * t, z + cs * t * t))
        blade.tofile(out)
P
echo "# Figures of out-of-core builds of triangles and curves, and of several ranks, $(date +%F)"
echo
echo "Machine: $(machine). Warm page cache, output not synced."
echo
echo '| what | figure | command |'
echo '|---|---|---|'
for edge in 2238 5001; do
    python3 make.py ground $edge ground.ply
    size=$(($(stat -c %s ground.ply) / 1000000))
    for memory in 512M 1G 4G; do
        [ $edge = 2238 ] || [ $memory = 512M ] || continue
        json build build ground.ply -o s.stipple --memory $memory --quiet
        row "$((2 * (edge - 1) * (edge - 1) / 1000000))M triangles (PLY, $size MB, smooth normals estimated) at $memory" "$(value build.json "$report")" "tests/bench/rounds_figures.sh; stipple build ground.ply -o s.stipple --memory $memory --json"
    done
    rm ground.ply s.stipple
done
python3 make.py scattered 2238 ground.ply
for memory in 300M 2G; do
    json build build ground.ply -o s.stipple --memory $memory --quiet
    row "10M triangles, no face beside the one before, at $memory" "$(value build.json "$report")" "tests/bench/rounds_figures.sh; stipple build ground.ply -o s.stipple --memory $memory --json"
done
rm ground.ply s.stipple
for curves in 500000 2500000; do
    python3 make.py lawn $curves lawn.hair
    size=$(($(stat -c %s lawn.hair) / 1000000))
    for memory in 512M 4G; do
        [ $curves = 500000 ] || [ $memory = 512M ] || continue
        json build build lawn.hair -o s.stipple --memory $memory --quiet
        row "$((curves / 50000))M segments (hair, $size MB) at $memory" "$(value build.json "$report")" "tests/bench/rounds_figures.sh; stipple build lawn.hair -o s.stipple --memory $memory --json"
    done
    rm lawn.hair s.stipple
done
if command -v mpirun >/dev/null; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    if [ -e "${SCANS:-}/50.las" ]; then ln -s "$SCANS/50.las" 50.las; else "$program" grow scan -o 50.las --points 50000000 >/dev/null; fi
    python3 make.py ground 2238 ground.ply
    python3 make.py lawn 500000 lawn.hair
    for input in ground.ply lawn.hair; do
        for ranks in 1 2; do
            mpirun --oversubscribe --bind-to none -n $ranks "$program" build --mpi $input -o s.stipple --threads 1 --memory 1G --quiet --json >build.json
            row "10M $([ $input = ground.ply ] && echo triangles || echo segments), $ranks ranks of one thread" "$(value build.json "$report")" "mpirun -n $ranks stipple build --mpi $input -o s.stipple --threads 1 --memory 1G --json"
        done
    done
    for ranks in 1 2 4; do
        mpirun --oversubscribe --bind-to none -n $ranks "$program" build --mpi 50.las -o s.stipple --threads 1 --memory 1G --quiet --json >build.json
        row "50M points with normals, $ranks ranks of one thread" "$(value build.json "$report")" "mpirun -n $ranks stipple build --mpi 50.las -o s.stipple --threads 1 --memory 1G --json"
    done
fi
