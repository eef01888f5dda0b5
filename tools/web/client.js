// A worker with one open file, for other pages than the viewer. Queries return promises; other messages call functions.
// Also finds the worker's code, in the package and in the viewer's folder.
const WORKER = new URL('./worker.js', import.meta.url);

// Workers must come from the page's own origin; those of another one are loaded by a line that is of this one.
function start(address) {
  const url = new URL(address, location.href);
  if (url.origin === location.origin || !/^https?:/.test(url.protocol))
    return new Worker(url, { type: 'module' });
  const line = URL.createObjectURL(new Blob([`import ${JSON.stringify(url.href)};`], { type: 'text/javascript' }));
  return new Worker(line, { type: 'module' });
}

const AHEAD = 1 << 20;    // bytes of the first request: small models come whole
const WORKERS_MOST = 4;   // default number of workers of a crew
const PATIENCE_MS = 90;   // at most so often the worker hears of the camera

/** Several workers for many files: each file goes to the worker with the fewest files. */
export class Crew {
  /** `worker`: the address of worker.js, or undefined for the one that lies beside this file; `most`: how many workers. */
  constructor({ worker = WORKER, most = Math.max(1, Math.min(WORKERS_MOST, (navigator.hardwareConcurrency ?? 2) - 1)) } = {}) {
    Object.assign(this, { address: worker, most });
    this.workers = []; // { worker, members: Map by the number of the file }
    this.files = 0;
  }

  /** For one file more: `heard(message)`, `failed(error)`. Returns { post(message, transfer), leave() }. */
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
    own.worker.onerror = (e) => { // files that come later get another one
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
  /** `worker`: as of a Crew, for a worker of its own; or `crew`, to share some. `heard(type, news)` gets tiles, idle, line, failed, loaded, located. */
  constructor({ worker, crew = new Crew({ worker, most: 1 }), heard }) {
    this.heard = heard;
    this.opening = this.want = this.asks = 0;
    this.waiting = new Map(); // of questions about places, by their numbers
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
        this.asked?.done(data);
    } else if (data.type === 'places') {
      const asked = this.waiting.get(data.id);
      data.error ? asked?.fail(problemOf(data.error)) : asked?.done(data.places);
      this.waiting.delete(data.id);
    } else if (data.type === 'failed') {
      this.#failed(data.error, data.late);
      return;
    }
    this.heard(data.type, data);
  }

  // `late`: of what is drawn, not of a question.
  #failed(error, late) {
    const problem = problemOf(error);
    if (!late)
      this.#forget(problem);
    this.heard('failed', { error: problem });
  }

  // Rejects requests that get no answer any more.
  #forget(problem) {
    const all = [this.opened, this.asked, ...this.waiting.values()];
    this.opened = this.asked = undefined;
    this.waiting.clear();
    all.forEach((one) => one?.fail(problem));
  }

  /** An address, a File or a Blob; `ahead`: bytes of the first request, `cacheBytes`: of decoded chunks that are kept. Resolves when its head is there: { info, scene: { center, scale }, size }. */
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

  /** What is seen (lookOf() of shade.js) and wanted: { level, mesh, pixels, triangles, black, lines, cells }. Sent to the worker if it is new, at a limited rate. Returns true when sent. */
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

  /** Queries a point of the model: { where, distance, nearest, lo, hi, exact, depth, ... }. A newer query cancels an older one: AbortError. */
  probe(point) {
    this.asked?.fail(new DOMException('another point was asked about', 'AbortError'));
    const promise = new Promise((done, fail) => (this.asked = { done, fail }));
    this.worker.post({ type: 'probe', opening: this.opening, point });
    return promise;
  }

  /** Returns the nearest positions on the faces for points of the model: [{ face, weights, place, normal, distance }]. */
  places(points) {
    const id = ++this.asks, promise = new Promise((done, fail) => this.waiting.set(id, { done, fail }));
    this.worker.post({ type: 'places', opening: this.opening, id, points });
    return promise;
  }

  /** Repeats pending requests. The next look() sends the current view again. */
  retry() {
    this.sent = undefined;
    this.worker.post({ type: 'retry' });
  }

  end() {
    clearTimeout(this.timer);
    this.#forget(new DOMException('the model was given up', 'AbortError'));
    this.worker.leave();
  }
}
