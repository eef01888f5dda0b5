// Tests strokes and documents: points are closely spaced, pressure widens strokes, points beside the model are omitted, and each step can be undone.
import assert from 'node:assert/strict';
import test from 'node:test';
import { PaintDocument, misfit } from '../paint/document.js';
import { Stroke } from '../paint/stroke.js';

const PIXEL = 0.01; // size of a pixel in the model's unit; the model is visible where x is below 300
const way = { pick: (x, y) => (x < 300 ? [x * PIXEL, y * PIXEL, 0] : undefined), pixels: () => 1 / PIXEL };
const made = (members) => new Stroke({ layer: 0, erases: false, colour: [1, 2, 3, 255], radius: 0.1, ...members }, way);

test('points are closer than half of the radius, also for distant positions of the pen', () => {
  const stroke = made();
  for (const x of [10, 11, 13, 60, 200])
    stroke.to(x, 50, 0.5, false);
  const gaps = stroke.points.slice(1).map((p, i) => p.place[0] - stroke.points[i].place[0]);
  assert.ok(gaps.every((gap) => gap > 0 && gap <= 0.5 * 0.1) && Math.abs(stroke.points.at(-1).place[0] - 2) < 0.05);
  assert.ok(stroke.points.length < 60 && stroke.points.every((p) => p.size === 32768));
});

test('pressure of a stylus widens strokes, and points beside the model are omitted', () => {
  const stroke = made();
  stroke.to(250, 50, 0.1, true);
  stroke.to(280, 50, 0.4, true);
  stroke.to(400, 50, 1, true);
  const sizes = stroke.points.map((p) => p.size);
  assert.ok(sizes.every((s, i) => s >= 1 && s <= 32768 && (i === 0 || s >= sizes[i - 1])) && sizes.at(-1) > 1.5 * sizes[0], String(sizes));
  assert.ok(stroke.points.every((p) => p.place[0] < 3));
  const places = stroke.points.map((p, i) => ({ face: i, weights: [0, 0], place: p.place, normal: [0, 0, 1], distance: i === 1 ? 1 : 0 })), settled = stroke.settled(places);
  assert.deepEqual(settled.points.map((p) => p.face), places.map((p) => p.face).filter((f) => f !== 1)); // this point is far from all faces
});

const INFO = { parts: new Set(['mesh', 'maps']), content_sha256: 'a'.repeat(64), source_face_count: 10, mend_added_faces: 2, face_count: 12, box_origin: [0, 0, 0], box_size: [1, 1, 1] };
test('each step can be undone and redone; a removed layer removes its strokes and notes', () => {
  const doc = new PaintDocument(INFO, 'a.ebpo.h5', () => {}), point = { face: 1, weights: [0, 0], place: [0.5, 0.5, 0.5], size: 1, pressure: 0, time: 0 };
  doc.addLayer({});
  doc.addLayer({ title: 'Other' });
  doc.addStroke({ layer: 0, points: [point] });
  doc.addStroke({ layer: 1, points: [point] });
  doc.addNote({ layer: 1, ...point });
  const full = doc.state;
  doc.removeLayer(0);
  assert.deepEqual([doc.state.layers.map((l) => l.title), doc.state.strokes.map((s) => s.layer), doc.state.notes.map((n) => n.layer)], [['Other'], [0], [0]]);
  doc.undo();
  assert.equal(doc.state, full);
  doc.redo();
  assert.equal(doc.state.layers.length, 1);
  assert.throws(() => doc.addStroke({ layer: 1, points: [point] }), /layer was removed/);
  assert.throws(() => doc.addNote({ layer: 1, ...point }), /layer was removed/);
  for (let i = 0; i < 10; i++)
    doc.undo();
  assert.deepEqual([doc.state.layers.length, doc.isSaved], [0, true]);
});

test('paint of another model, or on faces that the model cannot have, is refused', () => {
  const doc = { model: INFO.content_sha256, modelName: 'b', faceNumbers: 'source', notes: [], strokes: [{ points: [{ face: 11, place: [0, 1, 0.5] }] }] };
  const with_ = (members) => misfit({ ...doc, ...members }, INFO), strokes = (face, place) => [{ points: [{ face, place }] }];
  assert.equal(misfit(doc, INFO), undefined);
  assert.match(with_({ model: 'b'.repeat(64) }), /for "b"/);
  assert.match(with_({ faceNumbers: 'file' }), /open that model/);
  assert.match(with_({ strokes: strokes(12, [0, 0, 0]) }), /cannot have/);
  assert.match(with_({ strokes: strokes(0, [0, 0, 1.5]) }), /cannot have/);
  assert.match(with_({ strokes: strokes(0, [0, 0, 1 + 2e-6]) }), /cannot have/);
  assert.equal(with_({ strokes: strokes(0, [-(2 ** -60), 0.5, 1 + 2 ** -52]) }), undefined); // rounded positions are accepted
  const subset = { ...INFO, content_sha256: 'c'.repeat(64), subset_of: INFO.content_sha256 };
  assert.equal(misfit({ ...doc, strokes: strokes(99, [5, 5, 5]) }, subset), undefined); // may be in another part of the whole model
});
