#!/usr/bin/env node
// Reads compressed files of strata's with decoders that others wrote: any LAZ with laz-perf from end to end, COPC with copc.js node by node.
//   node check_laz.mjs SOURCE.las FILE.laz...     files of the same points, in any order and in the same point format
// Exit 0: every record came, byte for byte, and lies in its node's cube. 77: skipped, something is not installed. 1: wrong.
import fs from 'node:fs';
import path from 'node:path';
import url from 'node:url';

const here = path.dirname(url.fileURLToPath(import.meta.url));
const [source, ...files] = process.argv.slice(2);
if (files.length === 0) {
    console.error('usage: node check_laz.mjs SOURCE.las FILE.laz...');
    process.exit(2);
}
if (!fs.existsSync(path.join(here, 'node_modules', 'copc'))) {
    console.log(`skipped: no copc in node_modules; run 'npm ci' in ${here}`);
    process.exit(77);
}
const { Copc } = await import('copc');
const { createLazPerf } = (await import('laz-perf')).default;
const perf = await createLazPerf({ locateFile: (name) => path.join(here, 'node_modules', 'laz-perf', 'lib', name) });

/// Counts records and adds up a hash of each: the same for the same records in any order.
class Tally {
    points = 0;
    sum = 0;
    add(bytes, begin, size) {
        let hash = 0x811c9dc5;
        for (let i = begin; i < begin + size; ++i) hash = Math.imul(hash ^ bytes[i], 0x01000193);
        this.sum = (this.sum + hash) >>> 0;
        ++this.points;
    }
    toString() { return `${this.points} points, hash ${this.sum.toString(16)}`; }
}

function tally_las(file) {
    const bytes = fs.readFileSync(file), view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), tally = new Tally();
    const offset = view.getUint32(96, true), size = view.getUint16(105, true), points = Number(view.getBigUint64(247, true));
    for (let i = 0; i < points; ++i) tally.add(bytes, offset + i * size, size);
    return tally;
}

function tally_laz(file) {
    const bytes = fs.readFileSync(file), tally = new Tally();
    const data = perf._malloc(bytes.length), laszip = new perf.LASZip();
    perf.HEAPU8.set(bytes, data);
    laszip.open(data, bytes.length);
    const size = laszip.getPointLength(), record = perf._malloc(size);
    for (let left = laszip.getCount(); left > 0; --left) {
        laszip.getPoint(record);
        tally.add(perf.HEAPU8, record, size);
    }
    laszip.delete();
    perf._free(record);
    perf._free(data);
    return tally;
}

async function tally_copc(file) {
    const tally = new Tally(), descriptor = fs.openSync(file, 'r');
    const getter = async (begin, end) => {
        const bytes = new Uint8Array(end - begin);
        fs.readSync(descriptor, bytes, 0, end - begin, begin);
        return bytes;
    };
    const copc = await Copc.create(getter), { cube } = copc.info, { scale, offset, pointDataRecordLength: size } = copc.header;
    const pages = [copc.info.rootHierarchyPage];
    while (pages.length > 0) {
        const page = await Copc.loadHierarchyPage(getter, pages.pop());
        pages.push(...Object.values(page.pages).filter((p) => p));
        for (const [key, node] of Object.entries(page.nodes)) {
            if (!node || node.pointCount === 0) continue;
            const [level, ...index] = key.split('-').map(Number), side = (cube[3] - cube[0]) / 2 ** level;
            const bytes = await Copc.loadPointDataBuffer(getter, copc.header, node), view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
            for (let at = 0; at < bytes.length; at += size) {
                tally.add(bytes, at, size);
                for (let axis = 0; axis < 3; ++axis) {
                    const place = view.getInt32(at + 4 * axis, true) * scale[axis] + offset[axis], low = cube[axis] + index[axis] * side;
                    if (place < low - scale[axis] || place > low + side + scale[axis]) throw new Error(`node ${key}: a point at ${place} on axis ${axis}`);
                }
            }
        }
    }
    return tally;
}

const expected = tally_las(source);
let failed = false;
for (const file of files) {
    const readers = file.endsWith('.copc.laz') ? { 'laz-perf': tally_laz, 'copc.js': tally_copc } : { 'laz-perf': tally_laz };
    for (const [name, tally_of] of Object.entries(readers)) {
        let found;
        try { found = String(await tally_of(file)); } catch (error) { found = String(error); }
        const good = found === String(expected);
        console.log(`${good ? 'ok' : 'FAILED'}: ${file} by ${name}: ${found}${good ? '' : `; ${expected} expected`}`);
        failed ||= !good;
    }
}
process.exit(failed ? 1 : 0);
