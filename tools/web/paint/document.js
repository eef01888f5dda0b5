// The paint and notes of one model, with undo. States are immutable: each change creates a new state, so that undo is cheap.
import { MOST, cleanText } from './paint_file.js';

const STEPS_MOST = 200;
/** Greatest distance of a point from its face, in diagonals of the root cell. */
export const OFF = 2 ** -20;

/** Returns the digest that a paint file for a model must have, and the kind of its face numbers: format-spec/paint.md, section 2. */
export function identityOf(info) {
  const maps = info.parts.has('maps');
  return { model: maps && info.subset_of ? info.subset_of : info.content_sha256, faceNumbers: maps ? 'source' : 'file' };
}

/** Returns the reason why a paint file does not belong to a model, or undefined. */
export function misfit(doc, info) {
  const { model, faceNumbers } = identityOf(info), wanted = doc.modelName ? `"${doc.modelName}"` : 'another model';
  if (!(doc.model === model && doc.faceNumbers === faceNumbers) && !(doc.faceNumbers === 'source' && info.parts.has('maps') && doc.model === info.content_sha256))
    return `this paint is for ${wanted} (${doc.model.slice(0, 12)}…), not for the open one (${model.slice(0, 12)}…); open that model first`;
  const whole = !info.subset_of, most = faceNumbers === 'source' ? info.source_face_count + info.mend_added_faces : info.face_count;
  const slack = OFF * Math.hypot(...info.box_size);
  const far = (p) => p.some((x, k) => !(x >= info.box_origin[k] - slack && x <= info.box_origin[k] + info.box_size[k] + slack)), all = [...doc.notes, ...doc.strokes.flatMap((s) => s.points)];
  if (whole && all.some((p) => p.face >= most || far(p.place)))
    return 'the paint has points that the model cannot have: the paint file was changed; get a fresh copy';
  return undefined;
}

/** Adds the points of an event "paint" of `ebpo haptic --view` to strokes. Returns { strokes, fresh }: all strokes, and the new points as strokes. */
export function received(before, { count, strokes: parts }) {
  const strokes = before.slice(0, count), fresh = [];
  for (const { number, points, ...stroke } of parts) {
    const added = points.map(([face, a, b, x, y, z, size, pressure, time]) => ({ face, weights: [a, b], place: [x, y, z], size, pressure, time }));
    fresh.push({ ...stroke, points: added });
    strokes[number] = { ...stroke, points: [...(strokes[number]?.points ?? []), ...added] };
  }
  return { strokes, fresh };
}

export const today = () => new Date().toISOString().replace(/\.\d+Z$/, 'Z');

export class PaintDocument {
  /** Calls `changed()` after each step. */
  constructor(info, name, changed) {
    Object.assign(this, { ...identityOf(info), modelName: cleanText(name ?? '', 255), unit: info.unit ?? '', changed });
    this.state = { layers: [], notes: [], strokes: [] };
    this.past = [];
    this.future = [];
    this.saved = this.state;
  }

  /** Replaces the document by the content of a file (readPaint), without undo. */
  take({ layers, notes, strokes }) {
    this.state = { layers, notes, strokes };
    this.saved = this.state;
    this.past = [];
    this.future = [];
    this.changed();
  }

  /** The argument of writePaint(). */
  get file() {
    const { model, modelName, unit, faceNumbers } = this;
    return { model, modelName, unit, faceNumbers, ...this.state };
  }

  get isSaved() {
    return this.saved === this.state;
  }

  /** Makes a new state with these members. Throws when a paint file cannot hold the new state. */
  step(members) {
    const next = { ...this.state, ...members }, points = next.strokes.reduce((sum, s) => sum + s.points.length, 0);
    if (next.layers.length > MOST.layers || next.notes.length > MOST.notes || next.strokes.length > MOST.strokes || points > MOST.points)
      throw new Error('a paint file cannot hold more; save this one, and begin another');
    this.past.push(this.state);
    if (this.past.length > STEPS_MOST)
      this.past.shift();
    this.future = [];
    this.state = next;
    this.changed();
  }

  undo() {
    if (this.past.length) {
      this.future.push(this.state);
      this.state = this.past.pop();
      this.changed();
    }
  }

  redo() {
    if (this.future.length) {
      this.past.push(this.state);
      this.state = this.future.pop();
      this.changed();
    }
  }

  addLayer(layer) {
    const title = `Layer ${this.state.layers.length + 1}`;
    this.step({ layers: [...this.state.layers, { title, author: '', date: today(), description: '', colour: 0xd9483bff, opacity: 255, visible: true, ...layer }] });
  }

  setLayer(number, members) {
    this.step({ layers: this.state.layers.map((l, i) => (i === number ? { ...l, ...members } : l)) });
  }

  /** Removes a layer with its strokes and notes. */
  removeLayer(number) {
    const keep = (items) => items.filter((item) => item.layer !== number).map((item) => (item.layer > number ? { ...item, layer: item.layer - 1 } : item));
    this.step({ layers: this.state.layers.filter((_, i) => i !== number), notes: keep(this.state.notes), strokes: keep(this.state.strokes) });
  }

  /** Throws when a layer does not exist. A file with a stroke or note in a missing layer would be invalid. */
  #mustHave(layer) {
    if (!(layer < this.state.layers.length))
      throw new Error('the layer was removed; choose another layer, and paint again');
  }

  addStroke(stroke) {
    this.#mustHave(stroke.layer);
    this.step({ strokes: [...this.state.strokes, stroke] });
  }

  addNote(note) {
    this.#mustHave(note.layer);
    this.step({ notes: [...this.state.notes, note] });
  }

  setNote(number, members) {
    this.step({ notes: this.state.notes.map((n, i) => (i === number ? { ...n, ...members } : n)) });
  }

  removeNote(number) {
    this.step({ notes: this.state.notes.filter((_, i) => i !== number) });
  }
}
