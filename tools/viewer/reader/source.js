// Where bytes come from. A source has `name`, `size` (bytes; known after `open()`), `requests` and `bytes` (counted traffic), and
//   open(bytes)           -> Promise<Uint8Array>  the first `bytes` bytes of the file, or all of it when it is shorter
//   read(offset, length)  -> Promise<Uint8Array>  exactly `length` bytes, or an EbpoError
// Ranges are checked by the caller against `size`.
import { EbpoError } from './error.js';

/** Bytes in memory (also a Node.js Buffer). */
export class BytesSource {
  constructor(bytes, name = 'memory') {
    this.data = new Uint8Array(bytes.buffer ?? bytes, bytes.byteOffset ?? 0, bytes.byteLength);
    this.name = name;
    this.size = this.data.length;
    this.requests = this.bytes = 0;
  }

  async open(bytes) {
    return this.read(0, Math.min(bytes, this.size));
  }

  async read(offset, length) {
    this.requests++;
    this.bytes += length;
    return this.data.subarray(offset, offset + length);
  }
}

/** A Blob, so also a File from an <input> or a drop. */
export class BlobSource {
  constructor(blob, name = blob.name ?? 'file') {
    this.blob = blob;
    this.name = name;
    this.size = blob.size;
    this.requests = this.bytes = 0;
  }

  async open(bytes) {
    return this.read(0, Math.min(bytes, this.size));
  }

  async read(offset, length) {
    let data;
    try {
      data = new Uint8Array(await this.blob.slice(offset, offset + length).arrayBuffer());
    } catch (cause) {
      throw new EbpoError('NETWORK', `${this.name}: the browser could not read the file (${cause.message}); was it changed or moved? Open it again`, { cause });
    }
    if (data.length !== length)
      throw new EbpoError('NETWORK', `${this.name}: the file got shorter while it was read; open it again`);
    this.requests++;
    this.bytes += length;
    return data;
  }
}

const RETRIES = 3;
const WAIT_MS = 250;
const RETRY_STATUS = new Set([429, 500, 502, 503, 504]);

/**
 * A file on any static web server, by range requests. The server must answer 206 with Content-Range; one that answers 200 is read once as a
 * whole when the file is not larger than `wholeLimit`. The ETag of the first answer (else Last-Modified) is pinned: a file that changes under
 * way is an error, never a mixture, where the server tells either (and, to pages of other origins, exposes it). Failed requests are repeated a few times, with pauses that grow and vary.
 *
 * Options: `wholeLimit` (bytes, 64 MiB), `timeout` (ms without a byte, 30000), `fetch` (another implementation), `headers` (for credentials).
 */
export class UrlSource {
  constructor(url, options = {}) {
    this.url = String(url);
    this.name = this.url;
    this.fetch = options.fetch ?? globalThis.fetch.bind(globalThis);
    this.headers = options.headers ?? {};
    this.wholeLimit = options.wholeLimit ?? 64 * 1024 * 1024;
    this.timeout = options.timeout ?? 30000;
    this.requests = this.bytes = 0;
    this.size = undefined;
    this.tag = undefined;    // what the file's ETag or date was at first
    this.whole = undefined;  // all bytes, from a server without ranges
  }

  async open(bytes) {
    return this.#range(0, bytes, true);
  }

  async read(offset, length) {
    if (this.whole)
      return this.whole.subarray(offset, offset + length);
    return this.#range(offset, length, false);
  }

  #fail(what, next, cause) {
    return new EbpoError('NETWORK', `${this.url}: ${what}; ${next}`, { cause });
  }

  async #range(offset, length, first) {
    for (let attempt = 0; ; attempt++) {
      try {
        return await this.#once(offset, length, first);
      } catch (error) {
        if (!error.again || attempt === RETRIES)
          throw error;
        await new Promise((done) => setTimeout(done, WAIT_MS * 2 ** attempt * (0.5 + Math.random())));
      }
    }
  }

  async #once(offset, length, first) {
    const abort = new AbortController();
    let timer;
    const alive = () => {
      clearTimeout(timer);
      timer = setTimeout(() => abort.abort(), this.timeout);
    };
    alive();
    const transient = (what, next, cause) => Object.assign(this.#fail(what, next, cause), { again: true });
    this.requests++;
    try {
      // no-store: Chromium serialises concurrent ranges of one URL on its cache. Browsers drop Accept-Encoding, and send identity with ranges.
      const response = await this.fetch(this.url, {
        cache: 'no-store', signal: abort.signal,
        headers: { ...this.headers, 'Range': `bytes=${offset}-${offset + length - 1}`, 'Accept-Encoding': 'identity' },
      });
      if (RETRY_STATUS.has(response.status))
        throw transient(`the server answers ${response.status}`, 'try again later');
      if (response.status !== 206 && response.status !== 200)
        throw this.#fail(`the server answers ${response.status} ${response.statusText}`.trimEnd(), 'check the address');
      if (response.headers.get('content-encoding') && response.headers.get('content-encoding') !== 'identity')
        throw this.#fail('the server compresses the file on the way, which makes ranges meaningless', 'switch that off for .h5 files');
      this.#pin(response, first);
      const want = response.status === 206 ? this.#partial(response, offset, length, first) : this.#wholeFile(response, first);
      const data = await this.#drain(response, want, alive);
      if (want !== undefined && data.length !== want)
        throw transient(`the server sent ${data.length} bytes of ${want}`, 'try again');
      if (response.status === 206)
        return data;
      this.whole = data;
      this.size = data.length;
      return data.subarray(offset, offset + length);
    } catch (cause) {
      if (cause instanceof EbpoError)
        throw cause;
      if (abort.signal.aborted)
        throw transient(`no byte came for ${this.timeout / 1000} s`, 'try again later', cause);
      throw transient(`the request failed (${cause.message})`, 'check the address, the network, and that the server allows this page\'s origin (CORS)', cause);
    } finally {
      clearTimeout(timer);
      abort.abort(); // ends what is left of a body that nobody wants
    }
  }

  #pin(response, first) {
    const tag = response.headers.get('etag') ?? response.headers.get('last-modified');
    if (first && this.tag === undefined)
      this.tag = tag;
    else if (tag !== this.tag)
      throw this.#fail('the file was changed on the server since it was opened', 'open it again');
  }

  #partial(response, offset, length, first) {
    const range = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('content-range') ?? '');
    if (!range)
      throw this.#fail('the answer has no Content-Range that this page may see', 'let the server send it, and from another origin add it to Access-Control-Expose-Headers');
    const [from, to, size] = range.slice(1).map(Number);
    if (!first && size !== this.size)
      throw this.#fail('the file was changed on the server since it was opened', 'open it again');
    if (from !== offset || to !== Math.min(offset + length, size) - 1 || !Number.isSafeInteger(size))
      throw this.#fail(`the server sent bytes ${from} to ${to} where ${offset} to ${offset + length - 1} were asked for`, 'use a server that serves ranges');
    this.size = size;
    return to - from + 1;
  }

  // Returns the length, or undefined when the server does not state it.
  #wholeFile(response, first) {
    if (!first)
      throw this.#fail('the server stopped answering ranges', 'open it again');
    const stated = response.headers.get('content-length');
    if (stated !== null && Number(stated) > this.wholeLimit)
      throw this.#noRanges(`${stated} bytes`);
    return stated === null ? undefined : Number(stated);
  }

  #noRanges(size) {
    return this.#fail(`the server does not serve ranges, and the file has ${size}`, 'use a server that answers 206, or download the file and open it from disk');
  }

  // The body, counted while it comes: never more than was promised.
  async #drain(response, want, alive) {
    const most = want ?? this.wholeLimit;
    const parts = [];
    let total = 0;
    for (const reader = response.body.getReader(); ;) {
      const { done, value } = await reader.read();
      if (done)
        break;
      alive();
      total += value.length;
      this.bytes += value.length;
      if (total > most)
        throw want === undefined ? this.#noRanges(`more than ${most} bytes`) : this.#fail('the server sent more bytes than it said', 'use another server');
      parts.push(value);
    }
    if (parts.length === 1)
      return parts[0];
    const all = new Uint8Array(total);
    let at = 0;
    for (const part of parts) {
      all.set(part, at);
      at += part.length;
    }
    return all;
  }
}

/** A source for whatever was given: URL or its text, Blob or File, ArrayBuffer or bytes, or a source already. */
export function sourceOf(what, options) {
  if (typeof what === 'string' || what instanceof URL)
    return new UrlSource(what, options);
  if (typeof Blob !== 'undefined' && what instanceof Blob)
    return new BlobSource(what);
  if (what instanceof ArrayBuffer || ArrayBuffer.isView(what))
    return new BytesSource(what, options?.name);
  if (typeof what?.open === 'function' && typeof what?.read === 'function')
    return what;
  throw new EbpoError('ARGUMENT', 'this cannot be read; give a URL, a File, an ArrayBuffer or a Uint8Array');
}
