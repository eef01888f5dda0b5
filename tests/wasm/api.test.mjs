// Tests the interface of the package: sources, errors, cancelling, limits, workers and pairs.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import test from 'node:test';

const { EBPO_PACKAGE: folder, EBPO_VECTORS: vectors, EBPO_FILES: files = '' } = process.env;
const library = await import(join(folder, 'index.js')), { openView } = await import(join(folder, 'view.js'));
const { open, EbpoAbsentError, EbpoArgumentError, EbpoError, EbpoFormatError, EbpoLimitError, EbpoPendingError, EbpoReadError } = library;
const small = readFileSync(join(vectors, 'passed/06_four_levels_leaf_planes.ebpo.h5'));
const large = files.split(' ').filter(Boolean).sort((a, b) => statSync(b).size - statSync(a).size)[0], largeBytes = large && readFileSync(large);

/** Serves bytes; `change` may alter status, headers and body of a response. */
async function serve(bytes, change = (x) => x) {
  const seen = [], secrets = [];
  const server = createServer(({ headers }, response) => {
    secrets.push(headers.secret);
    const [, first, last] = /bytes=(\d+)-(\d+)/.exec(headers.range), end = Math.min(+last, bytes.length - 1);
    seen.push([+first, end]);
    const { status, headers: sent, body } = change({ status: 206, body: bytes.subarray(+first, end + 1),
      headers: { 'content-range': `bytes ${first}-${end}/${bytes.length}`, etag: '"1"' } }, seen.length);
    response.writeHead(status, sent).end(body);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return { url: `http://127.0.0.1:${server.address().port}/m.ebpo.h5`, seen, secrets, close: () => server.close() };
}

async function withServer(bytes, change, use) {
  const server = await serve(bytes, change);
  try {
    await use(server);
  } finally {
    server.close();
  }
}

test('a URL, a Blob, an ArrayBuffer, a typed array and a source give equal results', () => withServer(small, undefined, async ({ url }) => {
  const source = { size: small.length, read: async (ranges) => ranges.map(({ offset, size }) => Uint8Array.from(small.subarray(offset, offset + size))) };
  const buffer = Uint8Array.from(small).buffer, results = [];
  for (const from of [url, new URL(url), new Blob([small]), buffer, small, source])
    for (const whole of [true, false]) {
      const model = await open(from, { whole });
      results.push(JSON.stringify([model.info, await model.distance([0.1, 0.1, 0.1]), await model.measure(), await model.mesh()]));
      model.dispose();
    }
  assert.equal(new Set(results).size, 1);
}));

test('servers that break the rules are errors', async () => {
  const cases = [
    [(r) => ({ ...r, status: 200 }), /does not support range requests/],
    [(r) => ({ ...r, status: 404 }), /status 404/],
    [(r) => ({ ...r, headers: { etag: '"1"' } }), /Content-Range/],
    [(r) => ({ ...r, headers: { ...r.headers, 'content-range': `bytes 1-${r.body.length}/${small.length}` } }), /sent bytes 1 to/],
    [(r) => ({ ...r, headers: { 'content-range': r.headers['content-range'] } }), /neither ETag nor Last-Modified/],
  ];
  for (const [change, message] of cases)
    await withServer(small, change, ({ url }) => assert.rejects(open(url), (error) => error instanceof EbpoReadError && message.test(error.message)));
  await withServer(small, (r) => ({ ...r, headers: { 'content-range': r.headers['content-range'] } }), async ({ url }) =>
    (await open(url, { unversioned: true })).dispose());
});

test('a request that fails once is repeated', () => withServer(small, (r, n) => n === 1 ? { ...r, status: 503 } : r, async ({ url }) => {
  (await open(url)).dispose();
}));

test('redirects are followed, without headers to other origins', () => withServer(small, undefined, async ({ url, secrets }) => {
  const seen = [], server = createServer(({ headers, url: path }, response) => {
    seen.push([path, headers.secret]);
    response.writeHead(302, { location: path === '/a' ? '/b' : path === '/b' ? url : '/loop' }).end();
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const address = `http://127.0.0.1:${server.address().port}`;
  try {
    const model = await open(`${address}/a`, { headers: { secret: 'x' } });
    assert.equal(model.info.faces, (await open(small)).info.faces);
    model.dispose();
    assert.deepEqual([[...new Set(seen.map(String))], [...new Set(secrets)]], [['/a,x', '/b,x'], [undefined]]);
    await assert.rejects(open(`${address}/loop`), (error) => error instanceof EbpoReadError && /redirects/.test(error.message));
  } finally {
    server.close();
  }
}));

test('a file that changes is an error', { skip: !large }, () => withServer(largeBytes, (r, n) => n > 2 ? { ...r, headers: { ...r.headers, etag: '"2"' } } : r,
  ({ url }) => assert.rejects(open(url).then((model) => model.check()), (error) => error instanceof EbpoReadError && /has changed/.test(error.message))));

test('a query by URL needs few bytes, and all its ranges are requested together', { skip: !large }, () => withServer(largeBytes, undefined, async ({ url, seen }) => {
  const model = await open(url), { origin, size } = model.info;
  await model.inside(origin.map((x, i) => x + size[i] / 3));
  const bytes = seen.reduce((sum, [first, last]) => sum + last - first + 1, 0);
  assert.ok(bytes < largeBytes.length, `${bytes} of ${largeBytes.length} bytes`);
  model.dispose();
}));

test('synchronous queries throw while bytes are missing', { skip: !large }, async () => {
  const model = await open(new Blob([largeBytes])), { origin, size } = model.info, point = origin.map((x, i) => x + size[i] * 0.4);
  if (!model.stats.resident)
    assert.throws(() => model.raysSync([...origin, ...size]), EbpoPendingError);
  const expected = await model.distance(point);
  assert.deepEqual(model.distanceSync(point), expected);
  model.dispose();
});

test('one point or ray a call gives the results of batches', async () => {
  const model = await open(large ? largeBytes : small), { origin, size } = model.info, inputs = [];
  for (let i = 0; i < 200; i++)
    inputs.push([0.37, 0.59, 0.73, 0.41, 0.67, 0.83].map((x, k) => k < 3 ? origin[k] + size[k] * (1.2 * (i * x % 1) - 0.1) : i * x % 1 - 0.487));
  const points = inputs.map((x) => x.slice(0, 3)), each = (query, list, n) => list.map((x, i) => n ? query.call(model, [...x, ...list[(i + 1) % 200]]) : query.call(model, x));
  const first = (result) => Object.fromEntries(Object.entries(result).map(([name, x]) => [name, x.slice(0, x.length / 2)]));
  for (const options of [{}, { level: 2 }, { unsigned: true, maxDistance: size[0] / 20 }])
    for (const query of [model.distanceSync, model.insideSync])
      assert.deepEqual(each((x) => query.call(model, x, options), points), each((x) => query.call(model, x, options), points, 2).map(first));
  for (const options of [{}, { sides: 'front', tMax: size[0] }, { sides: 'back' }])
    assert.deepEqual(each((x) => model.raysSync(x, options), inputs), each((x) => model.raysSync(x, options), inputs, 2).map(first));
  assert.throws(() => model.insideSync([0, 0, NaN]), EbpoArgumentError);
  assert.throws(() => model.distanceSync([0, 0, 0], { maxDistance: -1 }), EbpoArgumentError);
  assert.throws(() => model.raysSync([0, 0, 0, 0, 0, 0]), EbpoArgumentError);
  assert.throws(() => model.raysSync([0, 0, 0, 0, 0, 1], { sides: 'left' }), EbpoArgumentError);
  model.dispose();
  assert.throws(() => model.insideSync([0, 0, 0]), EbpoError);
});

test('after a trap, the module is not called again', async () => {
  const [{ Heap }, { OneQuery }] = await Promise.all(['heap.js', 'one.js'].map((name) => import(join(folder, name)))), names = ['malloc', 'ebpo_js_inside_one'];
  const module = await WebAssembly.compile(Uint8Array.from([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0, // malloc returns 16, ebpo_js_inside_one traps
    1, 15, 2, 0x60, 1, 0x7f, 1, 0x7f, 0x60, 5, 0x7f, 0x7c, 0x7c, 0x7c, 0x7f, 1, 0x7f, 3, 3, 2, 0, 1,
    7, 31, 2, ...names.flatMap((name, i) => [name.length, ...new TextEncoder().encode(name), 0, i]), 10, 10, 2, 4, 0, 0x41, 16, 0x0b, 3, 0, 0, 0x0b]));
  const heap = new Heap(module), query = new OneQuery(heap, 0);
  for (const call of [() => query.inside([0n, 0, 0], -1), () => query.distance([0, 0, 0], -1, 1n, 0), () => query.ray([0, 0, 0, 0, 0, Symbol('z')], 1, 0)])
    assert.throws(call, TypeError); // the module was not called, and can still be used
  assert.throws(() => query.inside([0, 0, 0], -1), (error) => error instanceof EbpoError && /failed in ebpo_js_inside_one/.test(error.message));
  for (const call of [() => query.inside([0, 0, 0], -1), () => heap.call('malloc', 8)])
    assert.throws(call, (error) => error.status === 'EBPO_E_INTERNAL' && /has failed before/.test(error.message));
});

test('invalid arguments are errors', async () => {
  const model = await open(small);
  await assert.rejects(model.inside([0, 0]), EbpoArgumentError);
  await assert.rejects(model.inside([0, 0, NaN]), EbpoArgumentError);
  await assert.rejects(model.rays([0, 0, 0, 0, 0, 0]), EbpoArgumentError);
  await assert.rejects(model.rays([0, 0, 0, 0, 0, 1], { sides: 'left' }), EbpoArgumentError);
  await assert.rejects(model.boxFaces([1, 1, 1], [0, 0, 0]), EbpoArgumentError);
  await assert.rejects(model.level(99), EbpoError);
  await assert.rejects(open(42), EbpoArgumentError);
  await assert.rejects(open(new Uint8Array(5000)), EbpoFormatError);
  assert.equal((await model.distance([0, 0, 0])).face.length, 1); // the model is still usable
  assert.equal((await model.inside([])).where.length, 0);
  model.dispose();
  await assert.rejects(model.inside([0, 0, 0]), EbpoError);
  model.dispose();
});

test('signals cancel opening and queries', { skip: !large }, async () => {
  await assert.rejects(open(small, { signal: AbortSignal.abort() }), { name: 'AbortError' });
  const controller = new AbortController(), slow = { size: largeBytes.length,
    read: (ranges, signal) => new Promise((resolve, reject) => { signal.addEventListener('abort', () => reject(signal.reason)); }) };
  setTimeout(() => controller.abort(), 20);
  await assert.rejects(open(slow, { signal: controller.signal }), { name: 'AbortError' });
  const model = await open(largeBytes), points = new Float64Array(3e6), during = new AbortController();
  setTimeout(() => during.abort(), 20);
  await assert.rejects(model.distance(points, { signal: during.signal }), { name: 'AbortError' });
  assert.equal((await model.distance([0, 0, 0])).distance.length, 1);
  model.dispose();
});

test('queries at the same time give the results of queries one by one', { skip: !large }, async () => {
  const model = await open(new Blob([largeBytes])), { origin, size } = model.info;
  const points = Array.from({ length: 30 }, (_, i) => origin.map((x, k) => x + size[k] * ((i * (k + 3) * 0.137) % 1)));
  const together = await Promise.all(points.flatMap((p) => [model.distance(p), model.rays([...p, 1, 0.3, 0.2])]));
  for (let i = 0; i < points.length; i++) {
    assert.deepEqual(await model.distance(points[i]), together[2 * i]);
    assert.deepEqual(await model.rays([...points[i], 1, 0.3, 0.2]), together[2 * i + 1]);
  }
  model.dispose();
});

test('a budget limits memory, and a heap that is too small is an error', { skip: !large }, async () => {
  const model = await open(largeBytes), points = new Float64Array(3000).map((_, i) => model.info.origin[i % 3] + model.info.size[i % 3] * ((i * 0.618) % 1));
  const expected = await model.distance(points), { memory } = model.stats;
  const part = await open(new Blob([largeBytes]), { memory: Math.ceil(memory / 2) });
  assert.deepEqual(await part.distance(points), expected);
  assert.ok(part.stats.memoryPeak <= Math.ceil(memory / 2));
  part.dispose();
  model.dispose();
  for (let heap = 9 << 20; heap < memory; heap *= 1.3)
    await assert.rejects(open(largeBytes, { heap }), (error) => error instanceof EbpoLimitError && error.status === 'EBPO_E_MEMORY', `heap of ${heap} bytes`);
});

test('a worker gives equal results and errors', async () => {
  const { openInWorker } = await import(join(folder, 'worker.js'));
  const model = await open(small), worker = await openInWorker(small);
  assert.deepEqual(worker.info, model.info);
  assert.deepEqual(await worker.distance([0.1, 0.2, 0.3]), await model.distance([0.1, 0.2, 0.3]));
  const levels = [];
  for await (const level of worker.levels())
    levels.push(level.planes.length);
  assert.equal(levels.length, model.info.levels.length);
  assert.deepEqual(await worker.subtree(1n, { levels: 1 }), await model.subtree(1n, { levels: 1 }));
  await assert.rejects(worker.inside([NaN, 0, 0]), EbpoArgumentError);
  worker.dispose();
  model.dispose();
  await assert.rejects(openInWorker(new Uint8Array(5000)), EbpoFormatError);
});

const vector = (name) => open(readFileSync(join(vectors, `passed/${name}.ebpo.h5`)));

test('attributes are in the order of the mesh, and by name', async () => {
  const model = await vector('39_attributes'), { info } = model, { vertex, face } = await model.maps();
  assert.ok(info.attributes.length > 3);
  for (const { element, names, list } of info.attributes)
    for (const name of names.split(' ')) {
      const sorted = await model.attribute(`${element}:${name}`), plain = await model.attribute(`${element}:${name}`, { order: 'file' }), sources = { vertex, face }[element];
      const rows = ({ values, ends, columns }) => ends ? [...ends].map((end, i) => [...values.subarray(ends[i - 1] ?? 0, end)])
        : Array.from({ length: values.length / columns }, (_, i) => [...values.subarray(columns * i, columns * i + columns)]);
      const order = sources && [...sources.keys()].sort((a, b) => sources[a] - sources[b]);
      assert.deepEqual(rows(sorted), order ? order.map((i) => rows(plain)[i]) : rows(plain), name);
      assert.ok(list || sorted.columns === 1);
    }
  const [inFile, inSource] = [await model.mesh({ order: 'file' }), await model.mesh()];
  face.forEach((source, i) => assert.deepEqual([...inFile.faces.subarray(3 * i, 3 * i + 3)].map((v) => vertex[v]), [...inSource.faces.subarray(3 * source, 3 * source + 3)]));
  const corners = await model.corners([2, 0]);
  assert.deepEqual([...corners], [2, 0].flatMap((f) => [...inFile.faces.subarray(3 * f, 3 * f + 3)].flatMap((v) => [...inFile.vertices.subarray(3 * v, 3 * v + 3)])));
  await assert.rejects(model.corners([info.faces]), EbpoArgumentError);
  const bare = await vector('08_without_mesh');
  await assert.rejects(bare.corners([0]), EbpoAbsentError);
  await assert.rejects(bare.attribute('vertex:red'), EbpoAbsentError);
  const view = await openView(readFileSync(join(vectors, 'passed/08_without_mesh.ebpo.h5')));
  await assert.rejects(view.leafFaces([{ level: 0, group: 0, octant: 0, subtree: -1 }]), EbpoAbsentError);
  view.dispose();
  bare.dispose();
  await assert.rejects(model.attribute('taste'), (error) => error instanceof EbpoAbsentError && /vertex:/.test(error.message));
  await assert.rejects(model.mesh({ order: 'size' }), EbpoArgumentError);
  await assert.rejects(model.sample('taste', [0, 0, 0], [0]), EbpoAbsentError);
  await assert.rejects(model.sample('taste', [0, 0, 0], []), EbpoArgumentError);
  const plain = info.attributes.find(({ element, list }) => element === 'face' && !list), name = plain.names.split(' ')[0], { values } = await model.attribute(`face:${name}`);
  const samples = await model.sample(`face:${name}`, [0, 0, 0, 0, 0, 0], [1, library.NO_FACE]);
  assert.deepEqual([...samples], [values[1], NaN]);
  model.dispose();
});

test('textures have names, uses, digests and bytes', async () => {
  const model = await vector('51_textures'), all = await model.textures(), expected = JSON.parse(readFileSync(join(vectors, 'passed/51_textures.attributes.json'), 'utf8'));
  assert.ok(all.length > 0 && expected.arrays.some(({ element }) => element === 'ebpo:texture'));
  for (const { name, sha256, bytes } of all)
    assert.ok(name && (!bytes?.length || createHash('sha256').update(bytes).digest('hex') === sha256), name);
  assert.ok(all.some(({ bytes }) => bytes?.length));
  assert.deepEqual((await model.textures({ bytes: false })).map(({ bytes, ...others }) => others), all.map(({ bytes, ...others }) => others));
  model.dispose();
  const none = await open(small);
  assert.deepEqual(await none.textures(), []);
  none.dispose();
});

test('calls for drawing that wait for bytes together have their own results', { skip: !large }, async () => {
  // Responses come in groups, so that several calls continue at the same time.
  let waiting = [], timer;
  const respond = () => {
    timer = undefined;
    waiting.splice(0).forEach((done) => done());
  };
  const source = { size: largeBytes.length, read: async (ranges) => {
    await new Promise((done) => { waiting.push(done); timer ??= setTimeout(respond, 5); });
    return ranges.map(({ offset, size }) => Uint8Array.from(largeBytes.subarray(offset, offset + size)));
  } };
  const calls = (view) => [() => view.levelBytes(), () => view.nodes([{ level: 0, part: -1 }]), () => view.nodes([{ level: 1, part: -1 }, { level: 2, part: -1 }]),
    () => view.levelBytes(), () => view.nodes([{ level: 3, part: -1 }]), () => view.leafFaces([]), () => view.nodes([{ level: 2, part: -1 }])];
  const alone = await openView(largeBytes), expected = [];
  for (const call of calls(alone))
    expected.push(await call());
  const view = await openView(source), found = await Promise.all(calls(view).map((call) => call()));
  assert.deepEqual(found, expected);
  await view.sums;
  alone.dispose();
  view.dispose();
});

test('a view follows its observer, and stops at its limits', { skip: !large }, () => withServer(largeBytes, undefined, async ({ url }) => {
  const model = await open(url), { origin, size } = model.info, eye = origin.map((x, k) => x + 1.2 * size[k]), observer = { eye, direction: eye.map((x, k) => origin[k] + size[k] / 2 - x) };
  const view = model.view({ priority: 'pixels', observer, nodes: 200, polygons: true }), nodes = await view.next({ most: 100 });
  assert.ok(nodes.count <= 100 && nodes.octcode[0] === 1n && nodes.level[0] === 0 && nodes.vertexCount.some((x) => x > 3));
  for await (const more of view)
    assert.equal(more.count, more.octcode.length);
  assert.equal(view.end, 'nodes');
  assert.ok(view.stats.nodes > 150 && view.stats.nodes <= 200);
  assert.equal(view.cut().octcode.length, Object.values(view.stats.cut).reduce((a, b) => a + b));
  view.change({ nodes: 400, observer: { eye: origin, direction: size } });
  assert.ok((await view.next()).count > 0);
  assert.throws(() => view.change({ planes: false }), EbpoArgumentError);
  assert.throws(() => view.change({ priority: 'size' }), EbpoArgumentError);
  assert.throws(() => model.view({ priority: 'pixels' }), EbpoArgumentError);
  assert.throws(() => model.view({ observer: { eye: [0, 0] } }), EbpoArgumentError);
  view.dispose();
  view.dispose();
  await assert.rejects(view.next(), EbpoArgumentError);
  const other = model.view();
  model.dispose();
  await assert.rejects(other.next(), EbpoError);
  assert.throws(() => other.cut(), EbpoError);
  other.dispose();
}));

test('subtrees are those of octcodes', { skip: !large }, async () => {
  const model = await open(largeBytes), { origin, size } = model.info, point = (await model.distance(origin.map((x, k) => x + size[k] / 2))).point, code = model.octcode(point, 3);
  const subtree = await model.subtree(code), all = await model.subtree(1, { levels: 3 });
  assert.ok(subtree.octcode[0] === code && subtree.faces.length > 0 && subtree.number.length === subtree.faces.length / 3);
  assert.ok(all.octcode.includes(code) && all.faces === undefined);
  assert.equal(model.octcode(origin.map((x) => x - 1), 3), 0n);
  await assert.rejects(model.subtree(0), EbpoArgumentError);
  const bounds = await model.windingBounds([...point, ...origin.map((x) => x - 1)]);
  assert.deepEqual([bounds.lo[1], bounds.hi[1]], [0, 0]);
  model.dispose();
});

test('pairs of models', async () => {
  const { open: openBoth, pair } = await import(join(folder, 'collide.js'));
  const a = await openBoth(small), b = await openBoth(small, { beside: a }), both = await pair(a, b), poseB = { translation: [3, 0, 0] };
  assert.equal(await both.relation(), 'equal');
  assert.equal(await both.relation({ poseB }), 'disjoint');
  assert.equal(await both.first({ poseB }), null);
  assert.equal((await both.distance({ poseB })).lo, 2);
  const moved = { poseB: { translation: [0.1, 0.1, 0.1] } }, { kind, faces, number } = await both.all(moved), { segments } = await both.contacts(moved), { face } = await a.maps();
  assert.ok(kind.length > 0 && segments.length > 0 && segments.length % 6 === 0);
  assert.deepEqual([...faces], [...number].map((f) => face[f]));
  both.dispose();
  await assert.rejects(async () => pair(a, await openBoth(small)), EbpoArgumentError);
});
