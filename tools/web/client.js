// A worker with one open file, for pages other than the viewer. Queries return promises; other messages call functions.
// worker.js is beside this file, in the package and in the viewer's folder.
const WORKER = new URL('./worker.js', import.meta.url);

// The script of a worker must have the page's own origin. A worker of another origin is imported by a one-line script of the page's origin.
function start(address) {
  const url = new URL(address, location.href);
  if (url.origin === location.origin || !/^https?:/.test(url.protocol))
    return new Worker(url, { type: 'module' });
  const line = URL.createObjectURL(new Blob([`import ${JSON.stringify(url.href)};`], { type: 'text/javascript' }));
  return new Worker(line, { type: 'module' });
}

const AHEAD = 1 << 20;    // bytes of the first request, which contains small models completely
const WORKERS_MOST = 4;   // default for the number of workers of a crew
const PATIENCE_MS = 90;   // shortest time between two views sent to the worker

/** Several workers for many files: each file goes to the worker with the fewest files. */
export class Crew {
  /** `worker`: the address of worker.js; by default, worker.js beside this file. `most`: the greatest number of workers. */
  constructor({ worker = WORKER, most = Math.max(1, Math.min(WORKERS_MOST, (navigator.hardwareConcurrency ?? 2) - 1)) } = {}) {
    Object.assign(this, { address: worker, most });
    this.workers = []; // { worker, members: Map by the number of the file }
    this.files = 0;
  }

  /** Adds a file. `heard(message)` receives the worker's messages about the file, `failed(error)` a failure of the worker. Returns { post(message, transfer), leave() }. */
  join({ heard, failed }) {
    const file = this.files++, fewest = () => this.workers.reduce((a, b) => (b.members.size < a.members.size ? b : a));
    const own = this.workers.length < this.most ? this.#another() : fewest();
    own.members.set(file, { heard, failed });
    return {
      post: (message, transfer = []) => own.members.has(file) && own.worker.postMessage({ file, ...message }, transfer),
      leave: () => {
        if (!own.members.delete(file))
          return;
        own.worker.postMessage({ file, type: 'end' });
        if (!own.members.size)
          this.#dismiss(own);
      },
    };
  }

  #another() {
    const own = { worker: start(this.address), members: new Map() };
    own.worker.onmessage = ({ data }) => own.members.get(data.file)?.heard(data);
    own.worker.onerror = (e) => { // files that are added later get another worker
      const members = [...own.members.values()];
      own.members.clear();
      this.#dismiss(own);
      members.forEach(({ failed }) => failed({ code: 'FAULT', message: `${this.address}: the worker failed (${e.message ?? 'it could not be loaded'}); give the address of worker.js` }));
    };
    this.workers.push(own);
    return own;
  }

  #dismiss(own) {
    own.worker.terminate();
    this.workers = this.workers.filter((other) => other !== own);
  }
}

const problemOf = ({ code, message }) => Object.assign(new Error(message), { name: 'EbpoError', code });

export class Client {
  /**
   * `worker`: the address of worker.js, for a separate worker; or `crew`: a Crew with shared workers. `heard(type, news)` receives the messages tiles, idle, line,
   * failed, loaded and located.
   */
  constructor({ worker, crew = new Crew({ worker, most: 1 }), heard }) {
    this.heard = heard;
    this.opening = this.want = this.queries = 0;
    this.waiting = new Map(); // pending queries for positions, by their numbers
    this.worker = crew.join({ heard: (data) => this.#hear(data), failed: (error) => this.#failed(error) });
  }

  #hear(data) {
    if (data.opening !== this.opening)
      return;
    if (data.type === 'opened') {
      this.info = data.info;
      this.scene = data.scene;
      this.size = data.size;
      this.opened?.done(data);
      this.opened = undefined;
    } else if (data.type === 'probed') {
      if (data.done)
        this.requested?.done(data);
    } else if (data.type === 'positions') {
      const requested = this.waiting.get(data.id);
      data.error ? requested?.fail(problemOf(data.error)) : requested?.done(data.positions);
      this.waiting.delete(data.id);
    } else if (data.type === 'failed') {
      this.#failed(data.error, data.late);
      return;
    }
    this.heard(data.type, data);
  }

  // `late`: the error concerns drawing, not a query.
  #failed(error, late) {
    const problem = problemOf(error);
    if (!late)
      this.#forget(problem);
    this.heard('failed', { error: problem });
  }

  // Rejects pending requests, which will get no response.
  #forget(problem) {
    const all = [this.opened, this.requested, ...this.waiting.values()];
    this.opened = this.requested = undefined;
    this.waiting.clear();
    all.forEach((one) => one?.fail(problem));
  }

  /**
   * Opens an address, a File or a Blob. `ahead`: bytes of the first request; `cacheBytes`: limit of the cache of decoded chunks.
   * Resolves to { info, scene: { center, scale }, size } when the file's header has been read.
   */
  open(what, { ahead = AHEAD, cacheBytes } = {}) {
    this.#forget(new DOMException('another file was opened', 'AbortError'));
    this.info = this.sent = undefined;
    const url = typeof what === 'string' || what instanceof URL ? new URL(what, document.baseURI).href : what;
    const promise = new Promise((done, fail) => (this.opened = { done, fail }));
    this.worker.post({ type: 'open', opening: ++this.opening, what: url, ahead, cacheBytes });
    return promise;
  }

  close() {
    this.#forget(new DOMException('the file was closed', 'AbortError'));
    this.info = undefined;
    this.worker.post({ type: 'close', opening: ++this.opening });
  }

  /**
   * Sends a view to the worker, at a limited rate. `view`: by lookOf() of shade.js; `wanted`: { level, mesh, pixels, triangles, black, lines, cells }.
   * Returns false, and sends nothing, when nothing changed.
   */
  look(view, wanted) {
    const text = JSON.stringify([view, wanted]);
    if (text === this.sent)
      return false;
    this.sent = text;
    this.next = { view, wanted };
    this.timer ??= setTimeout(() => {
      this.timer = undefined;
      this.worker.post({ type: 'view', view: this.next.view, want: { number: ++this.want, ...this.next.wanted } });
    }, PATIENCE_MS);
    return true;
  }

  /** Returns true while the worker does not know the current view. */
  get pending() {
    return this.timer !== undefined;
  }

  /**
   * Queries a point of the model: { point, where, distance, nearest, lo, hi, exact, depth, ... }. A newer query cancels an older one, which rejects with AbortError.
   * `ray`: origin and direction, six numbers; the first point of the faces on it replaces `point`.
   */
  probe(point, ray) {
    this.requested?.fail(new DOMException('a newer query cancelled this one', 'AbortError'));
    const promise = new Promise((done, fail) => (this.requested = { done, fail }));
    this.worker.post({ type: 'probe', opening: this.opening, point, ray });
    return promise;
  }

  /** Returns the nearest positions on the faces for points of the model: [{ face, weights, place, normal, distance }]. */
  positions(points) {
    return this.#query('positions', points);
  }

  /** Returns the faces that points of paint cover: the result of reachOf() of reach.js. */
  reach(points) {
    return this.#query('reach', points);
  }

  #query(type, points) {
    const id = ++this.queries, promise = new Promise((done, fail) => this.waiting.set(id, { done, fail }));
    this.worker.post({ type, opening: this.opening, id, points });
    return promise;
  }

  /** Returns the first point of the faces on a ray (origin and direction, six numbers), or undefined. */
  async hit(ray) {
    return (await this.#query('hit', [ray]))[0];
  }

  /** Repeats pending requests. The next look() sends the current view again. */
  retry() {
    this.sent = undefined;
    this.worker.post({ type: 'retry' });
  }

  end() {
    clearTimeout(this.timer);
    this.#forget(new DOMException('the model was disposed', 'AbortError'));
    this.worker.leave();
  }
}
