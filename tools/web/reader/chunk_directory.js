// Reads the chunk directory of files with subtrees: format-spec/subtrees.md, section 3.
import { formatError } from './error.js';
import { PLACES } from './facts.js';

/** Returns the number of an array in the directory. `order`: the array's index in its level. */
export function arrayNumber(path, level, order) {
  const [, attribute] = /^\/attributes\/(\d{3})$/.exec(path) ?? [];
  return attribute ? 8192 + 2 * Number(attribute) : level === undefined ? ROOT_NUMBERS[path] : 64 * level + order;
}

const ROOT_NUMBERS = { '/mesh/vertices': 4096, '/mesh/faces': 4097, '/mesh/faces_index': 4098, '/maps/vertex_source': 4099, '/maps/face_source': 4100,
  '/border/loops': 4101, '/border/points': 4102,
  '/subtrees/index': 4112, '/subtrees/counts': 4113, '/subtrees/shared_chunks': 4114,
  '/subtrees/chunk_directory': 4115, '/chunk_checksums': 4116 }; // the chunk directory does not list itself, nor do the chunk checksums

const WHERE = PLACES;

function stated(attributes, name) {
  const a = attributes?.get(name);
  return a?.type?.class === 'integer' && a.type.size === 8 && !a.type.signed && a.type.little && a.data.length >= 8
    ? Number(new DataView(a.data.buffer, a.data.byteOffset, 8).getBigUint64(0, true)) : undefined;
}

/** Returns true when an object states the size of the file: only then is it a list about all chunks, whatever else it is. */
export function statesSize(hdf5, address, path, size) {
  return address !== undefined && stated(hdf5.object(address, path).attributes, 'file_bytes') === size;
}

/** Returns true when a list of all chunks is valid. A program that rewrites the file may keep an old list, which is then invalid. */
export function isListValid(list, size) {
  const { attributes } = list.object;
  return stated(attributes, 'file_bytes') === size && list.chunks !== undefined && stated(attributes, 'offset') === list.chunks[0].at;
}

// Returns the offset of the first chunk in the directory, from the header of a level-0 array, which has a single chunk.
function begin(rows, byNumber) {
  let before = 0;
  for (let i = 0; i < rows.length; i += 2) {
    const chunks = byNumber.get(rows[i + 1])?.chunks;
    if (chunks && chunks[0].at >= before)
      return chunks[0].at - before;
    before += rows[i];
  }
  throw formatError(WHERE, 'the chunks of level 0 are missing');
}

/** Decodes the chunk directory. `rows`: for each chunk, its size in bytes and the number of its array; `arrays`: all arrays except the lists. Returns Map(array, [{ at, bytes }]). */
export function readDirectory(rows, arrays, size) {
  const byNumber = new Map(), out = new Map();
  for (const array of arrays) {
    byNumber.set(array.number, array);
    out.set(array, []);
  }
  let at = begin(rows, byNumber);
  for (let i = 0; i < rows.length; i += 2) {
    const array = byNumber.get(rows[i + 1]), bytes = rows[i];
    if (at + bytes > size)
      throw formatError(WHERE, 'a chunk reaches beyond the end of the file');
    if (array) {
      const chunks = out.get(array);
      if (chunks.length === array.chunkCount)
        throw formatError(WHERE, `the list has more chunks of ${array.path} than the array`);
      if (bytes === 0 || bytes > array.chunkMost)
        throw formatError(WHERE, `a chunk of ${array.path} has an invalid size`);
      chunks.push({ at, bytes });
    }
    at += bytes;
  }
  for (const [array, chunks] of out) {
    if (chunks.length !== array.chunkCount)
      throw formatError(WHERE, `the list has fewer chunks of ${array.path} than the array`);
    if (array.chunks && (array.chunks[0].at !== chunks[0].at || array.chunks[0].bytes !== chunks[0].bytes)) // the header of an array with a single chunk has the offset
      throw formatError(WHERE, `the first chunk of ${array.path} is at another offset or has another size`);
  }
  return out;
}
