// SPDX-License-Identifier: MIT
// Changes of files: of any bytes; of the head, whose checksums are made good again; of numbers in chunks that are not compressed, likewise.
import { fletcher32 } from '../../../tools/web/reader/chunk.js';
import { lookup3 } from '../../../tools/web/reader/hdf5.js';
import { EbpoError, openEbpo } from '../../../tools/web/reader/index.js';

const EXTREMES = [0, 1, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff];

function poke(bytes, at, end, pick) {
  const value = EXTREMES[pick(EXTREMES.length)];
  switch (pick(4)) {
    case 0: bytes[at] ^= 1 << pick(8); break;
    case 1: bytes[at] = pick(256); break;
    case 2: bytes[at] = bytes[at] + (pick(2) ? 1 : 255) & 255; break;
    default:
      for (let k = 0; k < 4 && at + k < end; k++)
        bytes[at + k] = value >>> 8 * k & 255;
  }
}

export async function changeBytes(bytes, pick) {
  if (!bytes.length)
    return bytes;
  if (pick(8) === 0)
    return bytes.subarray(0, pick(bytes.length));
  poke(bytes, pick(pick(2) ? Math.min(bytes.length, 4096) : bytes.length), bytes.length, pick);
  return bytes;
}

/** Blocks of the head as [begin, end of what the checksum behind it covers]. */
function blocks(bytes) {
  const found = [], add = (begin, end) => end + 4 <= bytes.length && end > begin && found.push([begin, end]);
  add(0, 44);
  for (let at = bytes.indexOf('OHDR'); at >= 0 && at + 40 < bytes.length; at = bytes.indexOf('OHDR', at + 4)) {
    const flags = bytes[at + 5], size = 1 << (flags & 3);
    let from = at + 6 + (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0), length = 0;
    for (let k = Math.min(size, 4) - 1; k >= 0; k--)
      length = length * 256 + bytes[from + k];
    from += size;
    add(at, from + length);
    for (let m = from; m + 4 <= from + length && m + 24 < bytes.length;) { // continuations
      const type = bytes[m], bytesOf = bytes[m + 1] | bytes[m + 2] << 8, data = m + 4 + (flags & 4 ? 2 : 0);
      if (type === 0x10 && data + 16 <= bytes.length)
        add(Number(bytes.readBigUInt64LE(data)), Number(bytes.readBigUInt64LE(data)) + Number(bytes.readBigUInt64LE(data + 8)) - 4);
      m = data + bytesOf;
    }
  }
  return found;
}

export async function changeHead(bytes, pick) {
  const all = blocks(bytes);
  if (!all.length)
    return bytes;
  const [begin, end] = all[pick(all.length)];
  poke(bytes, begin + pick(end - begin), end, pick);
  bytes.writeUInt32LE(lookup3(bytes, begin, end - begin), end);
  return bytes;
}

export async function changeNumbers(bytes, pick) {
  let file;
  try {
    file = await openEbpo(bytes, { name: 'changed' });
    await file.locate();
  } catch (error) {
    if (error instanceof EbpoError)
      return bytes;
    throw error;
  }
  const arrays = [...file.arrays.values()].filter((a) => a.pipeline === 'checksum' || a.pipeline === 'bare'), array = arrays[pick(arrays.length)];
  if (!array)
    return changeBytes(bytes, pick);
  const { at, bytes: length } = array.chunks[pick(array.chunks.length)], end = at + length - (array.pipeline === 'checksum' ? 4 : 0);
  poke(bytes, at + pick(Math.max(1, Math.floor((end - at) / array.stored.elementSize))) * array.stored.elementSize, end, pick);
  if (array.pipeline === 'checksum')
    bytes.writeUInt32LE(fletcher32(bytes.subarray(at, end)), end);
  return bytes;
}
