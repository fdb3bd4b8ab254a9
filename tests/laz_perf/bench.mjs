// Decoding speed here and in laz-perf, on the same files in one run; medians of five.
import { execFileSync } from 'node:child_process';
import path from 'node:path';
import { decode, describe } from './laz_perf.mjs';

const program = process.argv[2];
const data = process.env.STIPPLE_DATA;
const files = [
  '02_scans/forest_tls_TreeLS/pine_plot.laz',
  '02_scans/als_lasR_bcts/bcts_1.laz',
  '02_scans/ecef_itowns_potree_laz_12M/data/r',
  '02_scans/indoor_laz/indoor.laz',
  '02_scans/outcrop_rgb_cloudcompare/example_data.laz',
  '02_scans/forest_als_uas_tls_spanner/TLS_Clip.laz',
  '02_scans/pdal_testdata/copc/lone-star.copc.laz',
  '02_scans/copc/ellipsoid-1.4.laz',
  '02_scans/copc/autzen_test.copc.laz',
  '03_octrees/potree_lion/lion_takanawa.copc.laz',
];
const repeats = 5;
const median = (v) => v.sort((a, b) => a - b)[v.length >> 1];
const rate = (points, seconds) => (points / seconds / 1e6).toFixed(2);

console.log('| file | format | points | positions + colour, 1 core | 2 cores | everything, 1 core | laz-perf (wasm), 1 core | ratio |');
console.log('|---|---|---|---|---|---|---|---|');
for (const name of files) {
  const file = path.join(data, name);
  const ours = JSON.parse(execFileSync(program, ['bench', file, String(repeats)]).toString());
  let theirs = '-';
  let ratio = '-';
  if (name.endsWith('.laz')) {
    const times = [];
    for (let i = 0; i < repeats; ++i) {
      const start = process.hrtime.bigint();
      decode(file, false);
      times.push(Number(process.hrtime.bigint() - start) / 1e9);
    }
    theirs = rate(ours.points, median(times));
    ratio = (median(times) / ours.all_one_core_s).toFixed(1);
  }
  const format = name.endsWith('.laz') ? describe(file).format : 2;
  console.log(`| ${name} | ${format} | ${ours.points} | ${rate(ours.points, ours.colour_one_core_s)} | ` +
    `${rate(ours.points, ours.colour_two_cores_s)} | ${rate(ours.points, ours.all_one_core_s)} | ${theirs} | ${ratio} |`);
}
