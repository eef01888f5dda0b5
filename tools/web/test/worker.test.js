// Tests the worker with messages as the page sends them: several files, queries that arrive as soon as a file's header has been read, and closed files.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const listeners = [];
globalThis.self = { addEventListener() {}, postMessage: (message) => [...listeners].forEach((listener) => listener(message)) };
const { setInterval: usual } = globalThis;
globalThis.setInterval = () => {}; // progress is not reported in this test, and no timer keeps node running
await import('../worker.js');
globalThis.setInterval = usual;

const file = new Blob([readFileSync(fileURLToPath(new URL('../../../format-spec/vectors/passed/16_many_subtrees.ebpo.h5', import.meta.url)))]);
const emit = (data) => self.onmessage({ data });
/** Resolves to the first message that fits. */
const heard = (fits) => new Promise((done) => listeners.push(function listener(message) {
  if (!fits(message))
    return;
  listeners.splice(listeners.indexOf(listener), 1);
  done(message);
}));

test('queries that arrive with the header are evaluated, each for its file', async () => {
  const point = [100, 100, 100], replies = [1, 2].map((number) => heard((m) => m.file === number && m.type === 'probed' && m.done));
  const positions = heard((m) => m.file === 2 && m.type === 'positions');
  for (const number of [1, 2]) {
    listeners.push((m) => { // immediately, while the worker still waits for the first levels
      if (m.file === number && m.type === 'opened')
        emit({ file: number, type: 'probe', opening: 5, point });
      if (m.file === 2 && number === 2 && m.type === 'opened')
        emit({ file: 2, type: 'positions', opening: 5, id: 9, points: [point] });
    });
    emit({ file: number, type: 'open', opening: 5, what: file, ahead: 1 << 16 });
  }
  const [one, two] = await Promise.all(replies), { id, positions: [place] } = await positions;
  listeners.length = 0;
  assert.deepEqual([one.opening, two.opening, one.where, id], [5, 5, 'out', 9]);
  assert.equal(one.distance, two.distance);
  assert.ok(Math.abs(place.distance - one.distance) <= 1e-12 * one.distance);
});

test('a failed query is reported to its sender, and a closed file sends no more messages', async () => {
  const wrong = heard((m) => m.file === 1 && m.type === 'positions');
  emit({ file: 1, type: 'positions', opening: 5, id: 10, points: [undefined] });
  const { id, error } = await wrong;
  assert.equal(id, 10);
  assert.ok(error.message);
  const late = [];
  listeners.push((m) => m.file === 2 && late.push(m));
  const going = emit({ file: 2, type: 'positions', opening: 5, id: 11, points: [[0, 0, 0], [1e5, 0, 0], [0, 1e5, 0]] });
  for (let i = 0; i < 5; i++)
    await undefined; // the query has begun
  emit({ file: 2, type: 'end' });
  await going;
  assert.deepEqual(late, []);
});

test('a view with a surface sends one tile, and a view without it sends envelopes again', async () => {
  const blob = new Blob([readFileSync(fileURLToPath(new URL('../../../format-spec/vectors/passed/70_surface_with_subtrees.ebpo.h5', import.meta.url)))]);
  const want = { level: 99, mesh: false, surface: true, pixels: 16, triangles: 2e6 }, view = { eye: [0, 0, 2], planes: [], pixels: 800 }, shown = new Set();
  listeners.push((m) => {
    if (m.file === 3 && m.type === 'tiles') {
      m.removed.forEach((key) => shown.delete(key));
      m.set.forEach(({ key }) => shown.add(key));
    }
  });
  const idle = (number) => heard((m) => m.file === 3 && m.type === 'idle' && m.want === number), located = heard((m) => m.file === 3 && m.type === 'located');
  emit({ file: 3, type: 'open', opening: 1, what: blob, ahead: 1 << 16 });
  await located;
  for (const [number, surface] of [[1, true], [2, false], [3, true]]) {
    const settled = idle(number);
    emit({ file: 3, type: 'view', view, want: { ...want, number, surface } });
    await settled;
    await new Promise((done) => setTimeout(done)); // a page's message arrives later
    assert.equal(shown.has('surface'), surface);
    assert.ok(surface ? shown.size === 1 : shown.size > 0, [...shown].join());
  }
});

test('a damaged border is requested once, and again when caps are switched off and on', async () => {
  const blob = new Blob([readFileSync(fileURLToPath(new URL('../../../format-spec/vectors/failed/border_nan.ebpo.h5', import.meta.url)))]), failed = [];
  const want = { level: 99, mesh: false, pixels: 16, triangles: 2e6 }, view = { eye: [0, 0, 2], planes: [], pixels: 800 };
  listeners.push((m) => m.file === 4 && m.type === 'failed' && failed.push(m.error.code));
  const settledBy = (type, number) => heard((m) => m.file === 4 && m.type === type && (m.want ?? number) === number), located = heard((m) => m.file === 4 && m.type === 'located');
  emit({ file: 4, type: 'open', opening: 1, what: blob, ahead: 1 << 16 });
  await located;
  for (const [number, caps, type, count] of [[1, true, 'failed', 1], [2, true, 'idle', 1], [3, true, 'idle', 1], [4, false, 'idle', 1], [5, true, 'failed', 2]]) {
    const settled = settledBy(type, number);
    emit({ file: 4, type: 'view', view, want: { ...want, number, caps } });
    await settled;
    await new Promise((done) => setTimeout(done, 50)); // a request would have failed by then
    assert.deepEqual(failed, Array(count).fill('FORMAT'), `view ${number}`);
  }
});
