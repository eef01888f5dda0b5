// Parts of a file as typed arrays: attributes, textures, subtrees. Functions that begin with "query" return
// {call, read} for Model.
import { EbpoAbsentError } from './errors.js';

const PARTS = ['planes', 'mesh', 'maps', 'leaf-planes', 'attributes', 'colours', 'border', 'surface'];
const TYPES = { int8: Int8Array, uint8: Uint8Array, int16: Int16Array, uint16: Uint16Array, int32: Int32Array, uint32: Uint32Array,
  float32: Float32Array, float64: Float64Array };
const TEXTURE = 'ebpo:texture';
const ELEMENTS = ['vertex', 'face']; // in the order of preference

/** Names of the file's parts. */
export const partsOf = ({ parts }) => PARTS.filter((name, bit) => parts >> bit & 1);

/** Returns {index, column} of an attribute: its array in info.attributes, and its column there. */
export function findAttribute(info, name) {
  const found = info.attributes.flatMap(({ element, names }, index) => names.split(' ').flatMap((each, column) =>
    each === name || `${element}:${each}` === name ? [{ index, column, element }] : []));
  const best = ELEMENTS.map((element) => found.find((each) => each.element === element)).find(Boolean) ?? found[0];
  if (!best)
    throw new EbpoAbsentError(`the file has no attribute ${name}; its attributes: ${attributeNames(info).join(', ') || 'none'}`, { status: 'EBPO_E_ABSENT' });
  return best;
}

export const attributeNames = (info) => info.attributes.flatMap(({ element, names }) => names.split(' ').map((name) => `${element}:${name}`));

/** Returns the rows of the file in the order of their source indices. */
export function sortedRows(sources) {
  const keys = new BigUint64Array(sources.length), halves = new Uint32Array(keys.buffer); // low half, high half
  sources.forEach((source, i) => { halves[2 * i] = i; halves[2 * i + 1] = source; });
  keys.sort();
  return Uint32Array.from(sources, (_, i) => halves[2 * i]);
}

/** Returns rows of an array {values, ends, columns} in another order. */
export function pickRows({ values, ends, columns }, rows) {
  const out = new values.constructor(values.length), outEnds = ends && new Float64Array(ends.length);
  let at = 0;
  rows.forEach((row, i) => {
    const from = ends ? ends[row - 1] ?? 0 : row * columns, to = ends ? ends[row] : from + columns;
    out.set(values.subarray(from, to), at);
    at += to - from;
    if (ends)
      outEnds[i] = at;
  });
  return { values: out, ends: outEnds, columns };
}

/** Returns {values, columns, ends} of the n-th array. */
export const queryAttribute = (heap, info, n, withValues = true) => ({
  call: (query) => heap.call('ebpo_js_attribute', query, n, +withValues),
  read: (array) => {
    const { type, columns } = info.attributes[n], ends = array(1, Float64Array);
    return { values: array(0, TYPES[type]), columns, ends: ends.length ? ends : undefined };
  },
});

/** Returns a column of an array, or all of a list. */
export function columnOf({ values, columns, ends }, column, list) {
  if (list || columns === 1)
    return { values, ends, columns };
  return { values: values.constructor.from({ length: values.length / columns }, (_, i) => values[columns * i + column]), ends: undefined, columns: 1 };
}

/** Returns the indices of the arrays of textures: {name, use, sha256, bytes}. */
export const textureArrays = (info) => Object.fromEntries(info.attributes.flatMap(({ element, names, type, list }, n) =>
  element === TEXTURE && list && type === 'uint8' ? [[names, n]] : []));

/** Returns textures of their arrays. */
export function texturesOf(rows, { name, use, sha256, bytes }) {
  const text = new TextDecoder();
  const row = (of, i) => of && of.values.subarray(of.ends ? of.ends[i - 1] ?? 0 : i * of.columns, of.ends ? of.ends[i] : (i + 1) * of.columns);
  return Array.from({ length: rows }, (_, i) => ({ name: text.decode(row(name, i)), use: text.decode(row(use, i)),
    sha256: Array.from(row(sha256, i) ?? [], (x) => x.toString(16).padStart(2, '0')).join(''), bytes: row(bytes, i)?.slice() }));
}

/** Returns the members of Subtree. */
export const querySubtree = (heap, info, octcode, { levels = -1, memory = 0, orLeafAbove = true } = {}) => ({
  call: (query) => heap.call('ebpo_js_subtree', query, BigInt(octcode), levels, memory, +orLeafAbove),
  read: (array) => {
    const [level, hasFaces, sharedCount] = array(0, Float64Array), some = (n, Type) => { const out = array(n, Type); return out.length ? out : undefined; };
    const faces = () => ({ vertices: array(10, info.doubles ? Float64Array : Float32Array), faces: array(11, Uint32Array), sharedCount, number: array(12, Uint32Array),
      source: some(13, Uint32Array), listFirst: array(14, Uint32Array), list: array(15, Uint32Array) });
    return { level, levelFirst: array(1, BigUint64Array), octcode: array(2, BigUint64Array), type: array(3, Uint8Array), winding: some(4, Int32Array),
      children: array(5, Uint32Array), planeFirst: some(6, Uint32Array), planes: array(7, Uint32Array), aboveFirst: some(8, Uint32Array),
      abovePlanes: array(9, Uint32Array), ...(hasFaces ? faces() : {}) };
  },
});
