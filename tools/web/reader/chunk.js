// Decodes chunks as HDF5 stores them: shuffle, zstd or deflate, fletcher32. Compares every checksum and every length.

export const CHUNK_BYTES_MAX = 65536; // size limit before compression
export const FILTER = { deflate: 1, shuffle: 2, fletcher32: 3, zstd: 32015 };

/** Returns 'zstd', 'deflate', 'checksum' or 'bare' for an array's filters, or undefined when the format does not allow the filters. Single bytes may be shuffled too. */
export function pipelineOf(filters, elementSize) {
  const ids = filters.map((f) => f.id), shuffle = elementSize > 1 || ids[0] === FILTER.shuffle ? [FILTER.shuffle] : [];
  const is = (...wanted) => wanted.length === ids.length && wanted.every((id, i) => id === ids[i]);
  if (ids.length && ids[0] === FILTER.shuffle && filters[0].values[0] !== elementSize)
    return undefined;
  if (is(...shuffle, FILTER.zstd))
    return 'zstd';
  if (is(...shuffle, FILTER.deflate, FILTER.fletcher32))
    return 'deflate';
  return is(FILTER.fletcher32) ? 'checksum' : is() ? 'bare' : undefined;
}

/** Returns the maximum size of an encoded chunk in bytes. */
export function chunkBound(bytes) {
  return bytes + (bytes >> 8) + 1024;
}

/** Returns HDF5's fletcher32 checksum: big-endian 16-bit words, sums modulo 65535. */
export function fletcher32(data) {
  let low = 0, high = 0;
  const words = data.length >> 1;
  for (let i = 0; i < words;) {
    for (const stop = Math.min(words, i + 360); i < stop; i++) {
      low += data[2 * i] << 8 | data[2 * i + 1];
      high += low;
    }
    low = (low & 0xffff) + (low >>> 16);
    high = (high & 0xffff) + Math.floor(high / 65536);
  }
  if (data.length & 1) {
    low += data[data.length - 1] << 8;
    high += low;
    low = (low & 0xffff) + (low >>> 16);
    high = (high & 0xffff) + (high >>> 16);
  }
  low = (low & 0xffff) + (low >>> 16);
  high = (high & 0xffff) + (high >>> 16);
  return ((high << 16) | low) >>> 0;
}

function unshuffle(data, size) {
  const count = data.length / size, out = new Uint8Array(data.length);
  for (let k = 0; k < size; k++)
    for (let i = 0, from = k * count, to = k; i < count; i++, to += size)
      out[to] = data[from + i];
  return out;
}

/** Returns true when a compressed block sets one of the two reserved bits of its sequence modes, which zstd ignores. Source: RFC 8878, section 3.1.1.3. */
function modesFault(block) {
  const kind = block[0] & 3, format = block[0] >> 2 & 3;
  let at;
  if (kind < 2) {
    const header = [1, 2, 1, 3][format];
    const count = header === 1 ? block[0] >> 3 : (block[0] | block[1] << 8 | (header === 3 ? block[2] << 16 : 0)) >> 4;
    at = header + (kind === 1 ? 1 : count);
  } else {
    const header = [3, 3, 4, 5][format], width = [10, 10, 14, 18][format];
    let bits = 0;
    for (let i = header - 1; i >= 0; i--)
      bits = bits * 256 + block[i];
    at = header + Math.floor(bits / 2 ** (4 + width)) % 2 ** width;
  }
  if (!(at < block.length) || block[at] === 0) // truncated (decoding reports it), or no sequences
    return false;
  at += block[at] < 128 ? 1 : block[at] < 255 ? 2 : 3;
  return (block[at] & 3) !== 0;
}

/**
 * Checks that a chunk is a single zstd frame with its size and a checksum, and that the frame fills the chunk. Returns the fault, or undefined.
 * (The wasm decoder alone accepts several frames, and frames without a checksum.) Source: RFC 8878, section 3.1.
 */
export function zstdFrameFault(data, size) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  if (data.length < 6 || view.getUint32(0, true) !== 0xfd2fb528)
    return 'not a zstd frame';
  const descriptor = data[4], single = descriptor >> 5 & 1, contentCode = descriptor >> 6;
  const contentBytes = contentCode === 0 ? single : 1 << contentCode;
  let at = 5 + (single ? 0 : 1) + [0, 1, 2, 4][descriptor & 3];
  if (contentBytes === 0 || at + contentBytes > data.length)
    return "the zstd frame does not state the chunk's size";
  let stated = 0;
  for (let i = contentBytes - 1; i >= 0; i--)
    stated = stated * 256 + data[at + i];
  if (stated + (contentBytes === 2 ? 256 : 0) !== size)
    return "the zstd frame does not state the chunk's size";
  if (!(descriptor & 4))
    return 'the zstd frame has no checksum';
  if (descriptor & 16) // a bit that zstd ignores and no checksum covers
    return 'an unused bit of the zstd frame is set';
  at += contentBytes;
  for (let last = 0; !last;) {
    if (at + 3 > data.length)
      return 'the zstd frame is truncated';
    const header = data[at] | data[at + 1] << 8 | data[at + 2] << 16;
    last = header & 1;
    const kind = header >> 1 & 3, size = kind === 1 ? 1 : header >> 3;
    if (kind === 1 && header >> 3 === 1) // zstd writes such a block uncompressed
      return 'a block of the zstd frame repeats its byte once';
    if (kind === 2 && modesFault(data.subarray(at + 3, at + 3 + size)))
      return 'an unused bit of the zstd frame is set';
    at += 3 + size;
  }
  return at + 4 === data.length ? undefined : 'the zstd frame does not fill the chunk';
}

async function inflate(data, most) {
  const stream = new DecompressionStream('deflate'), writer = stream.writable.getWriter();
  writer.write(data).catch(() => {});
  writer.close().catch(() => {});
  const parts = [];
  let total = 0;
  for (const reader = stream.readable.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done)
      break;
    total += value.length;
    if (total > most) {
      reader.cancel().catch(() => {});
      break;
    }
    parts.push(value);
  }
  const out = new Uint8Array(total);
  let at = 0;
  for (const part of parts) {
    out.set(part, at);
    at += part.length;
  }
  return out;
}

let wasm;

/** Loads the default zstd decoder: the wasm of npm's zstddec. Its import needs Node.js, a bundler or an import map. */
async function defaultZstd() {
  wasm ??= import('zstddec').then(({ ZSTDDecoder }) => loadZstd(ZSTDDecoder));
  return wasm;
}

/** Makes a zstd decoder from zstddec's class, for code that cannot resolve bare imports (module workers). */
export async function loadZstd(ZSTDDecoder) {
  const decoder = new ZSTDDecoder();
  await decoder.init();
  return decoder;
}

/**
 * Decodes one stored chunk to exactly `size` bytes. Returns { bytes } or { fault }, where the fault is part of a sentence.
 * `zstd` has decode(bytes, size) like npm's zstddec, which is the default.
 */
export async function decodeChunk(stored, pipeline, elementSize, size, zstd) {
  let data = stored;
  if (pipeline === 'deflate' || pipeline === 'checksum') {
    const end = data.length - 4;
    if (end < 0 || new DataView(data.buffer, data.byteOffset + end, 4).getUint32(0, true) !== fletcher32(data.subarray(0, end)))
      return { fault: 'the fletcher32 checksum does not match' };
    data = data.subarray(0, end);
  }
  if (pipeline === 'zstd') {
    const fault = zstdFrameFault(data, size);
    if (fault)
      return { fault };
    data = (zstd ?? await defaultZstd()).decode(data, size);
    if (data.length !== size) // the decoder returns no bytes on errors
      return { fault: 'the zstd frame does not decode, or its checksum does not match' };
  } else if (pipeline === 'deflate') {
    data = await inflate(data, size).catch(() => new Uint8Array(0));
    if (data.length !== size)
      return { fault: "the deflate stream does not decode to the chunk's size" };
  } else if (data.length !== size) {
    return { fault: "the stored size is not the chunk's size" };
  }
  const shuffled = (pipeline === 'zstd' || pipeline === 'deflate') && elementSize > 1;
  return { bytes: shuffled ? unshuffle(data, elementSize) : data.slice() };
}
