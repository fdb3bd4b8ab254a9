// Every LAZ file must decode to the same records here and in laz-perf.
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import { decode, describe, lazFiles } from './laz_perf.mjs';

const program = process.argv[2];
const data = process.env.STIPPLE_DATA;
const out = path.resolve('records.bin');
// What laz-perf does not have: waveforms (item types 9 and 13) and other versions than 2 and 3.
const known = ({ items }) => items.every((i) => i.type !== 9 && i.type !== 13 && (i.version === 2 || i.version === 3));
let same = 0;
let skipped = 0;
let different = 0;
for (const folder of ['02_scans', '03_octrees']) {
  for (const file of lazFiles(path.join(data, folder))) {
    if (!known(describe(file))) {
      console.log(`not known to laz-perf: ${file}`);
      ++skipped;
      continue;
    }
    execFileSync(program, ['records', file, out]);
    if (Buffer.compare(fs.readFileSync(out), decode(file).records) === 0) {
      ++same;
    } else {
      console.log(`DIFFERENT: ${file}`);
      ++different;
    }
  }
}
fs.rmSync(out, { force: true });
console.log(`${same} files give the same records as laz-perf, ${different} differ, ${skipped} are not known to it`);
process.exit(different === 0 && same > 2000 ? 0 : 1);
