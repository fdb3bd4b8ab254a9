// laz-perf as a function from a file to its records.
import fs from 'node:fs';
import path from 'node:path';
import createLazPerf from 'laz-perf/lib/node/laz-perf.js';

const library = await createLazPerf();
// The library's own handler prints its whole source.
process.removeAllListeners('uncaughtException');
process.on('uncaughtException', (error) => {
  console.error(error.message ?? error);
  process.exit(1);
});

/** All records of a LAZ file; `keep` false: decodes them and throws them away. */
export function decode(file, keep = true) {
  const bytes = fs.readFileSync(file);
  const input = library._malloc(bytes.length);
  library.HEAPU8.set(bytes, input);
  const reader = new library.LASZip();
  reader.open(input, bytes.length);
  const count = reader.getCount();
  const size = reader.getPointLength();
  const point = library._malloc(size);
  const out = keep ? Buffer.alloc(count * size) : null;
  for (let i = 0; i < count; ++i) {
    reader.getPoint(point);
    if (keep) out.set(library.HEAPU8.subarray(point, point + size), i * size);
  }
  library._free(point);
  library._free(input);
  reader.delete();
  return { count, records: out };
}

/** Every file below `folder` whose name ends in .laz. */
export function lazFiles(folder) {
  return fs.readdirSync(folder, { recursive: true })
    .filter((name) => name.toLowerCase().endsWith('.laz'))
    .map((name) => path.join(folder, name))
    .sort();
}

/** Point format, and type and version of each item of the compression. */
export function describe(file) {
  const b = fs.readFileSync(file);
  const format = b[104] & 63;
  let at = b.readUInt16LE(94);
  for (let i = b.readUInt32LE(100); i > 0; --i) {
    if (b.readUInt16LE(at + 18) === 22204) {
      const p = at + 54;
      const items = [];
      for (let k = 0; k < b.readUInt16LE(p + 32); ++k) {
        items.push({ type: b.readUInt16LE(p + 34 + 6 * k), version: b.readUInt16LE(p + 38 + 6 * k) });
      }
      return { format, items };
    }
    at += 54 + b.readUInt16LE(at + 20);
  }
  return { format, items: [] };
}
