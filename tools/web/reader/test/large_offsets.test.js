// Tests counts and offsets beyond 2^31, 2^32 and 2^53, without the data.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import test from 'node:test';
import { decodeFaces, decodeLeafBlock, decodeMap } from '../decode.js';
import { lookup3 } from '../hdf5.js';
import { openEbpo } from '../index.js';

const FAR = 2 ** 33, vector = readFileSync(new URL('../../../../format-spec/vectors/passed/01_one_leaf_unfiltered.ebpo.h5', import.meta.url));

test('vertex and source indices near 2^32 are decoded correctly', () => {
  const codes = new Uint32Array([0, 2 ** 32 - 4, 1]), array = { rows: 2, chunkRows: 1, chunkCount: 2 };
  assert.deepEqual([...decodeFaces(new Uint8Array(codes.buffer), array, 1, [0, 2 ** 32 - 3], 2 ** 32 - 2)], [2 ** 32 - 3, 2, 2 ** 32 - 3]);
  const zigzag = new Uint32Array([1, 2 ** 32 - 2]); // -1 and 2^31 - 1, modulo 2^32
  const map = { path: 'map', rows: 2, chunkRows: 2 };
  assert.deepEqual([...decodeMap(new Uint8Array(zigzag.buffer), map, 2 ** 32)], [2 ** 32 - 1, 2 ** 31 - 2]);
});

test('references count down from faces beyond 2^31', () => {
  const block = decodeLeafBlock({ face_count: 2 ** 32 - 2 }, 5, { start: 2 ** 31, skip: [2n ** 31n - 10n], fresh: [8], refCount: [2], refs: [0, 2 ** 31] });
  assert.equal(block.first[0], 2 ** 32 - 10);
  assert.deepEqual([...block.refs], [2 ** 32 - 11, 2 ** 31 - 12]);
});

// Starts a server for a file whose stated size, also in its superblock, is `size`. The reader requests only the first bytes.
async function serve(size, use) {
  const bytes = Buffer.from(vector);
  bytes.writeBigUInt64LE(BigInt(size), 28);
  bytes.writeUInt32LE(lookup3(bytes, 0, 44), 44);
  const server = createServer((request, response) => {
    const [from, to] = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range).slice(1).map(Number), end = Math.min(to, 131071);
    const body = Buffer.alloc(end - from + 1);
    bytes.copy(body, 0, from, end + 1);
    response.writeHead(206, { 'Content-Range': `bytes ${from}-${end}/${size}`, 'Content-Length': body.length, 'ETag': '"1"' });
    response.end(body);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  try {
    return await use(`http://127.0.0.1:${server.address().port}/a.ebpo.h5`);
  } finally {
    server.closeAllConnections?.();
    server.close();
  }
}

test('files of more than 2^32 bytes are opened, and of more than 2^53 bytes are refused', async () => {
  await serve(FAR, async (url) => {
    const file = await openEbpo(url, { headBytes: 131072, timeout: 2000 });
    assert.equal(file.source.size, FAR);
    assert.equal((await file.mesh()).faces.length, 12);
  });
  await serve('9007199254740993', async (url) => assert.rejects(openEbpo(url, { headBytes: 131072, timeout: 2000 }), { name: 'EbpoError' }));
});
