// Tests paint files: written files are read by this reader and, as HDF5, by h5dump and h5py; invalid files are refused.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test from 'node:test';
import { MOST, cleanText, readPaint, writePaint } from '../paint/paint_file.js';
import { H5Writer, i64, text, u64 } from '../paint/write_h5.js';
import { lookup3 } from '../paint/read_h5.js';

const SHA = '0123456789abcdef'.repeat(4);
const point = (i) => ({ face: 7 * i, weights: [i % 3 * 1000, 2 ** 29], place: [i / 3, -i, 1e-3 * i], size: 1 + (i * 977) % 32768, pressure: i % 65536, time: 8 * i });
function sample(strokes = 3, points = 5) {
  return { model: SHA, modelName: 'büste.ebpo.h5', unit: 'mm', faceNumbers: 'source',
    layers: [{ title: 'Risse', author: 'A. Ö.', date: '2026-11-26', description: '', colour: 0xd03030ff, opacity: 255, visible: true },
      { title: '', author: '', date: '', description: 'zwei\u2028Zeilen', colour: 0xffffffff, opacity: 100, visible: false }],
    notes: [{ title: 'Here', author: 'me', date: '2026-11-26T21:43:05Z', body: 'a loss', layer: 1, face: 12, weights: [5, 2 ** 30 - 5], place: [1, 2, -0.5] }],
    strokes: Array.from({ length: strokes }, (_, s) => ({ layer: s % 2, erases: s % 3 === 2, colour: s % 3 === 2 ? [0, 0, 0, 0] : [200, 10 * s % 256, 3, 255], radius: 0.25 + s,
      time: s ? 1.7e12 + s : 0,
      points: Array.from({ length: points }, (__, i) => point(100 * s + i)) })) };
}

test('a paint file is read as it was written', () => {
  for (const doc of [sample(), { ...sample(0), notes: [], layers: [] }, { ...sample(0) }, sample(1, 1), sample(1000, 30), { ...sample(), modelName: '', unit: '' }])
    assert.deepEqual(readPaint(writePaint(doc)), doc);
});

test('h5dump and h5py read a paint file', (t) => {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-paint-')), path = join(work, 'a.paint.h5');
  t.after(() => rmSync(work, { recursive: true, force: true }));
  writeFileSync(path, writePaint(sample()));
  if (spawnSync('h5dump', ['--version']).status === 0) {
    const dump = execFileSync('h5dump', [path], { encoding: 'utf8' });
    assert.match(dump, /DATASET "weights"[^]*H5T_STD_U32LE[^]*\( 15, 2 \)/);
    assert.match(dump, /\(0\): "EBP-Octree paint 1"/);
  } else {
    t.diagnostic('h5dump is not installed');
  }
  const script = `import h5py, json, sys
f = h5py.File(sys.argv[1]); p = f["points"]; s = f["strokes"]
print(json.dumps([f.attrs["format"].decode(), f.attrs["model_name"].decode(), int(f.attrs["point_count"]), p["face"][:].tolist(), p["place"][:].view("f8").tolist(),
  s["radius"][:].view("f8").tolist(),
  s["colour"][:].tolist(), s["time"][:].tolist(), f["notes/0000"].attrs["place"].tolist(), f["layers/0001"].attrs["title"].decode(), sorted(f)]))`;
  if (spawnSync('/usr/bin/python3', ['-c', 'import h5py']).status !== 0) {
    t.diagnostic('h5py is not installed');
    return;
  }
  const doc = sample(), all = doc.strokes.flatMap((s) => s.points);
  assert.deepEqual(JSON.parse(execFileSync('/usr/bin/python3', ['-c', script, path], { encoding: 'utf8' })), ['EBP-Octree paint 1', 'büste.ebpo.h5', 15, all.map((p) => p.face),
    all.map((p) => p.place),
    doc.strokes.map((s) => s.radius), doc.strokes.map((s) => s.colour), doc.strokes.map((s) => s.time), [1, 2, -0.5], '', ['layers', 'notes', 'points', 'strokes']]);
});

test('invalid paint files are refused', () => {
  const broken = (change) => {
    const doc = structuredClone(sample());
    change(doc);
    return writePaint(doc);
  };
  for (const [change, expected] of [[(d) => (d.strokes[0].layer = 2), /layer/], [(d) => (d.strokes[1].radius = Infinity), /radius/], [(d) => (d.strokes[1].radius = 0), /radius/],
    [(d) => (d.strokes[0].points[0].size = 0), /size/], [(d) => (d.strokes[0].points[0].weights = [2 ** 30, 1]), /weights/], [(d) => (d.strokes[0].points[0].place = [0, NaN, 0]), /place/],
    [(d) => (d.strokes[0].points[0].face = 2 ** 32 - 1), /face/], [(d) => (d.strokes[0].points = []), /points/], [(d) => (d.model = 'x'), /model_sha256/], [(d) => (d.faceNumbers = 'mine'),
      /face_numbers/],
    [(d) => (d.notes[0].layer = 2), /layer/], [(d) => (d.notes[0].weights = [0.5, 0]), /weights/], [(d) => (d.layers[0].opacity = 256), /opacity/], [(d) => (d.layers[0].title = 'a\nb'), /title/]])
    assert.throws(() => readPaint(broken(change)), (e) => e.code === 'FORMAT' && expected.test(e.message), String(expected));
  assert.throws(() => readPaint(new TextEncoder().encode('nothing of the kind, but long enough to be looked at ...')), /not a whole HDF5 file/);
});

test('groups that share their texts are refused', () => {
  const h5 = new H5Writer(), layer = h5.group([...['title', 'author', 'date'].map((name) => [name, text('')]), ['description', text('d'.repeat(4000))],
    ...['colour', 'opacity', 'visible'].map((name) => [name, u64(1)])]), layers = (n) => h5.group([], Array.from({ length: n }, (_, i) => [String(i).padStart(4, '0'), layer]));
  const file = (n) => {
    const links = [['layers', layers(n)]];
    return h5.end(h5.group([['format', text('EBP-Octree paint 1')], ['format_version_major', i64(1)], ['format_version_minor', i64(0)], ['generator', text('t')], ['model_sha256', text(SHA)],
      ['face_numbers', text('file')], ['layer_count', u64(n)], ...['note', 'stroke', 'point'].map((name) => [`${name}_count`, u64(0)])], links));
  };
  assert.equal(readPaint(file(1)).layers.length, 1);
  assert.throws(() => readPaint(file(MOST.layers)), /groups share it/);
});

test('a damaged byte never gives another drawing', () => {
  const bytes = writePaint(sample()), whole = JSON.stringify(readPaint(bytes));
  for (let i = 0; i < bytes.length; i += 1 + i % 7) {
    const damaged = bytes.slice();
    damaged[i] ^= 1 << i % 8;
    try {
      assert.equal(JSON.stringify(readPaint(damaged)), whole, `byte ${i}`);
    } catch (error) {
      assert.equal(error.name, 'EbpoError', `byte ${i}: ${error.stack}`);
    }
  }
  for (const cut of [0, 1, 47, 48, 500, bytes.length - 1])
    assert.throws(() => readPaint(bytes.slice(0, cut)), { name: 'EbpoError' });
});

test('the checksum of blocks is lookup3, and texts are cleaned', () => {
  assert.equal(lookup3(new TextEncoder().encode('Four score and seven years ago'), 0, 30), 0x17770551); // the published example
  assert.equal(cleanText('a\r\nb\u0007', 9), 'a\u2028b');
  assert.equal(cleanText('ääää', 5), 'ää');
  assert.equal(cleanText('a😀😀', 8), 'a😀');
});

// The vectors of format-spec/paint.md: valid files agree with their texts, and invalid files are refused.
const vectors = process.env.EBPO_PAINT_VECTORS ?? join(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '../../../format-spec/vectors/paint');
test('vectors of paint files', { skip: existsSync(vectors) ? false : 'the vectors are missing' }, () => {
  const files = (folder) => readdirSync(join(vectors, folder)).filter((name) => name.endsWith('.paint.h5'));
  const read = (folder, name) => readPaint(new Uint8Array(readFileSync(join(vectors, folder, name))));
  const wrong = files('failed').filter((name) => {
    try {
      read('failed', name);
      return true;
    } catch (error) {
      assert.equal(error.name, 'EbpoError', `${name}: ${error.stack}`);
      return false;
    }
  });
  assert.deepEqual(wrong, []);
  for (const name of files('passed')) {
    const doc = read('passed', name), expected = JSON.parse(readFileSync(join(vectors, 'passed', name.replace('.paint.h5', '.json')), 'utf8'));
    const hex = (list) => `#${list.map((x) => x.toString(16).padStart(2, '0')).join('')}`, bytesOf = (c) => [24, 16, 8, 0].map((shift) => c >>> shift & 255);
    const layers = doc.layers.map((l) => ({ ...l, colour: hex(bytesOf(l.colour)) }));
    const strokes = doc.strokes.map(({ erases, colour, ...rest }) => ({ ...rest, kind: erases ? 'erases' : 'paints', colour: hex(colour) }));
    assert.deepEqual([doc.model, doc.modelName, doc.unit, doc.faceNumbers], [expected.model_sha256, expected.model_name, expected.unit, expected.face_numbers], name);
    assert.deepEqual({ layers, notes: doc.notes, strokes }, { layers: expected.layers, notes: expected.notes, strokes: expected.strokes }, name);
    assert.deepEqual(readPaint(writePaint(doc)), doc);
  }
  assert.ok(files('passed').length > 0 && files('failed').length > 0);
});
