// URLs on servers good and bad: what is read is right, or there is a clear error in time.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import test from 'node:test';
import { EbpoError, openEbpo } from '../index.js';

const bytes = readFileSync(new URL('../../../../format-spec/vectors/passed/06_four_levels_leaf_planes.ebpo.h5', import.meta.url));
const part = bytes.length >> 1; // a head that is read in pieces

// A server that answers ranges as it should, but for what `odd` does. Returns what `use` makes of its address.
async function serve(odd, use) {
  const asked = [];
  const server = createServer((request, response) => {
    const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? ''), from = Number(range[1]), to = Math.min(Number(range[2]), bytes.length - 1);
    asked.push([from, to]);
    const answer = { status: 206, headers: { 'Content-Range': `bytes ${from}-${to}/${bytes.length}`, 'Content-Length': to - from + 1, 'ETag': '"1"' }, body: bytes.subarray(from, to + 1) };
    if (odd?.(answer, asked.length, response) === false)
      return;
    response.writeHead(answer.status, answer.headers);
    response.end(answer.body);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  try {
    return await use(`http://127.0.0.1:${server.address().port}/a.ebpo.h5`, asked);
  } finally {
    server.closeAllConnections?.();
    server.close();
  }
}

async function readAll(url, options) {
  const file = await openEbpo(url, { headBytes: part, timeout: 2000, ...options });
  await file.levels(0, file.info.level_count - 1, { faces: true });
  await file.mesh();
  await file.verifyContent();
  return file;
}

async function fails(odd, code, said, options) {
  await serve(odd, async (url) => {
    await assert.rejects(readAll(url, options), (error) => {
      assert.ok(error instanceof EbpoError, error.stack);
      assert.equal(error.code, code);
      assert.match(error.message, said);
      assert.ok(error.message.startsWith(url + ': '), error.message);
      return true;
    });
  });
}

test('a good server: the right bytes, in few requests', () => serve(undefined, async (url, asked) => {
  const file = await readAll(url);
  assert.equal(file.traffic.requests, asked.length);
  assert.equal(file.traffic.bytes, asked.reduce((sum, [from, to]) => sum + to - from + 1, 0));
  assert.ok(asked.length <= 20, String(asked.length));
}));
test('a small file comes whole with the head', () => serve(undefined, async (url, asked) => {
  await readAll(url, { headBytes: 1 << 20 });
  assert.deepEqual(asked, [[0, bytes.length - 1]]);
}));

const whole = (answer) => {
  answer.status = 200;
  answer.body = bytes;
  answer.headers = { 'Content-Length': bytes.length, 'ETag': '"1"' };
};
test('a server without ranges: a small file is read once', () => serve(whole, async (url, asked) => {
  await readAll(url);
  assert.equal(asked.length, 1);
}));
test('a server without ranges, without a length either', () => serve((answer) => {
  whole(answer);
  delete answer.headers['Content-Length'];
}, (url) => readAll(url)));
test('a server without ranges: a large file is refused', () => fails(whole, 'NETWORK', /does not serve ranges/, { wholeLimit: 1000 }));
test('a large file without ranges or length is not read to the end', () => fails((answer) => {
  whole(answer);
  delete answer.headers['Content-Length'];
}, 'NETWORK', /does not serve ranges/, { wholeLimit: 1000 }));
test('ranges that stop', () => fails((answer, n) => (n > 1 ? whole(answer) : undefined), 'NETWORK', /stopped answering ranges/));

test('another range than was asked for', () => fails((answer) => (answer.headers['Content-Range'] = `bytes 1-${part}/${bytes.length}`), 'NETWORK', /where 0 to \d+ were asked for/));
test('no Content-Range', () => fails((answer) => delete answer.headers['Content-Range'], 'NETWORK', /no Content-Range/));
test('a file that changes under way', () => fails((answer, n) => (n > 1 ? (answer.headers.ETag = '"2"') : undefined), 'NETWORK', /was changed on the server/));
test('a file that grows under way', () => fails((answer, n) => {
  if (n > 1)
    answer.headers['Content-Range'] = answer.headers['Content-Range'].replace(/\d+$/, bytes.length + 1);
}, 'NETWORK', /was changed on the server/));
test('short bodies', () => fails((answer) => {
  answer.body = answer.body.subarray(0, 10);
  delete answer.headers['Content-Length'];
}, 'NETWORK', /sent 10 bytes of/));
test('bodies that are too long', () => fails((answer) => {
  answer.body = Buffer.concat([answer.body, answer.body]);
  delete answer.headers['Content-Length'];
}, 'NETWORK', /more bytes than it said/));
test('compression on the way', () => fails((answer) => (answer.headers['Content-Encoding'] = 'gzip'), 'NETWORK', /compresses the file|request failed/));
test('not there', () => fails((answer) => (answer.status = 404), 'NETWORK', /404/));
test('a page in place of the file', () => fails((answer) => {
  whole(answer);
  answer.body = Buffer.from('<!doctype html><title>Not found</title> and so on, and so on');
  delete answer.headers['Content-Length'];
}, 'FORMAT', /not a whole HDF5 file/));
test('always busy', () => fails((answer) => (answer.status = 503), 'NETWORK', /503/));
test('busy now and then', () => serve((answer, n) => (n % 2 ? (answer.status = 503) : undefined), (url) => readAll(url)));
test('connections that break now and then', () => serve((answer, n, response) => {
  if (n % 2)
    response.destroy();
  return n % 2 === 0;
}, (url) => readAll(url)));
test('a server that stalls', () => fails(() => false, 'NETWORK', /no byte came/, { timeout: 100 }));
test('a server that stalls in the middle of a body', () => fails((answer, n, response) => {
  response.writeHead(206, answer.headers);
  response.write(answer.body.subarray(0, 100));
  return false;
}, 'NETWORK', /no byte came/, { timeout: 100 }));
test('bytes that were changed on the way are noticed', () => fails((answer, n) => {
  if (n === 1)
    answer.body = Buffer.from(answer.body).fill(0, 3000, 3010);
}, 'FORMAT', /checksum differs/));
test('nobody there', async () => {
  const url = await serve(undefined, (address) => address);
  await assert.rejects(readAll(url), (error) => error instanceof EbpoError && error.code === 'NETWORK' && /request failed/.test(error.message));
});

test('files and bytes are read alike', async () => {
  await readAll(new Blob([bytes]));
  await readAll(bytes);
  await readAll(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
  await assert.rejects(openEbpo(7), { code: 'ARGUMENT' });
});

// The index of chunks, which stands behind the first levels: fetched when it is needed, in one go; what the head says of its place is not relied on.
const indexed = readFileSync(new URL('../../../../format-spec/vectors/passed/11_two_chunks_of_faces.ebpo.h5', import.meta.url));
async function openIndexed(change) {
  const whole = await openEbpo(indexed), { chunk_index_offset: at, chunk_index_bytes: size } = whole.info, asked = [];
  const source = { name: 'a', size: indexed.length, requests: 0, bytes: 0, open: async (n) => indexed.subarray(0, n), read: async (from, n) => {
    asked.push([from, n]);
    return indexed.subarray(from, from + n);
  } };
  assert.ok(at > 0 && size > 0 && whole.located);
  const file = await openEbpo(source, { headBytes: at });
  assert.equal(file.located, false);
  change?.(file.info);
  await file.levels(0, file.info.level_count - 1);
  assert.deepEqual((await file.mesh()).faces, (await whole.mesh()).faces);
  assert.equal(file.located, true);
  return { asked, at, size };
}
test('the index of chunks comes in one request', async () => {
  const { asked, at, size } = await openIndexed();
  assert.equal(asked.filter(([from, n]) => from < at + size && from + n > at).length, 1);
  assert.deepEqual(asked.find(([from]) => from === at), [at, size]);
});
for (const [what, offset, bytes] of [['nowhere', 0, 0], ['somewhere else', 100, 500], ['beyond the end', 1 << 30, 100], ['too short', undefined, 8]])
  test(`the index of chunks, said to be ${what}`, () => openIndexed((info) => {
    info.chunk_index_offset = offset ?? info.chunk_index_offset;
    info.chunk_index_bytes = bytes;
  }));
