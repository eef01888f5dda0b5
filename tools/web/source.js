// Sources of bytes. A source has `name`, `size` (in bytes; known after `open()`), `requests` and `bytes` (counted traffic), and
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

/** A Blob or a File, such as from an <input> or a drop. */
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
      throw new EbpoError('NETWORK', `${this.name}: the browser could not read the file (${cause.message}); if it was changed or moved, open it again`, { cause });
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
const PATIENCE_MS = 20000;    // interval of automatic retries of a patient source without a connection
const GOOD_BYTES = 64 * 1024; // a response with this many bytes is no failure: resets the count of retries
const RETRY_STATUS = new Set([429, 500, 502, 503, 504]);

// Responses that a retry cannot fix: their meaning, and what to do next.
const REFUSED = {
  401: ['the server requires a login', 'log in to the server, or use an address that needs no password'],
  403: ['the server does not let this page read the file', 'ask its owner for access, or for a new address if the address was signed and has expired'],
  404: ['there is no such file', 'check the address'],
  410: ['the file was removed from the server', 'check the address'],
};

/** Receives bytes from .. to - 1 over one or more requests. Received bytes are never requested again. */
class Transfer {
  constructor(from, to) {
    Object.assign(this, { from, to, got: 0, data: undefined, at: performance.now(), waiting: [] });
  }

  get end() {
    return this.from + this.got;
  }

  add(bytes) {
    this.data ??= new Uint8Array(this.to - this.from);
    this.data.set(bytes, this.got);
    this.got += bytes.length;
    this.at = performance.now();
    this.waiting = this.waiting.filter((w) => w.to > this.end || w.done());
  }

  /** Resolves when all bytes before `to` are received. */
  reaches(to) {
    return this.end >= to ? undefined : new Promise((done, fail) => this.waiting.push({ to, done, fail }));
  }

  /** Ends the transfer. */
  finish(error) {
    this.waiting.splice(0).forEach((w) => (error ? w.fail(error) : w.done()));
  }
}

/**
 * A file on a static web server, read by range requests. The server must return status 206 with Content-Range. From a server that returns 200, the file is
 * read once and completely, if it is not larger than `wholeLimit`.
 *
 * All responses must have the ETag of the first response, or its Last-Modified when it has no ETag: a file that changes while it is read is an error. This
 * check needs a server that sends one of these headers, and exposes it to pages of other origins.
 *
 * Failed requests are repeated a few times, with growing, randomly varied pauses. The browser's cache may be used: the first request revalidates the cached
 * response.
 *
 * Options:
 *   `wholeLimit`  greatest size of a file that is read completely, 64 MiB by default
 *   `timeout`     longest time without a byte, 30000 ms by default
 *   `fetch`       another implementation of fetch()
 *   `headers`     headers of the requests, for credentials
 *   `ahead`       least size of the first request; its bytes can be read as they arrive
 *   `enoughOf`    function of the file's size: the first response is ended when it has so many bytes; by default it is not ended
 *   `patient`     when the connection is lost, an open file waits for `retry()` instead of failing
 */
export class UrlSource {
  constructor(url, options = {}) {
    this.url = String(url);
    this.name = this.url;
    this.fetch = options.fetch ?? globalThis.fetch.bind(globalThis);
    this.headers = options.headers ?? {};
    this.wholeLimit = options.wholeLimit ?? 64 * 1024 * 1024;
    this.timeout = options.timeout ?? 30000;
    this.ahead = options.ahead ?? 0;
    this.enoughOf = options.enoughOf ?? (() => Infinity);
    this.patient = options.patient ?? false;
    this.requests = this.bytes = 0;
    this.size = undefined;
    this.tag = undefined;     // the first ETag or date of the file
    this.whole = undefined;   // all bytes, from a server without ranges
    this.first = undefined;   // the transfer of the first response; its bytes can be read as they arrive
    this.running = new Map(); // running transfers, with the AbortController of their current request
    this.trouble = undefined; // the error because of which a patient source waits
    this.retried = 0;
    this.closed = false;
    this.byCache = 0;         // number of running requests that use the browser's cache
  }

  async open(bytes) {
    this.asked = bytes;
    this.first = new Transfer(0, Math.max(bytes, this.ahead));
    const all = this.#run(this.first, true), enough = this.first.reaches(bytes);
    all.catch(() => {}); // a later failure is reported to the reader of the bytes
    await Promise.race([all, enough]);
    return this.whole ? this.whole.subarray(0, bytes) : this.first.data.subarray(0, Math.min(bytes, this.first.got));
  }

  async read(offset, length) {
    const end = offset + length, { first } = this;
    if (this.running.has(first) && offset < first.to)
      await first.reaches(Math.min(end, first.to));
    if (this.whole)
      return this.whole.subarray(offset, end);
    const have = Math.max(offset, Math.min(end, first?.end ?? 0));
    if (have === end)
      return first.data.subarray(offset, end);
    const rest = new Transfer(have, end);
    await this.#run(rest, false);
    return have === offset ? rest.data : joined([first.data.subarray(offset, have), rest.data]);
  }

  /** Requests the file's first `bytes` bytes, as far as the first response does not have them. They can be read as they arrive. */
  extend(bytes) {
    const { first } = this, to = Math.min(bytes, this.size);
    if (this.whole || to <= first.to)
      return;
    first.data = first.data && joined([first.data, new Uint8Array(to - first.data.length)]);
    first.to = to;
    first.requested = false; // the new bytes may be in the browser's cache
    if (!this.running.has(first))
      this.#run(first, false).catch(() => {}); // reported to the readers of the bytes
  }

  /** The number of the file's first bytes that have been requested at once. Reading them needs no further request. */
  get coming() {
    return this.whole ? this.whole.length : this.first ? (this.running.has(this.first) ? Math.min(this.first.to, this.size ?? 0) : this.first.end) : 0;
  }

  /** The number of the file's first bytes that have arrived. */
  get come() {
    return this.whole ? this.whole.length : this.first?.got ?? 0;
  }

  /** Returns the unfinished transfers: [{ from, to, got, quiet }]. `quiet`: milliseconds since the last byte. */
  underway() {
    return [...this.running.keys()].filter((t) => t.end < t.to).map((t) => ({ from: t.from, to: t.to, got: t.got, quiet: performance.now() - t.at }));
  }

  /** Repeats all unfinished requests immediately. */
  retry() {
    this.retried++;
    this.again?.();
    this.running.forEach((abort) => abort?.abort());
  }

  /** Ends all transfers. The source cannot be read afterwards. */
  close() {
    this.closed = true;
    this.retry();
  }

  #fail(what, next, cause) {
    return new EbpoError('NETWORK', `${this.url}: ${what}; ${next}`, { cause });
  }

  async #run(transfer, first) {
    this.running.set(transfer, undefined);
    try {
      for (let attempt = 0, before = 0; !this.whole && !(transfer.got === transfer.to - transfer.from); attempt++) {
        const { retried } = this, error = await this.#once(transfer, first && transfer.got === 0).then(() => undefined, (e) => e);
        if (!error)
          continue;
        if (!error.again)
          throw error;
        if (transfer.got - before > GOOD_BYTES)
          attempt = 0;
        before = transfer.got;
        if (retried !== this.retried)
          attempt = -1;
        else if (attempt < RETRIES)
          await this.#pause(WAIT_MS * 2 ** attempt * (0.5 + Math.random()));
        else if (!this.patient || this.tag === undefined)
          throw error;
        else
          attempt = await this.#wait(error);
        if (this.closed)
          throw error;
      }
      transfer.finish();
    } catch (error) {
      transfer.finish(error);
      throw error;
    } finally {
      this.running.delete(transfer);
    }
  }

  #pause(ms) {
    this.woken ??= new Promise((done) => (this.again = done)).then(() => (this.woken = this.again = undefined));
    return Promise.race([this.woken, new Promise((done) => setTimeout(done, ms))]);
  }

  // Waits while the connection is lost. Keeps the transfer and its received bytes.
  async #wait(error) {
    this.trouble = error;
    await this.#pause(PATIENCE_MS);
    this.trouble = undefined;
    return -1;
  }

  // Returns the cache mode of a request. Continued transfers do not use the cache, because Chromium would request their bytes twice. Only one request at a time
  // uses the cache, because Chromium runs cached requests of one address one after the other.
  #cacheMode(transfer, first) {
    return first ? 'no-cache' : this.tag === null || transfer.requested || this.byCache ? 'no-store' : 'default';
  }

  async #once(transfer, first, cache = this.#cacheMode(transfer, first)) {
    const abort = new AbortController(), offset = transfer.end, length = transfer.to - offset;
    let timer, late = false;
    const alive = () => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        late = true;
        abort.abort();
      }, this.timeout);
    };
    alive();
    const transient = (what, next, cause) => Object.assign(this.#fail(what, next, cause), { again: true });
    this.requests++;
    transfer.requested = true;
    this.byCache += cache === 'no-store' ? 0 : 1;
    this.running.set(transfer, abort);
    try {
      // Browsers ignore this Accept-Encoding, and send identity with range requests.
      const response = await this.fetch(this.url, {
        cache, signal: abort.signal, headers: { ...this.headers, 'Range': `bytes=${offset}-${transfer.to - 1}`, 'Accept-Encoding': 'identity' },
      });
      if (RETRY_STATUS.has(response.status))
        throw transient(`the server returned ${response.status}`, 'try again later');
      this.#refused(response, first);
      if (response.headers.get('content-encoding') && response.headers.get('content-encoding') !== 'identity')
        throw this.#fail('the server compresses the file during transfer, so that ranges do not work', 'disable compression for .h5 files on the server');
      if (cache === 'default' && versionOf(response) !== this.tag) { // the response may be an old one from the cache
        abort.abort();
        return await this.#once(transfer, first, 'no-store');
      }
      this.#pin(response, first);
      if (response.status === 200) {
        await this.#takeWhole(response, first, alive);
        return;
      }
      const sent = this.#partial(response, offset, length, first), had = transfer.got;
      const want = first ? Math.min(sent, Math.max(this.asked, this.enoughOf(this.size))) : sent;
      if (first)
        transfer.to = offset + want;
      await this.#drain(response, sent, alive, (bytes) => transfer.add(bytes), want);
      if (transfer.got - had !== want)
        throw transient(`the server sent ${transfer.got - had} bytes of ${want}`, 'try again');
    } catch (cause) {
      if (cause instanceof EbpoError)
        throw cause;
      if (late)
        throw transient(`no data for ${this.timeout / 1000} s`, 'try again later', cause);
      throw transient(`the request failed (${cause.message})`, 'check the address, the network, and that the server allows this page\'s origin (CORS)', cause);
    } finally {
      clearTimeout(timer);
      abort.abort(); // aborts the rest of the body, if any
      this.byCache -= cache === 'no-store' ? 0 : 1;
    }
  }

  #refused({ status, statusText, headers }, first) {
    if (/^text\/html\b/i.test(headers.get('content-type') ?? '') && status < 300)
      throw this.#fail('the server returned text/html, not a model', 'check the address, and whether it needs a login');
    if (status === 206 || status === 200)
      return;
    const outcome = `the server returned ${status} ${statusText}`.trimEnd();
    if (status === 416)
      throw first ? this.#fail(`${outcome}: the file is empty`, 'upload it again') : this.#fail(`${outcome}: the file on the server is shorter than when it was opened`, 'open it again');
    const [what, next] = REFUSED[status] ?? [undefined, 'check the address'];
    throw this.#fail(what ? `${outcome}: ${what}` : outcome, next);
  }

  #pin(response, first) {
    const tag = versionOf(response);
    if (first && this.tag === undefined)
      this.tag = tag;
    else if (tag !== this.tag)
      throw this.#fail('the file was changed on the server since it was opened', 'open it again');
  }

  #partial(response, offset, length, first) {
    const range = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('content-range') ?? '');
    if (!range)
      throw this.#fail('the response has no Content-Range that this page can read', 'let the server send it, and for other origins list it in Access-Control-Expose-Headers');
    const [from, to, size] = range.slice(1).map(Number);
    if (!first && size !== this.size)
      throw this.#fail('the file was changed on the server since it was opened', 'open it again');
    if (from !== offset || to !== Math.min(offset + length, size) - 1 || !Number.isSafeInteger(size))
      throw this.#fail(`the server sent bytes ${from} to ${to} where ${offset} to ${offset + length - 1} were requested`, 'use a server that serves ranges');
    this.size = size;
    return to - from + 1;
  }

  // Takes the response of a server without ranges.
  async #takeWhole(response, first, alive) {
    if (!first)
      throw this.#fail('the server stopped serving ranges', 'open it again');
    const stated = response.headers.get('content-length'), want = stated === null ? undefined : Number(stated), parts = [];
    if (want > this.wholeLimit)
      throw this.#noRanges(`${stated} bytes`);
    await this.#drain(response, want, alive, (bytes) => parts.push(bytes));
    const whole = joined(parts);
    if (want !== undefined && whole.length !== want)
      throw Object.assign(this.#fail(`the server sent ${whole.length} bytes of ${want}`, 'try again'), { again: true });
    this.whole = whole;
    this.size = whole.length;
  }

  #noRanges(size) {
    return this.#fail(`the server does not serve ranges, and the file has ${size}`, 'use a server that returns status 206, or download the file and open it from disk');
  }

  // Reads and counts the body, or its first `enough` bytes. Throws when it is longer than stated.
  async #drain(response, want, alive, take, enough = Infinity) {
    const most = want ?? this.wholeLimit;
    let total = 0;
    for (const reader = response.body.getReader(); ;) {
      const { done, value } = await reader.read();
      if (done)
        return;
      alive();
      total += value.length;
      this.bytes += value.length;
      if (total > most)
        throw want === undefined ? this.#noRanges(`more than ${most} bytes`) : this.#fail('the server sent more bytes than it stated', 'use another server');
      take(total > enough ? value.subarray(0, value.length - total + enough) : value);
      if (total >= enough && enough < want)
        return;
    }
  }
}

// Returns the ETag without the mark of weak tags, which servers and proxies add and remove; or Last-Modified.
const versionOf = (response) => response.headers.get('etag')?.replace(/^W\//, '') ?? response.headers.get('last-modified');

function joined(parts) {
  if (parts.length === 1)
    return parts[0];
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
  return all;
}

/** Returns a source for a URL or its text, a Blob or File, an ArrayBuffer or bytes; returns a source unchanged. */
export function sourceOf(what, options) {
  if (typeof what === 'string' || what instanceof URL)
    return new UrlSource(what, options);
  if (typeof Blob !== 'undefined' && what instanceof Blob)
    return new BlobSource(what);
  if (what instanceof ArrayBuffer || ArrayBuffer.isView(what))
    return new BytesSource(what, options?.name);
  if (typeof what?.open === 'function' && typeof what?.read === 'function')
    return what;
  throw new EbpoError('ARGUMENT', 'expected a URL, a File, an ArrayBuffer or a Uint8Array; pass one of these');
}
