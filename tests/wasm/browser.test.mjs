// Runs the package in Chromium: in the page and in a worker, the results of all models are those of Node bit for bit, which
// results.test.mjs compares with native ones. Skipped without Chromium or the viewer's packages.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';

const { EBPO_PACKAGE: folder, EBPO_FILES: files = '', EBPO_ROOT: root, EBPO_VECTORS: vectors, EBPO_TEST_SCALE: scale = '0.05' } = process.env;
const playwright = join(root, 'tools/web/node_modules/playwright-core/index.mjs');
const browser = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
const models = files.split(' ').filter(Boolean).sort((a, b) => statSync(a).size - statSync(b).size);
if (!models.length)
  models.push(join(vectors, 'passed/06_four_levels_leaf_planes.ebpo.h5'));
const count = Math.max(200, Math.round(1e5 * scale));
const TYPES = { '.js': 'text/javascript', '.wasm': 'application/wasm', '.html': 'text/html' };

/** Serves the package at /, and a model at /models/INDEX by ranges. */
async function serve() {
  const server = createServer(({ url, headers }, response) => {
    if (url.startsWith('/models/')) {
      const model = readFileSync(models[url.slice(8)]), [, first, last] = /bytes=(\d+)-(\d+)/.exec(headers.range), end = Math.min(+last, model.length - 1);
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
async function evaluate({ module, name, model: address, count, whole }) {
  const library = await import(module), model = await library[name](address, { whole }), { origin, size } = model.info;
  let state = 3;
  const next = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const points = new Float64Array(3 * count).map((_, i) => origin[i % 3] + size[i % 3] * (1.2 * next() - 0.1));
  const rays = new Float64Array(6 * count).map((_, i) => i % 6 < 3 ? origin[i % 3] + size[i % 3] * next() : next() - 0.5);
  const parts = [await model.distance(points), model.info.solid ? await model.inside(points) : {}, await model.rays(rays), await model.raysAll(rays), { hit: await model.raysAny(rays) }];
  for (let i = 0; i < count; i += whole ? 1 : 50) {
    const point = points.subarray(3 * i, 3 * i + 3), { distance, face } = await model.nearest(point, { most: 3 });
    parts.push({ [`nearest ${i}`]: distance, [`face ${i}`]: face, [`box ${i}`]: await model.boxFaces(point, point.map((x, k) => x + size[k] / 100)) });
  }
  for await (const level of model.levels({ polygons: true }))
    parts.push({ planes: level.planes, vertices: level.vertices });
  model.dispose();
  const joined = {}; // results of each kind
  for (const [key, x] of parts.flatMap((part) => Object.entries(part)))
    (joined[key.split(' ')[0]] ??= []).push(new Uint8Array(x.buffer, x.byteOffset, x.byteLength));
  return Promise.all(Object.entries(joined).map(async ([key, x]) => [key, String(new Uint8Array(await crypto.subtle.digest('SHA-256', await new Blob(x).arrayBuffer())))]));
}

test('results in Chromium equal those in Node', { skip: !browser ? 'Chromium is missing' : !existsSync(playwright) && 'playwright-core is missing', timeout: 5400000 }, async () => {
  const { chromium } = await import(pathToFileURL(playwright)), { address, close } = await serve();
  const instance = await chromium.launch({ executablePath: browser, args: ['--no-sandbox'] });
  try {
    const page = await instance.newPage(), inNode = (name, query) => evaluate({ module: join(folder, name === 'open' ? 'index.js' : 'worker.js'), name, ...query });
    const inPage = (name, query) => page.evaluate(evaluate, { module: `${address}/${name === 'open' ? 'index.js' : 'worker.js'}`, name, ...query });
    await page.goto(address);
    for (const [i, file] of models.entries()) {
      const query = { model: `${address}/models/${i}`, count, whole: true };
      assert.deepEqual(await inPage('open', query), await inNode('open', query), file);
    }
    const part = { model: `${address}/models/0`, count: Math.ceil(count / 10), whole: false }, expected = await inNode('open', part);
    assert.deepEqual(await inNode('openInWorker', part), expected, 'worker of Node');
    for (const name of ['open', 'openInWorker'])
      assert.deepEqual(await inPage(name, part), expected, name);
  } finally {
    await instance.close();
    close();
  }
});
