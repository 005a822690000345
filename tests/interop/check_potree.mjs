#!/usr/bin/env node
// Opens Potree 2.0 folders with potree-core in headless Chromium and compares what it saw with the files.
//   node check_potree.mjs FOLDER...     folders of the same cloud: DEFAULT and BROTLI must show the same sums
// Exit 0: every point was seen, inside its node, and the sums are right. 77: skipped, something is not installed. 1: wrong.
import fs from 'node:fs';
import path from 'node:path';
import url from 'node:url';
import { serve } from './data_server.mjs';

const kSkipped = 77;
const here = path.dirname(url.fileURLToPath(import.meta.url));
const modules = path.join(here, 'node_modules');

function skip(reason) {
    console.log(`skipped: ${reason}`);
    process.exit(kSkipped);
}

function find_chromium() {
    const named = process.env.CHROMIUM;
    return [named, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((file) => file && fs.existsSync(file));
}

/// The viewer keeps 8 bits of a color, and of numbers of 8 bytes their place between least and greatest.
const color_seen = (value) => value > 255 ? Math.floor(value / 256) : value;
const share_seen = (value, attribute, c) => (value - attribute.min[c]) / (attribute.max[c] - attribute.min[c] || 1);

/// Sums over octree.bin of a DEFAULT set, from the packed records alone: what any viewer must see.
function sums_of_records(folder) {
    const metadata = JSON.parse(fs.readFileSync(path.join(folder, 'metadata.json')));
    if (metadata.encoding !== 'DEFAULT') return null;
    const bytes = fs.readFileSync(path.join(folder, 'octree.bin'));
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    const record = metadata.attributes.reduce((sum, attribute) => sum + attribute.size, 0);
    const getters = { int8: 'getInt8', uint8: 'getUint8', int16: 'getInt16', uint16: 'getUint16', int32: 'getInt32',
                      uint32: 'getUint32', float: 'getFloat32', double: 'getFloat64' };
    const sums = {};
    let offset = 0;
    for (const attribute of metadata.attributes) {
        const is_color = attribute.name === 'rgb';
        const name = is_color ? 'rgba' : attribute.name;
        const sum = sums[name] = new Array(attribute.numElements).fill(0);
        for (let at = offset; at < bytes.length; at += record)
            for (let c = 0; c < attribute.numElements; ++c) {
                const value = view[getters[attribute.type]](at + c * attribute.elementSize, true);
                sum[c] += is_color ? color_seen(value) : attribute.elementSize > 4 ? share_seen(value, attribute, c) : value;
            }
        offset += attribute.size;
    }
    return sums;
}

/// The first sum that differs by more than float32 rounds, as text; null when all agree. Positions are counted in quanta
/// and pass through float32 relative to their node; a shift of all points by a tenth of a quantum would show.
function difference(expected, found, points) {
    for (const [name, sum] of Object.entries(expected)) {
        if (!found[name]) return `attribute '${name}' was not seen; seen: ${Object.keys(found).join(', ')}`;
        for (let c = 0; c < sum.length; ++c) {
            const slack = name === 'position' ? 0.1 * points + 2 ** -28 * sum[c] : 2 ** -22 * Math.max(points, Math.abs(sum[c]));
            if (!(Math.abs(sum[c] - found[name][c]) <= slack))
                return `attribute '${name}', component ${c}: sum ${found[name][c]}, ${sum[c]} expected`;
        }
    }
    return null;
}

function judge(report, errors, reference) {
    if (errors.length > 0) return errors[0];
    if (report.points !== report.expected) return `${report.points} of ${report.expected} points seen`;
    if (report.outside > 0) return `${report.outside} points outside their nodes`;
    return reference ? difference(reference, report.sums, report.points) : null;
}

const folders = process.argv.slice(2);
if (folders.length === 0) {
    console.error('usage: node check_potree.mjs FOLDER...');
    process.exit(2);
}
if (!fs.existsSync(path.join(modules, 'potree-core'))) skip(`no node_modules; run 'npm ci' in ${here}`);
const executable = find_chromium();
if (!executable) skip('no chromium; install it or name it in CHROMIUM');
const { chromium } = await import('playwright-core');

const roots = new Map(folders.map((folder, index) => [`/data/${index}/`, folder]));
roots.set('/modules/', modules);
const server = await serve(roots, new Map([['/', fs.readFileSync(path.join(here, 'potree_page.html'), 'utf8')]]));
const browser = await chromium.launch({ executablePath: executable, args: ['--no-sandbox', '--disable-gpu', '--disable-background-networking'] });
let reference = folders.map(sums_of_records).find((sums) => sums) ?? null;
let failed = false;
try {
    const page = await browser.newPage();
    const errors = [];
    page.on('pageerror', (error) => errors.push(String(error)));
    page.on('console', (message) => { if (message.type() === 'error' && !/favicon/.test(message.location().url)) errors.push(message.text()); });
    await page.goto(server.origin + '/');
    await page.waitForFunction('window.ready');
    for (const [index, folder] of folders.entries()) {
        const report = await page.evaluate((data) => window.check(data), `${server.origin}/data/${index}/`).catch((error) => {
            errors.push(String(error).split('\n')[0]);
            return { points: 0, sums: {} };
        });
        const fault = judge(report, errors, reference);
        reference ??= report.sums;
        console.log(`${fault ? 'FAILED' : 'ok'}: ${folder}: ${fault ?? `${report.points} points in ${report.nodes} nodes on ${report.levels} levels`}`);
        if (process.env.VERBOSE) console.log(JSON.stringify(report));
        failed ||= fault !== null;
    }
} finally {
    await browser.close();
    await server.close();
}
process.exit(failed ? 1 : 0);
