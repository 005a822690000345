// Serves folders over HTTP with byte ranges (206), as Potree's loader needs. Only what the table of roots names is served.
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';

const kTypes = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json' };

/// roots   Map of URL prefix ('/data/0/') to folder
/// pages   Map of URL path to HTML text
/// returns {origin, ranges, close}: ranges() counts the answered range requests
export async function serve(roots, pages) {
    let ranges = 0;
    const find = (urlPath) => {
        for (const [prefix, folder] of roots) {
            if (!urlPath.startsWith(prefix)) continue;
            const file = path.resolve(folder, urlPath.slice(prefix.length));
            if (file.startsWith(path.resolve(folder) + path.sep) && fs.existsSync(file)) return file;
        }
        return null;
    };
    const server = http.createServer((request, response) => {
        const urlPath = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
        if (pages.has(urlPath)) {
            response.setHeader('content-type', 'text/html');
            return response.end(pages.get(urlPath));
        }
        const file = find(urlPath);
        if (!file || !fs.statSync(file).isFile()) return response.writeHead(404).end();
        const size = fs.statSync(file).size;
        response.setHeader('content-type', kTypes[path.extname(file)] ?? 'application/octet-stream');
        response.setHeader('accept-ranges', 'bytes');
        const wish = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? '');
        if (!wish) return fs.createReadStream(file).pipe(response);
        const start = Number(wish[1]);
        const end = wish[2] ? Math.min(Number(wish[2]), size - 1) : size - 1;
        if (start > end) return response.writeHead(416, { 'content-range': `bytes */${size}` }).end();
        ++ranges;
        response.writeHead(206, { 'content-range': `bytes ${start}-${end}/${size}`, 'content-length': end - start + 1 });
        fs.createReadStream(file, { start, end }).pipe(response);
    });
    await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
    return {
        origin: `http://127.0.0.1:${server.address().port}`,
        ranges: () => ranges,
        close: () => new Promise((done) => { server.closeAllConnections?.(); server.close(done); }),
    };
}
