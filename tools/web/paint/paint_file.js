// Reads and writes paint files (format-spec/paint.md) as objects. Reading checks all rules of the format that do not need the model.
//   { model, modelName, unit, faceNumbers, layers: [{ title, author, date, description, colour, opacity, visible }],
//     notes: [{ title, author, date, body, layer, face, weights, place }],
//     strokes: [{ layer, erases, colour: [r, g, b, a], radius, time, points: [{ face, weights, place, size, pressure, time }] }] }
// `colour` of a layer is 0xRRGGBBAA; weights are in units of 2^-30, sizes of 2^-15.
import { EbpoError, formatError } from '../error.js';
import { Facts, Hdf5, fletcher32 } from './read_h5.js';
import { H5Writer, doubles, i64, text, u64 } from './write_h5.js';

const FORMAT = 'EBP-Octree paint 1';
export const MOST = { layers: 1024, notes: 4096, strokes: 2 ** 20, points: 2 ** 24, title: 255, author: 255, description: 4095, body: 32767, bytes: 2 ** 30 };
const ONE_WEIGHT = 2 ** 30, ONE_SIZE = 2 ** 15, FAR = 2 ** 200;
const number4 = (i) => String(i).padStart(4, '0');

// --- writing ---

const bitsOf = (values) => new BigUint64Array(Float64Array.from(values).buffer);

/** Returns the bytes of a paint file. */
export function writePaint(doc) {
  const h5 = new H5Writer(), points = doc.strokes.flatMap((s) => s.points), links = [];
  const group = (name, items, attributesOf) => items.length && links.push([name, h5.group([], items.map((item, i) => [number4(i), h5.group(attributesOf(item))]))]);
  group('layers', doc.layers, (l) => [['title', text(l.title)], ['author', text(l.author)], ['date', text(l.date)], ['description', text(l.description)], ['colour', u64(l.colour)],
    ['opacity', u64(l.opacity)], ['visible', u64(l.visible ? 1 : 0)]]);
  group('notes', doc.notes, (n) => [['title', text(n.title)], ['author', text(n.author)], ['date', text(n.date)], ['body', text(n.body)], ['layer', u64(n.layer)], ['face', u64(n.face)],
    ['weights', doubles(n.weights)], ['place', doubles(n.place)]]);
  const list = (items, arrays) => items.length && links.push([arrays.name, h5.group([], arrays.all.map(([name, values, columns]) => [name, h5.array(values, columns)]))]);
  const { strokes } = doc;
  list(strokes, { name: 'strokes', all: [['layer', Uint32Array.from(strokes, (s) => s.layer)], ['kind', Uint32Array.from(strokes, (s) => (s.erases ? 1 : 0))],
    ['colour', Uint8Array.from(strokes.flatMap((s) => (s.erases ? [0, 0, 0, 0] : s.colour))), 4], ['radius', bitsOf(strokes.map((s) => s.radius))],
    ['time', BigUint64Array.from(strokes, (s) => BigInt(s.time))], ['points', Uint32Array.from(strokes, (s) => s.points.length)]] });
  list(points, { name: 'points', all: [['face', Uint32Array.from(points, (p) => p.face)], ['weights', Uint32Array.from(points.flatMap((p) => p.weights)), 2],
    ['place', bitsOf(points.flatMap((p) => p.place)), 3], ['size', Uint16Array.from(points, (p) => p.size)], ['pressure', Uint16Array.from(points, (p) => p.pressure)],
    ['time', Uint32Array.from(points, (p) => p.time)]] });
  return h5.end(h5.group([['format', text(FORMAT)], ['format_version_major', i64(1)], ['format_version_minor', i64(0)], ['generator', text('ebpo viewer')], ['model_sha256', text(doc.model)],
    ...(doc.modelName ? [['model_name', text(doc.modelName)]] : []), ...(doc.unit ? [['unit', text(doc.unit)]] : []), ['face_numbers', text(doc.faceNumbers)],
    ['layer_count', u64(doc.layers.length)], ['note_count', u64(doc.notes.length)], ['stroke_count', u64(strokes.length)], ['point_count', u64(points.length)]], links));
}

/** Returns a text that the file can hold: without control characters, with at most `most` bytes. Line ends become U+2028. */
export function cleanText(value, most) {
  // eslint-disable-next-line no-control-regex
  const out = value.replace(/\r?\n/g, '\u2028').replace(/[\u0000-\u001f\u007f-\u009f]/g, ' ').replace(/[\ud800-\udbff](?![\udc00-\udfff])|(?<![\ud800-\udbff])[\udc00-\udfff]/g, ' ').trim();
  return out.slice(0, new TextEncoder().encodeInto(out, new Uint8Array(most)).read); // cuts at a character
}

// --- reading ---

class PaintReader {
  constructor(bytes) {
    this.bytes = bytes;
    this.hdf5 = new Hdf5(bytes);
  }

  group(path, address) {
    const o = address === undefined ? undefined : this.hdf5.object(address, path);
    if (o?.kind !== 'group')
      throw formatError(path, 'a group is expected here and there is none');
    return { links: o.links, facts: new Facts(o.attributes, path) };
  }

  // Reads an array: one chunk of complete rows, with a checksum.
  array(path, address, rows, columns, Type) {
    const o = address === undefined ? undefined : this.hdf5.object(address, path), size = Type.BYTES_PER_ELEMENT, shape = columns ? [rows, columns] : [rows];
    const same = (a, b) => a?.length === b.length && a.every((x, i) => x === b[i]);
    if (o?.kind !== 'array' || o.type.class !== 'integer' || !o.type.little || o.type.signed || o.type.size !== size || !o.space.fixed || !same(o.space.dims, shape))
      throw formatError(path, 'the array is missing, or has the wrong type or shape');
    if (!o.layout.chunked || !same(o.layout.chunk, shape) || o.layout.elementSize !== size || o.filters.length !== 1 || o.filters[0].id !== 3)
      throw formatError(path, 'the array is not one chunk with a checksum');
    const whole = rows * (columns || 1) * size, at = this.hdf5.chunk(o, path, whole + 4);
    const stored = this.bytes.slice(at, at + whole + 4);
    if (new DataView(stored.buffer).getUint32(whole, true) !== fletcher32(stored.subarray(0, whole)))
      throw formatError(path, 'the chunk is damaged: its checksum differs');
    return new Type(stored.buffer, 0, whole / size);
  }
}

const must = (condition, where, what) => {
  if (!condition)
    throw formatError(where, what);
};
const reals = (bits) => new Float64Array(bits.buffer, bits.byteOffset, bits.length);
const places = (list, where) => must(list.every((x) => Math.abs(x) <= FAR), where, 'a position is not finite, or is too far away'); // also refuses NaN

/** Reads a paint file from its bytes (Uint8Array). Throws an EbpoError for invalid files. */
export function readPaint(bytes) {
  if (bytes.length > MOST.bytes)
    throw new EbpoError('FORMAT', 'the file is too large for this page; use the command ebpo paint');
  const reader = new PaintReader(bytes.byteOffset % 8 ? bytes.slice() : bytes), { links, facts } = reader.group('/', reader.hdf5.root);
  if (!facts.has('format') || facts.text('format') !== FORMAT)
    throw formatError('', 'an HDF5 file, but not a paint file', 'open one that ends with .paint.h5');
  if (facts.int('format_version_major', -(2 ** 40), 2 ** 40) !== 1)
    throw new EbpoError('VERSION', 'the version of the paint file is newer than this page; use a newer viewer');
  facts.int('format_version_minor');
  facts.text('generator', 63);
  const doc = { model: facts.text('model_sha256', 64), modelName: facts.has('model_name') ? facts.text('model_name', 255) : '', unit: facts.has('unit') ? facts.text('unit', 31) : '',
    faceNumbers: facts.text('face_numbers', 63) };
  must(/^[0-9a-f]{64}$/.test(doc.model), '/', 'attribute model_sha256: not 64 hexadecimal digits');
  must(['source', 'file'].includes(doc.faceNumbers), '/', 'attribute face_numbers: neither source nor file');
  const [layers, notes, strokes, points] = ['layer', 'note', 'stroke', 'point'].map((name) => facts.count(`${name}_count`, MOST[`${name}s`]));
  must(4 * (layers + notes + strokes + points) <= bytes.length, '/', 'the counts are more than the file can hold');
  let room = bytes.length;
  const items = (name, count, of) => {
    const group = count ? reader.group(`/${name}`, links.get(name)) : undefined;
    return Array.from({ length: count }, (_, i) => {
      const path = `/${name}/${number4(i)}`, item = of(reader.group(path, group.links.get(number4(i))).facts, path);
      room -= Object.values(item).reduce((sum, v) => sum + (typeof v === 'string' ? v.length : 0), 0);
      must(room >= 0, path, 'the texts are longer than the file: groups share it');
      return item;
    });
  };
  doc.layers = items('layers', layers, (f) => ({ title: f.text('title', 255), author: f.text('author', 255), date: f.text('date', 31), description: f.text('description', 4095),
    colour: f.count('colour', 2 ** 32 - 1), opacity: f.count('opacity', 255), visible: f.count('visible', 1) === 1 }));
  doc.notes = items('notes', notes, (f, path) => readNote(f, path, layers));
  doc.strokes = strokes ? readStrokes(reader, reader.group('/strokes', links.get('strokes')).links, strokes, layers, points) : [];
  must(strokes > 0 || points === 0, '/', 'there are points without strokes');
  if (points) {
    const all = readPoints(reader, reader.group('/points', links.get('points')).links, points);
    doc.strokes.reduce((at, stroke) => {
      stroke.points = all.slice(at, at + stroke.points);
      return at + stroke.points.length;
    }, 0);
  }
  return doc;
}

function readNote(f, path, layers) {
  must(layers > 0, path, 'a note refers to a missing layer');
  const note = { title: f.text('title', 255), author: f.text('author', 255), date: f.text('date', 31), body: f.text('body', 32767), layer: f.count('layer', layers - 1),
    face: f.count('face', 2 ** 32 - 2), weights: f.reals('weights', 2), place: f.reals('place', 3) };
  must(note.weights.every((w) => Number.isInteger(w) && w >= 0) && note.weights[0] + note.weights[1] <= ONE_WEIGHT, path, 'attribute weights: out of range');
  places(note.place, path);
  return note;
}

function readStrokes(reader, links, count, layers, pointCount) {
  const array = (name, columns, Type) => reader.array(`/strokes/${name}`, links.get(name), count, columns, Type);
  const layer = array('layer', 0, Uint32Array), kind = array('kind', 0, Uint32Array), colour = array('colour', 4, Uint8Array), radius = reals(array('radius', 0, BigUint64Array));
  const time = array('time', 0, BigUint64Array), points = array('points', 0, Uint32Array);
  must(layer.every((l) => l < layers), '/strokes/layer', 'a stroke refers to a missing layer');
  must(kind.every((k) => k <= 1), '/strokes/kind', 'a stroke with an unknown kind');
  must(kind.every((k, i) => k === 0 || colour.subarray(4 * i, 4 * i + 4).every((c) => c === 0)), '/strokes/colour', 'an erasing stroke has a colour');
  must(radius.every((r) => r >= 1 / FAR && r <= FAR), '/strokes/radius', 'a radius is out of range');
  must(time.every((t) => t <= 2n ** 53n), '/strokes/time', 'a time is out of range');
  must(points.every((p) => p > 0) && points.reduce((sum, p) => sum + p, 0) === pointCount, '/strokes/points', 'the numbers of points contradict the number in the header');
  return Array.from(layer, (l, i) => ({ layer: l, erases: kind[i] === 1, colour: [...colour.subarray(4 * i, 4 * i + 4)], radius: radius[i], time: Number(time[i]), points: points[i] }));
}

function readPoints(reader, links, count) {
  const array = (name, columns, Type) => reader.array(`/points/${name}`, links.get(name), count, columns, Type);
  const face = array('face', 0, Uint32Array), weights = array('weights', 2, Uint32Array), place = reals(array('place', 3, BigUint64Array)), size = array('size', 0, Uint16Array);
  const pressure = array('pressure', 0, Uint16Array), time = array('time', 0, Uint32Array);
  must(face.every((f) => f < 2 ** 32 - 1), '/points/face', 'a point refers to no face');
  for (let i = 0; i < count; i++)
    must(weights[2 * i] + weights[2 * i + 1] <= ONE_WEIGHT, '/points/weights', 'the sum of the weights is greater than 1');
  places(place, '/points/place');
  must(size.every((s) => s >= 1 && s <= ONE_SIZE), '/points/size', 'a size is out of range');
  return Array.from(face, (f, i) => ({ face: f, weights: [weights[2 * i], weights[2 * i + 1]], place: [...place.subarray(3 * i, 3 * i + 3)], size: size[i], pressure: pressure[i], time: time[i] }));
}
