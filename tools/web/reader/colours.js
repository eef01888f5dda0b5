// Finds the colour attributes of a file and converts them to bytes: format-spec/attributes.md.
import { formatError } from './error.js';

const CHANNELS = [['red', 'green', 'blue'], ['diffuse_red', 'diffuse_green', 'diffuse_blue']];
const TYPES = { // the typed array of the values, and the value of full intensity
  int8: [Int8Array, 255], uint8: [Uint8Array, 255], int16: [Int16Array, 255], uint16: [Uint16Array, 65535], int32: [Int32Array, 255], uint32: [Uint32Array, 255],
  float32: [Float32Array, 1], float64: [Float64Array, 1],
};
const ARRAYS_MOST = 1000, COLUMNS_MOST = 64;

/** Returns the description of an array of the group, or undefined when it cannot hold colours. `text(name)` returns an attribute. */
export function describeColumns(path, text, isList) {
  const element = text('element'), names = text('columns').split(' '), type = text('type'), coding = text('coding');
  if (isList || !['vertex', 'face'].includes(element))
    return undefined;
  if (!TYPES[type])
    throw formatError(path, 'attribute type: the format does not allow this value');
  if (names.length > COLUMNS_MOST || !['plain', 'column-delta'].includes(coding))
    throw formatError(path, "the format does not allow the array's number of columns or its coding");
  return { path, element, names, type, coding, elementSize: TYPES[type][0].BYTES_PER_ELEMENT };
}

/** Returns the paths of the group's arrays from the group's count. */
export function columnPaths(count) {
  if (count > ARRAYS_MOST)
    throw formatError('/attributes', 'the group has more arrays than the format allows');
  return Array.from({ length: count }, (_, n) => `/attributes/${String(n).padStart(3, '0')}`);
}

/**
 * Finds colours among described arrays. Returns { element, channels: three of { path, column } }, or undefined without colours. Prefers vertex colours, unless all
 * vertices have the same gray.
 */
export function chooseColours(described) {
  const of = (element) => {
    for (const names of CHANNELS) {
      const channels = names.map((name) => {
        const array = described.find((d) => d.element === element && d.names.includes(name));
        return array && { path: array.path, column: array.names.indexOf(name), range: array.range };
      });
      if (channels.every(Boolean))
        return { element, channels };
    }
    return undefined;
  };
  const vertex = of('vertex'), face = of('face'), flat = vertex?.channels.every(({ range }) => range && range[0] === range[1]);
  return face && (!vertex || flat) ? face : vertex;
}

/** Converts a chunk's values to bytes 0 .. 255, row by row. `rows`: the number of rows, padding excluded. */
export function decodeColours(bytes, array, rows) {
  const { cols, elementSize, columns: { type, coding } } = array, [Type, full] = TYPES[type], width = Math.max(cols, 1), out = new Uint8Array(rows * width);
  const whole = bytes.slice(0, rows * width * elementSize), values = new Type(whole.buffer);
  if (coding === 'column-delta')
    undo(whole, elementSize, type.startsWith('float'), rows);
  for (let i = 0; i < out.length; i++) {
    const to = coding === 'column-delta' ? i % rows * width + Math.floor(i / rows) : i;
    out[to] = Math.min(255, Math.max(0, values[i] / full * 255)) + 0.5; // NaN becomes 0
  }
  return out;
}

// Decodes zigzag differences to the previous value of the column, in place.
function undo(bytes, size, isFloat, rows) {
  const wide = size === 8, codes = new ({ 1: Uint8Array, 2: Uint16Array, 4: Uint32Array, 8: BigUint64Array })[size](bytes.buffer), zero = wide ? 0n : 0;
  const difference = wide ? (c) => (c >> 1n) ^ -(c & 1n) : (c) => (c >>> 1) ^ -(c & 1);
  const order = wide ? (v) => (BigInt.asIntN(64, v) < 0n ? v ^ 0x7fffffffffffffffn : v) : (v) => ((v | 0) < 0 ? v ^ 0x7fffffff : v);
  let sum = zero;
  for (let i = 0; i < codes.length; i++) {
    const next = (i % rows ? sum : zero) + difference(codes[i]);
    sum = wide ? BigInt.asUintN(64, next) : next | 0;
    codes[i] = isFloat ? order(sum) : sum;
  }
}
