// A source with a latency: counts requests, bytes and round trips. Requests that do not wait for each other are one round trip.
import { openSync, readSync, fstatSync } from 'node:fs';

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

export class SlowSource {
  /** `what`: bytes, or a path. `ahead`: least size of the first response. `bandwidth`: in bytes per ms. */
  constructor(what, { latency = 2, ahead = 0, bandwidth = Infinity, name = 'slow' } = {}) {
    Object.assign(this, { latency, ahead, bandwidth, name });
    if (typeof what === 'string') {
      const file = openSync(what);
      this.size = fstatSync(file).size;
      this.take = (offset, length) => {
        const out = new Uint8Array(length);
        readSync(file, out, 0, length, offset);
        return out;
      };
    } else {
      this.size = what.length;
      this.take = (offset, length) => Uint8Array.from(what.subarray(offset, offset + length));
    }
    this.coming = 0;
    this.requested = []; // [offset, length, round trip]
    this.done = 0;   // number of round trips with a response
    this.free = 0;   // time at which the connection is free
    this.requests = this.bytes = this.roundTrips = 0;
  }

  async #request(offset, length) {
    const trip = this.done + 1;
    this.requests++;
    this.bytes += length;
    this.requested.push([offset, length, trip]);
    this.roundTrips = Math.max(this.roundTrips, trip);
    const now = performance.now();
    this.free = Math.max(this.free, now + this.latency) + length / this.bandwidth;
    await pause(this.free - now);
    this.done = Math.max(this.done, trip);
    return this.take(offset, length);
  }

  async open(bytes) {
    const first = Math.min(Math.max(bytes, this.ahead), this.size);
    this.coming = first;
    await this.#request(0, first);
    return this.take(0, Math.min(bytes, this.size));
  }

  async read(offset, length) {
    if (offset < 0 || offset + length > this.size)
      throw new Error(`bytes ${offset} to ${offset + length} of ${this.size} were requested`);
    return offset + length <= this.coming ? this.take(offset, length) : this.#request(offset, length);
  }

  /** Returns { requests, bytes, roundTrips } since the last call. */
  count() {
    const { requests, bytes, done } = this.last ?? { requests: 0, bytes: 0, done: 0 }, out = { requests: this.requests - requests, bytes: this.bytes - bytes, roundTrips: this.done - done };
    this.last = { requests: this.requests, bytes: this.bytes, done: this.done };
    return out;
  }
}
