// Runs the package in Chromium: opening by URL, in the page and in a worker, gives the results of Node bit for bit. Skipped
// without Chromium or the viewer's packages.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';

const { EBPO_PACKAGE: folder, EBPO_FILES: files = '', EBPO_ROOT: root, EBPO_VECTORS: vectors } = process.env;
const playwright = join(root, 'tools/web/node_modules/playwright-core/index.mjs');
const browser = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
const file = files.split(' ').filter(Boolean).sort((a, b) => statSync(a).size - statSync(b).size)[0] ?? join(vectors, 'passed/06_four_levels_leaf_planes.ebpo.h5');
const TYPES = { '.js': 'text/javascript', '.wasm': 'application/wasm', '.html': 'text/html' };

/** Serves the package at /, and the file at /model.ebpo.h5 by ranges. */
async function serve() {
  const model = readFileSync(file);
  const server = createServer(({ url, headers }, response) => {
    if (url === '/model.ebpo.h5') {
      const [, first, last] = /bytes=(\d+)-(\d+)/.exec(headers.range), end = Math.min(+last, model.length - 1);
      response.writeHead(206, { 'content-range': `bytes ${first}-${end}/${model.length}`, etag: '"1"' }).end(model.subarray(+first, end + 1));
    } else if (url === '/') {
      response.writeHead(200, { 'content-type': 'text/html' }).end('<!doctype html><title>test</title>');
    } else {
      const path = join(folder, url);
      response.writeHead(existsSync(path) ? 200 : 404, { 'content-type': TYPES[extname(path)] ?? 'text/plain' }).end(existsSync(path) ? readFileSync(path) : '');
    }
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return { address: `http://127.0.0.1:${server.address().port}`, close: () => { server.close(); server.closeAllConnections(); } };
}

/** Returns names and SHA-256 of results; also runs in the page, so it uses nothing from outside. */
async function evaluate({ module, name, model: address, count }) {
  const library = await import(module), model = await library[name](address), { origin, size } = model.info;
  let state = 3;
  const next = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const points = new Float64Array(3 * count).map((_, i) => origin[i % 3] + size[i % 3] * (1.2 * next() - 0.1));
  const rays = new Float64Array(6 * count).map((_, i) => i % 6 < 3 ? origin[i % 3] + size[i % 3] * next() : next() - 0.5);
  const parts = [await model.distance(points), model.info.solid ? await model.inside(points) : {}, await model.rays(rays), await model.raysAll(rays)];
  for await (const level of model.levels({ polygons: true }))
    parts.push({ planes: level.planes, vertices: level.vertices });
  model.dispose();
  return Promise.all(parts.flatMap((part) => Object.entries(part).map(async ([key, x]) => [key, String(new Uint8Array(await crypto.subtle.digest('SHA-256', x)))])));
}

test('results in Chromium equal those in Node', { skip: !browser ? 'Chromium is missing' : !existsSync(playwright) && 'playwright-core is missing', timeout: 180000 }, async () => {
  const { chromium } = await import(pathToFileURL(playwright)), { address, close } = await serve();
  const instance = await chromium.launch({ executablePath: browser, args: ['--no-sandbox'] });
  try {
    const model = `${address}/model.ebpo.h5`, expected = await evaluate({ module: join(folder, 'index.js'), name: 'open', model, count: 2000 });
    assert.deepEqual(await evaluate({ module: join(folder, 'worker.js'), name: 'openInWorker', model, count: 2000 }), expected, 'worker of Node');
    const page = await instance.newPage();
    await page.goto(address);
    for (const [module, name] of [['index.js', 'open'], ['worker.js', 'openInWorker']])
      assert.deepEqual(await page.evaluate(evaluate, { module: `${address}/${module}`, name, model, count: 2000 }), expected, name);
  } finally {
    await instance.close();
    close();
  }
});
