// Tests wrong tables of subtrees and wrong chunk directories. The reader must either throw an error that names the object or return correct data.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { fletcher32 } from '../chunk.js';
import { EbpoError, openEbpo } from '../index.js';
import { isListValid, readDirectory } from '../chunk_directory.js';
import { readAll } from './as_json.js';

const original = readFileSync(new URL('../../../../format-spec/vectors/passed/15_subtrees_unfiltered.ebpo.h5', import.meta.url));
const good = await openEbpo(original);
await good.locate();
const { info } = good, below = info.level_count - 1 - info.subtree_level;

// Returns a copy with a changed chunk and the matching checksum.
function changed(path, change, chunk = 0) {
  const bytes = Buffer.from(original), { at, bytes: length } = good.arrays.get(path).chunks[chunk], data = bytes.subarray(at, at + length - 4);
  change(data);
  bytes.writeUInt32LE(fletcher32(data), at + length - 4);
  return bytes;
}

// Reads all data that is read by subtree.
async function readBySubtree(bytes) {
  const file = await openEbpo(bytes, { name: 'a' }), numbers = Array.from({ length: info.levels[info.subtree_level].gray }, (_, i) => i);
  await file.locate();
  const found = await file.subtrees(numbers), drawn = await file.nodeParts(found.map(({ level, part }) => ({ level, part })));
  const leaves = found.flatMap(({ level, part, segment }) => Array.from({ length: [...segment.types].reduce((n, t) => n + [0, 1, 2, 3, 4, 5, 6, 7].filter((o) => (t >> 2 * o & 3) === 2).length, 0) },
    (_, i) => ({ level, subtree: part, rank: segment.first[2] + i })));
  const faces = await file.leafFaces(leaves);
  return JSON.stringify([found.map(({ segment }) => [...segment.types]), drawn.map((s) => [...s.planes ?? []]), faces.map((f) => [...f, ...f.numbers])]);
}

async function refused(bytes, expected, read = readBySubtree) {
  await assert.rejects(read(bytes), (error) => {
    assert.ok(error instanceof EbpoError, error.stack);
    assert.equal(error.code, 'FORMAT');
    assert.match(error.message, expected);
    return true;
  });
}

// --- chunk checksums ---

const summed = readFileSync(new URL('../../../../format-spec/vectors/passed/55_chunk_checksums_of_subtrees.ebpo.h5', import.meta.url));

// A source whose bytes before `limit` arrive immediately, and the others when `gate` resolves.
class SlowSource {
  constructor(data, limit, gate) {
    Object.assign(this, { data, limit, gate, name: 'slow', size: data.length, requests: 0, bytes: 0 });
  }

  async open(bytes) {
    return this.data.subarray(0, Math.min(bytes, this.limit));
  }

  async read(offset, length) {
    if (offset + length > this.limit)
      await this.gate;
    return this.data.subarray(offset, offset + length);
  }

  get coming() {
    return this.limit;
  }

  get come() {
    return this.limit;
  }
}

// A file whose list has a wrong checksum for the types of level 2.
function withWrongEnd(data, { at, bytes: length }) {
  const bytes = Buffer.from(data), rows = bytes.subarray(at, at + length - 4);
  for (let row = 0; row < rows.length; row += 8)
    rows[row] ^= Number(rows.readUInt32LE(row + 4) === 2 * 64);
  bytes.writeUInt32LE(fletcher32(rows), at + length - 4);
  return bytes;
}

test('levels are returned before the chunk checksums arrive; a wrong level is reported when they have arrived', async () => {
  const list = (await openEbpo(summed)).arrays.get('/chunk_checksums').chunks[0], wrong = withWrongEnd(summed, list);
  for (const data of [summed, wrong]) {
    let open;
    const file = await openEbpo(new SlowSource(data, list.at, new Promise((done) => (open = done))));
    assert.equal((await file.levels(0, 2)).length, 3);
    open();
    await file.store.sums();
    if (data === summed)
      assert.equal((await file.levels(3, 3)).length, 1);
    else
      await assert.rejects(file.levels(3, 3), /levels\/02\/types: chunk 0: the chunk is damaged: it is not the chunk/);
  }
  await assert.rejects((await openEbpo(wrong)).levels(2, 2), /it is not the chunk/); // everything has arrived, so that no level is returned
});

// The chunk directory of a file that has arrays with several chunks, as pairs of size and number.
const many = await openEbpo(readFileSync(new URL('../../../../format-spec/vectors/passed/16_many_subtrees.ebpo.h5', import.meta.url)));
const list = many.arrays.get('/subtrees/chunk_directory');
const arrays = [...many.arrays.values()].filter((a) => a !== list), [stored] = await Promise.all(many.store.cache.decoded([{ array: list, chunk: 0 }]));
const placed = (change) => {
  const rows = new Uint32Array(stored.slice().buffer);
  change(rows, rows.length - 2);
  return readDirectory(rows, arrays, many.source.size);
};

test('chunk directory: a chunk too many, too few, too large, beyond the end, at a wrong offset', async () => {
  assert.deepEqual([...placed(() => {}).values()].map((chunks) => chunks.length), arrays.map((a) => a.chunkCount));
  const wrong = (change, expected) => assert.throws(() => placed(change), (error) => error instanceof EbpoError && error.code === 'FORMAT' && expected.test(error.message));
  wrong((rows) => (rows[3] = rows[1]), /\/subtrees\/chunk_directory: .*more chunks/);
  wrong((rows, last) => (rows[last + 1] = 70000), /\/subtrees\/chunk_directory: .*fewer chunks/);
  wrong((rows, last) => (rows[last] = 2 ** 32 - 1), /\/subtrees\/chunk_directory: a chunk reaches beyond the end/);
  wrong((rows) => (rows[6] += 1), /\/subtrees\/chunk_directory: .*at another offset/);
  wrong((rows) => (rows[6] = 0), /\/subtrees\/chunk_directory: .*invalid size/);
  wrong((rows) => (rows[6] = 100000), /\/subtrees\/chunk_directory: .*(invalid size|beyond the end)/);
  wrong((rows) => rows.fill(70000), /\/subtrees\/chunk_directory: the chunks of level 0 are missing/);
  await many.locate();
  for (const [array, chunks] of placed(() => {}))
    assert.deepEqual(chunks, array.chunks.map(({ at, bytes }) => ({ at, bytes })), array.path);
});

test('outdated chunk directories are not used', async () => {
  const bytes = many.source.data;
  async function positionsOf(change) {
    const file = await openEbpo(bytes), { attributes } = file.arrays.get('/subtrees/chunk_directory').object;
    change(attributes);
    let reads = 0;
    const { cache } = file.store, decoded = cache.decoded.bind(cache);
    cache.decoded = (wanted) => (reads += wanted.length) && decoded(wanted);
    await file.locate();
    return { where: [...file.arrays.values()].map((x) => x.chunks.map((c) => c.at)), reads };
  }
  const { where: right, reads: once } = await positionsOf(() => {});
  assert.equal(once, 1);
  for (const name of ['file_bytes', 'offset'])
    for (const change of [(a) => a.set(name, { ...a.get(name), data: Uint8Array.from(a.get(name).data, (byte, i) => byte ^ (i === 0)) }), (a) => a.delete(name)]) {
      const { where, reads } = await positionsOf(change);
      assert.equal(reads, 0);
      assert.deepEqual(where, right);
    }
});

test('counts that do not add up, in each column', async () => {
  const cols = 6 + 7 * below;
  for (let column = 0; column < cols; column++)
    for (const by of [1, 2 ** 31]) {
      const bytes = changed('/subtrees/counts', (data) => data.writeUInt32LE((data.readUInt32LE(4 * column) + by) >>> 0, 4 * column));
      if (![0, 2].includes(column) && !(column >= 6 && column % 7 === 5)) // the header has no sums for the columns that count what is before a subtree, and for ends
        await refused(bytes, /\/subtrees\/counts: /);
      else
        await readBySubtree(bytes).then((found) => assert.ok(found), (error) => assert.ok(error instanceof EbpoError, error.stack));
    }
});

test('counts that are moved from one subtree to another', async () => {
  const cols = 6 + 7 * below, move = (column, from, to) => changed('/subtrees/counts', (data) => [[from, -1], [to, 1]].forEach(([row, by]) => {
    const at = 4 * (row * cols + column), value = data.readUInt32LE(at);
    data.writeUInt32LE((value + by) >>> 0, at);
  }));
  for (const column of [6, 7, 8, 9, 11, 13])
    for (const [from, to] of [[0, 1], [1, 0]]) {
      const bytes = move(column, from, to);
      await readBySubtree(bytes).then((found) => assert.fail(`column ${column} was accepted: ${found.length}`), (error) => assert.ok(error instanceof EbpoError, error.stack));
    }
});

test('an index that does not begin with 0', () => refused(changed('/subtrees/index', (data) => data.writeUInt32LE(1, 8)), /\/subtrees\/index: the first row of the index is not 0/));

test('500 random changes of the tables: an error or the same result', async () => {
  const right = await readBySubtree(original);
  let state = 3, errors = 0;
  const random = (n) => Math.floor((state = (state * 48271) % 2147483647) / 2147483647 * n);
  for (let i = 0; i < 500; i++) {
    const path = ['/subtrees/counts', '/subtrees/index'][i % 2];
    const bytes = changed(path, (data) => {
      for (let k = random(3); k >= 0; k--)
        data[random(data.length)] ^= 1 << random(8);
    });
    const found = await readBySubtree(bytes).catch((error) => assert.ok(error instanceof EbpoError, error.stack) ?? errors++);
    if (typeof found === 'string')
      assert.equal(found, right, `${path}, change ${i}`);
  }
  assert.ok(errors > 400, String(errors));
});

test('a chunk directory without a known offset is invalid', () => {
  const places = good.arrays.get('/subtrees/chunk_directory');
  assert.equal(isListValid(places, original.length), true);
  assert.equal(isListValid(places, original.length + 1), false);
  assert.equal(isListValid({ ...places, chunks: undefined }, original.length), false);
});

test('the whole file can be read', async () => assert.ok((await readAll(original, 'a')).levels.length));
