// Tests URLs on correct and misbehaving servers: correct bytes, or a clear error within the time limit; and the kept bytes.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import test from 'node:test';
import { EbpoError } from '../error.js';
import { addLevels } from '../grow.js';
import { KeptSource } from '../kept_source.js';
import { openModel } from '../model_file.js';
import { UrlSource } from '../source.js';
import { LEAF, Tree } from '../tree.js';

const bytes = readFileSync(new URL('../../../format-spec/vectors/passed/06_four_levels_leaf_planes.ebpo.h5', import.meta.url));
const part = bytes.length >> 1;

// Starts a server for ranges whose responses `odd` may change. Returns the result of `use(address)`.
async function serve(odd, use) {
  const requested = [];
  const server = createServer((request, response) => {
    const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? ''), from = Number(range[1]), to = Math.min(Number(range[2]), bytes.length - 1);
    requested.push([from, to]);
    const reply = { status: 206, headers: { 'Content-Range': `bytes ${from}-${to}/${bytes.length}`, 'Content-Length': to - from + 1, 'ETag': '"1"' }, body: bytes.subarray(from, to + 1) };
    if (odd?.(reply, requested.length, response) === false)
      return;
    response.writeHead(reply.status, reply.headers);
    response.end(reply.body);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  try {
    return await use(`http://127.0.0.1:${server.address().port}/a.ebpo.h5`, requested);
  } finally {
    server.closeAllConnections?.();
    server.close();
  }
}

async function readAll(url, options) {
  const file = await openModel(url, { headBytes: part, timeout: 2000, ...options }), tree = new Tree(file.info), leaves = [];
  await addLevels(file, tree, file.info.levels.map((_, level) => level));
  (function walk(node) {
    (node.type === LEAF ? leaves.push(node) : tree.children(node)?.forEach(walk));
  })(tree.root);
  await file.leafFaces(leaves);
  await file.sums;
  return file;
}

async function fails(odd, code, expected, options) {
  await serve(odd, async (url) => {
    await assert.rejects(readAll(url, options), (error) => {
      assert.ok(error instanceof EbpoError, error.stack);
      assert.equal(error.code, code);
      assert.match(error.message, expected);
      assert.ok(error.message.startsWith(url + ': '), error.message);
      return true;
    });
  });
}

test('a good server: the right bytes, in few requests', () => serve(undefined, async (url, requested) => {
  const file = await readAll(url);
  assert.equal(file.traffic.requests, requested.length);
  assert.equal(file.traffic.bytes, requested.reduce((sum, [from, to]) => sum + to - from + 1, 0));
  assert.ok(requested.length <= 20, String(requested.length));
}));
test('the first response contains a small file completely', () => serve(undefined, async (url, requested) => {
  await readAll(url, { headBytes: 1 << 20 });
  assert.deepEqual(requested, [[0, bytes.length - 1]]);
}));

const whole = (reply) => {
  reply.status = 200;
  reply.body = bytes;
  reply.headers = { 'Content-Length': bytes.length, 'ETag': '"1"' };
};
test('a server without ranges: a small file is read once', () => serve(whole, async (url, requested) => {
  await readAll(url);
  assert.equal(requested.length, 1);
}));
test('a server without ranges and without a length', () => serve((reply) => {
  whole(reply);
  delete reply.headers['Content-Length'];
}, (url) => readAll(url)));
test('a server without ranges: a large file is refused', () => fails(whole, 'NETWORK', /does not serve ranges/, { wholeLimit: 1000 }));
test('a large file without ranges or length is not read to the end', () => fails((reply) => {
  whole(reply);
  delete reply.headers['Content-Length'];
}, 'NETWORK', /does not serve ranges/, { wholeLimit: 1000 }));
test('a server that stops serving ranges', () => fails((reply, n) => (n > 1 ? whole(reply) : undefined), 'NETWORK', /stopped serving ranges/));

test('a wrong range', () => fails((reply) => (reply.headers['Content-Range'] = `bytes 1-${part}/${bytes.length}`), 'NETWORK', /where 0 to \d+ were requested/));
test('no Content-Range', () => fails((reply) => delete reply.headers['Content-Range'], 'NETWORK', /no Content-Range/));
test('a file that changes while it is read', () => fails((reply, n) => (n > 1 ? (reply.headers.ETag = '"2"') : undefined), 'NETWORK', /was changed on the server/));
test('a file that grows while it is read', () => fails((reply, n) => {
  if (n > 1)
    reply.headers['Content-Range'] = reply.headers['Content-Range'].replace(/\d+$/, bytes.length + 1);
}, 'NETWORK', /was changed on the server/));
test('short bodies', () => fails((reply) => {
  reply.body = reply.body.subarray(0, 10);
  delete reply.headers['Content-Length'];
}, 'NETWORK', /sent 10 bytes of/));
test('bodies that are too long', () => fails((reply) => {
  reply.body = Buffer.concat([reply.body, reply.body]);
  delete reply.headers['Content-Length'];
}, 'NETWORK', /more bytes than it stated/));
test('compression during transfer', () => fails((reply) => (reply.headers['Content-Encoding'] = 'gzip'), 'NETWORK', /compresses the file|request failed/));
test('a missing file', () => fails((reply) => (reply.status = 404), 'NETWORK', /404/));
test('a page instead of the file', () => fails((reply) => {
  whole(reply);
  reply.body = Buffer.from('<!doctype html><title>Not found</title> and so on, and so on');
  delete reply.headers['Content-Length'];
}, 'FORMAT', /an HTML page/));
test('a login page with its content type', () => fails((reply) => {
  whole(reply);
  reply.body = Buffer.from('<!doctype html><title>Sign in</title>');
  reply.headers = { 'Content-Type': 'text/html; charset=utf-8' };
}, 'NETWORK', /returned text\/html, not a model/));
test('a tag that is sometimes weak', () => serve((reply, n) => {
  reply.headers.ETag = n % 2 ? 'W/"1"' : '"1"';
}, (url) => readAll(url)));
test('a server that is always busy', () => fails((reply) => (reply.status = 503), 'NETWORK', /503/));
test('a server that is sometimes busy', () => serve((reply, n) => (n % 2 ? (reply.status = 503) : undefined), (url) => readAll(url)));
test('connections that sometimes break', () => serve((reply, n, response) => {
  if (n % 2)
    response.destroy();
  return n % 2 === 0;
}, (url) => readAll(url)));
test('a server that stalls', () => fails(() => false, 'NETWORK', /no data for/, { timeout: 100 }));
test('a server that stalls in the middle of a body', () => fails((reply, n, response) => {
  response.writeHead(206, reply.headers);
  response.write(reply.body.subarray(0, 100));
  return false;
}, 'NETWORK', /no data for/, { timeout: 100 }));
test('bytes changed during transfer are detected', () => fails((reply, n) => {
  if (n === 1)
    reply.body = Buffer.from(reply.body).fill(0, 3000, 3010);
}, 'FORMAT', /the checksum of the object's header differs/));
test('no server', async () => {
  const url = await serve(undefined, (address) => address);
  await assert.rejects(readAll(url), (error) => error instanceof EbpoError && error.code === 'NETWORK' && /request failed/.test(error.message));
});

test('HTTP statuses are explained', async () => {
  for (const [status, expected] of [[401, /401.*requires a login/], [403, /403.*does not let this page.*access/], [404, /404.*no such file.*address/], [410, /410.*removed/],
    [416, /416.*is empty/], [418, /418/]])
    await fails((reply) => (reply.status = status), 'NETWORK', expected);
  await fails((reply, n) => (n > 1 ? (reply.status = 416) : undefined), 'NETWORK', /416.*is shorter.*open it again/);
});

let finish;
test('bytes of the first response are readable as they arrive, up to a whole small file', () => serve((reply, n, response) => {
  response.writeHead(206, reply.headers);
  response.write(reply.body.subarray(0, part));
  finish = () => response.end(reply.body.subarray(part));
  return false;
}, async (url, requested) => {
  const source = new UrlSource(url, { ahead: 1 << 20 });
  assert.equal((await source.open(part)).length, part);
  const [begin, across] = [await source.read(3, 7), source.read(part - 5, 10)];
  assert.deepEqual(Buffer.from(begin), bytes.subarray(3, 10));
  assert.deepEqual(source.underway().map(({ from, to, got }) => [from, to, got]), [[0, bytes.length, part]]);
  finish();
  assert.deepEqual(Buffer.from(await across), bytes.subarray(part - 5, part + 5));
  assert.deepEqual(requested, [[0, bytes.length - 1]]);
  assert.deepEqual(source.underway(), []);
}));

test('requests beyond the first response fetch only missing bytes', () => serve(undefined, async (url, requested) => {
  const source = new UrlSource(url, { ahead: part });
  await source.open(100);
  assert.deepEqual(Buffer.from(await source.read(part - 4, 20)), bytes.subarray(part - 4, part + 16));
  assert.deepEqual(Buffer.from(await source.read(part + 30, 20)), bytes.subarray(part + 30, part + 50));
  assert.deepEqual(requested, [[0, part - 1], [part, part + 15], [part + 30, part + 49]]);
}));

test('the first response of a large file is ended, and continued when more is needed', () => serve(undefined, async (url, requested) => {
  const source = new UrlSource(url, { ahead: 1 << 20, enoughOf: (size) => (size === bytes.length ? 200 : Infinity) });
  await source.open(100);
  source.extend(part);
  assert.deepEqual(Buffer.from(await source.read(195, 10)), bytes.subarray(195, 205));
  await source.read(0, part);
  await new Promise((done) => setTimeout(done, 100)); // the transfer ends
  source.extend(part - 1); // which it has
  source.extend(2 * bytes.length);
  assert.equal(source.coming, bytes.length);
  assert.deepEqual(Buffer.from(await source.read(part - 5, 10)), bytes.subarray(part - 5, part + 5));
  assert.deepEqual(requested, [[0, bytes.length - 1], [200, part - 1], [part, bytes.length - 1]]);
}));

// Each response ends after 300 bytes until `broken` is 0.
const breaking = (broken) => (reply, n, response) => {
  if (--broken < 0)
    return true;
  response.writeHead(206, reply.headers);
  response.write(reply.body.subarray(0, 300), () => setTimeout(() => response.destroy(), 20));
  return false;
};
test('a broken response is continued at its end', () => serve(breaking(2), async (url, requested) => {
  const source = new UrlSource(url);
  assert.deepEqual(Buffer.from(await source.open(part)), bytes.subarray(0, part));
  assert.deepEqual(requested, [[0, part - 1], [300, part - 1], [600, part - 1]]);
}));

let dead = true;
test('a patient source waits while the connection is lost, states the reason, and continues on retry', () => serve((reply, n, response) => {
  if (n > 1 && dead)
    response.destroy();
  return n === 1 || !dead;
}, async (url, requested) => {
  const source = new UrlSource(url, { patient: true });
  await source.open(100);
  const reading = Promise.all([source.read(200, 50), source.read(400, 50)]);
  for (let i = 0; i < 200 && !source.trouble; i++)
    await new Promise((done) => setTimeout(done, 50));
  assert.match(source.trouble.message, /request failed/);
  assert.equal(source.underway().length, 2);
  dead = false;
  source.retry();
  const [a, b] = await reading;
  assert.deepEqual([Buffer.from(a), Buffer.from(b)], [bytes.subarray(200, 250), bytes.subarray(400, 450)]);
  assert.equal(source.trouble, undefined);
  assert.equal(requested.filter(([from]) => from === 0).length, 1);
}));

test('retry repeats a stalled request for its rest only; a closed source ends', () => serve((reply, n, response) => {
  response.writeHead(206, reply.headers);
  response.write(reply.body.subarray(0, 100));
  return false;
}, async (url, requested) => {
  const source = new UrlSource(url, { patient: true }), opened = source.open(300);
  for (const wanted of [100, 200, 300]) {
    while ((source.underway()[0]?.got ?? 300) < wanted)
      await new Promise((done) => setTimeout(done, 20));
    source.retry();
  }
  assert.deepEqual(Buffer.from(await opened), bytes.subarray(0, 300));
  assert.deepEqual(requested, [[0, 299], [100, 299], [200, 299]]);
  const reading = assert.rejects(source.read(500, 300), { code: 'NETWORK' });
  source.close();
  await reading;
}));

test('the cache may respond; a response of another version is fetched again without the cache', async () => {
  const modes = [], reply = (from, to, tag) => new Response(bytes.subarray(from, to + 1), { status: 206, headers: { 'Content-Range': `bytes ${from}-${to}/${bytes.length}`, 'ETag': tag } });
  const fetch = async (url, { cache, headers }) => {
    const [from, to] = headers.Range.match(/\d+/g).map(Number);
    modes.push(cache);
    return reply(from, to, modes.length === 2 || stale ? '"old"' : '"new"');
  };
  let stale = false;
  const source = new UrlSource('https://example.org/a', { fetch });
  await source.open(100);
  assert.deepEqual(Buffer.from(await source.read(200, 50)), bytes.subarray(200, 250));
  assert.deepEqual(modes, ['no-cache', 'default', 'no-store']);
  stale = true;
  await assert.rejects(source.read(300, 50), /was changed on the server/);
});

test('files and bytes are read', async () => {
  await readAll(new Blob([bytes]));
  await readAll(bytes);
  await readAll(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
  await assert.rejects(openModel(7), { code: 'ARGUMENT' });
});

test('only one of several concurrent requests uses the cache, which would serialize them', () => serve(undefined, async (url) => {
  const modes = [], source = new UrlSource(url, { fetch: (address, init) => {
    modes.push(init.cache);
    return fetch(address, init);
  } });
  await source.open(part);
  await new Promise((done) => setTimeout(done, 100)); // the first response has ended
  modes.length = 0;
  const read = (i) => source.read(part + 10 * i, 10);
  await Promise.all([0, 1, 2].map(read));
  await read(3);
  assert.deepEqual(modes, ['default', 'no-store', 'no-store', 'default']);
}));
test('kept bytes are not requested again, and the end of the file is read with its last range', () => serve(undefined, async (url, requested) => {
  const source = new UrlSource(url, { ahead: 100 });
  await source.open(100);
  const kept = new KeptSource(source), read = (...ranges) => kept.read(ranges.map(([offset, size]) => ({ offset, size })));
  const same = (parts, ...ranges) => ranges.forEach(([at, size], i) => assert.deepEqual(Buffer.from(parts[i]), bytes.subarray(at, at + size)));
  same(await read([200, 50], [90, 20], [0, 10]), [200, 50], [90, 20], [0, 10]);
  same(await read([150, 200], [210, 5]), [150, 200], [210, 5]);
  assert.deepEqual(requested, [[0, 99], [200, bytes.length - 1], [100, 109], [150, 199]]);
  assert.equal(kept.bytes, bytes.length - 200 + 10 + 50);
}));
test('few bytes are kept', async () => {
  const source = { name: 'a', size: 1 << 20, read: async (offset, size) => new Uint8Array(size).fill(offset / 1000) }, kept = new KeptSource(source, { most: 5000 });
  for (let i = 0; i < 20; i++)
    assert.equal((await kept.read([{ offset: 1000 * i, size: 1000 }]))[0][999], i);
  assert.ok(kept.bytes <= 5000 && kept.pieces.length === 5);
});
