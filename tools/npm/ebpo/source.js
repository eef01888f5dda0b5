// Sources of bytes. A source has a `size` in bytes, a `name` for messages, a `version` that changes with the file ("":
// not known), and `read(ranges, signal)`, which resolves to one Uint8Array for each {offset, size}. All ranges of a call
// are needed together, so a source fetches them at the same time.
import { EbpoArgumentError, EbpoReadError } from './errors.js';
import { IN_NODE, nodeFetch } from './node_http.js';

const HEAD = 131072;
const RETRIES = 3;
const RETRIED = new Set([408, 429, 500, 502, 503, 504]);

/** Returns a source of bytes in memory. */
export function memorySource(data) {
  const bytes = ArrayBuffer.isView(data) ? new Uint8Array(data.buffer, data.byteOffset, data.byteLength) : new Uint8Array(data);
  return { size: bytes.byteLength, name: 'model', version: '', inMemory: true,
    read: async (ranges) => ranges.map(({ offset, size }) => bytes.subarray(offset, offset + size)) };
}

/** Returns a source of a File or Blob. */
export const blobSource = (blob) => ({
  size: blob.size, name: blob.name ?? 'model', version: '',
  read: (ranges) => Promise.all(ranges.map(async ({ offset, size }) => new Uint8Array(await blob.slice(offset, offset + size).arrayBuffer()))),
});

const pause = (seconds, signal) => new Promise((resolve, reject) => {
  const timer = setTimeout(resolve, 1000 * seconds);
  signal?.addEventListener('abort', () => { clearTimeout(timer); reject(signal.reason); }, { once: true });
});

const versionOf = (response) => response.headers.get('etag') ?? response.headers.get('last-modified') ?? '';

/** Returns offset, size and total of a Content-Range header; null if it is not valid. */
function contentRange(response) {
  const match = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('content-range') ?? '');
  return match && { offset: +match[1], size: match[2] - match[1] + 1, total: +match[3] };
}

/** Requests one range, with retries, and checks status and size. */
async function request(url, { offset, size }, { headers, fetch: get = IN_NODE ? nodeFetch : globalThis.fetch }, signal) {
  for (let tries = 0; ; tries++) {
    let problem, cause;
    try {
      const response = await get(url, { signal, headers: { ...headers, Range: `bytes=${offset}-${offset + size - 1}` } });
      if (response.status === 206) {
        const bytes = new Uint8Array(await response.arrayBuffer()), range = contentRange(response);
        if (!range)
          throw new EbpoReadError(`${url}: the server sends no valid Content-Range (pages of other origins need Access-Control-Expose-Headers)`);
        const expected = Math.min(size, range.total - offset);
        if (range.offset !== offset || range.size !== expected)
          throw new EbpoReadError(`${url}: the server sent bytes ${range.offset} to ${range.offset + range.size - 1}, not ${offset} to ${offset + expected - 1}`);
        if (bytes.length === expected)
          return { bytes, total: range.total, version: versionOf(response) };
        problem = `the response has ${bytes.length} bytes, expected ${expected}`;
      } else {
        await response.body?.cancel?.();
        if (!RETRIED.has(response.status))
          throw new EbpoReadError(response.status === 200 ? `${url}: the server does not support range requests`
            : `${url}: the server responded with status ${response.status}`);
        problem = `the server responded with status ${response.status}`;
      }
    } catch (error) {
      signal?.throwIfAborted();
      if (error instanceof EbpoReadError)
        throw error;
      [problem, cause] = [error.message, error];
    }
    if (tries === RETRIES)
      throw new EbpoReadError(`${url}: ${problem} (${RETRIES} retries)`, { cause });
    await pause(0.2 * 2 ** tries, signal);
  }
}

/** Returns a source of a URL, after the first request. Options: headers, fetch. */
export async function urlSource(address, options = {}, signal = undefined) {
  const url = String(address), first = await request(url, { offset: 0, size: HEAD }, options, signal);
  const { total: size, version } = first;
  if (!version && !options.unversioned)
    throw new EbpoReadError(`${url}: the server sends neither ETag nor Last-Modified; the option unversioned accepts that`);
  let head = first.bytes;
  const get = async (range) => {
    if (head && range.offset === 0 && range.size <= head.length) {
      const bytes = head.subarray(0, range.size);
      head = null;
      return bytes;
    }
    const response = await request(url, range, options, signal);
    if (response.total !== size || (response.version !== version && !options.unversioned))
      throw new EbpoReadError(`${url}: the file has changed while it was read`);
    return response.bytes;
  };
  return { size, name: url.replace(/^.*\//, '').replace(/[?#].*/, '') || url, version, headBytes: first.bytes.length,
    read: (ranges, signal) => Promise.all(ranges.map((range) => get(range, signal))) };
}

/** Returns a source for an argument of open(). */
export async function sourceOf(from, options, signal) {
  if (typeof from === 'string' || from instanceof URL)
    return urlSource(from, options, signal);
  if (from instanceof ArrayBuffer || ArrayBuffer.isView(from))
    return memorySource(from);
  if (typeof Blob !== 'undefined' && from instanceof Blob)
    return blobSource(from);
  if (from && typeof from.read === 'function' && Number.isSafeInteger(from.size))
    return from;
  throw new EbpoArgumentError('expected a URL, an ArrayBuffer, a typed array, a Blob, or a source with size and read()', { status: 'EBPO_E_ARGUMENT' });
}
