// Serves ranges of a source to the modules of the package "ebpo". Received bytes are kept, so that drawing and queries do not fetch them twice.
const KEPT_BYTES = 64 << 20;
const END_BYTES = 64 << 10; // a range that is so close to the end of the file is read to the end: lists about all chunks are there

export class KeptSource {
  /** `source`: an open source (source.js), whose first bytes are not kept here. */
  constructor(source, { most = KEPT_BYTES } = {}) {
    Object.assign(this, { source, most, size: source.size, name: source.name, version: '' });
    this.pieces = []; // { from, to, data: a promise of the bytes, used: its last use }, without overlap, by `from`
    this.bytes = this.uses = 0;
  }

  /** Resolves to the bytes of ranges [{ offset, size }], which are fetched at the same time. */
  read(ranges) {
    return Promise.all(ranges.map(({ offset, size }) => this.#range(offset, offset + size)));
  }

  #range(from, to) {
    const { source } = this, begin = Math.max(from, Math.min(to, source.coming ?? 0)), found = begin > from ? [{ from, to: begin, data: source.read(from, begin - from) }] : [];
    for (let at = begin; at < to;) {
      const next = this.pieces.find((piece) => piece.to > at), own = next && next.from <= at ? next : this.#fetch(at, Math.min(to, next?.from ?? Infinity));
      found.push(own);
      at = Math.min(to, own.to);
    }
    return this.#joined(found, from, to);
  }

  #fetch(from, to) {
    const last = !this.pieces.some((piece) => piece.from >= to) && this.size - to <= END_BYTES, end = last ? this.size : to;
    const piece = { from, to: end, data: this.source.read(from, end - from), used: ++this.uses };
    this.pieces.splice(this.pieces.findLastIndex((p) => p.from < from) + 1, 0, piece);
    this.bytes += end - from;
    piece.data.catch(() => this.#forget(piece)); // the next reader tries again
    for (const old of [...this.pieces].sort((a, b) => a.used - b.used)) {
      if (this.bytes <= this.most || old === piece)
        break;
      this.#forget(old);
    }
    return piece;
  }

  #forget(piece) {
    if (!this.pieces.includes(piece))
      return;
    this.pieces.splice(this.pieces.indexOf(piece), 1);
    this.bytes -= piece.to - piece.from;
  }

  async #joined(found, from, to) {
    found.forEach((piece) => (piece.used = ++this.uses));
    const parts = await Promise.all(found.map(({ data }) => data));
    if (parts.length === 1)
      return parts[0].subarray(from - found[0].from, to - found[0].from);
    const all = new Uint8Array(to - from);
    found.forEach((piece, i) => {
      const begin = Math.max(from, piece.from);
      all.set(parts[i].subarray(begin - piece.from, Math.min(to, piece.to) - piece.from), begin - from);
    });
    return all;
  }
}
