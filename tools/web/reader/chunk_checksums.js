// Reads the chunk checksums, an optional list that detects swapped chunks: format-spec/checksums.md, section 3.
import { formatError } from './error.js';

const WHERE = '/chunk_checksums';

/** Decodes the chunk checksums. `rows`: for each chunk, its checksum and its array's number; `arrays`: the file's arrays. Returns Map(array, Uint32Array of checksums). */
export function readChecksums(rows, arrays) {
  const numbers = new Map(), out = new Map();
  for (let begin = 0, end; begin < rows.length; begin = end) {
    const number = rows[begin + 1];
    for (end = begin; end < rows.length && rows[end + 1] === number; end += 2);
    if (end < rows.length && rows[end + 1] < number)
      throw formatError(WHERE, "the list is not in the order of arrays' numbers");
    numbers.set(number, rows.subarray(begin, end).filter((_, i) => i % 2 === 0));
  }
  for (const array of arrays) {
    const sums = numbers.get(array.number) ?? new Uint32Array(0);
    if (sums.length !== array.chunkCount)
      throw formatError(WHERE, `the list has more or fewer chunks of ${array.path} than the array`);
    out.set(array, sums);
  }
  return out;
}

/** Returns the checksum at the end of a chunk, or undefined when the chunk is too short. */
export function chunkEnd(stored) {
  return stored.length >= 4 ? new DataView(stored.buffer, stored.byteOffset + stored.length - 4, 4).getUint32(0, true) : undefined;
}
