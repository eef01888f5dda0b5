// A worker and one file open in it, for pages that are not the viewer's own: what is asked is answered by promises, what comes by itself by calls.
// Where the worker's code is, in the package and in the viewer's folder.
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
const PATIENCE_MS = 90;   // at most so often the worker hears of the camera

export class Client {
  /** `worker`: the address of worker.js, or undefined for the one that lies beside this file. `heard(type, news)` gets tiles, idle, line, failed, loaded, located. */
  constructor({ worker = WORKER, heard }) {
    this.worker = start(worker);
    this.heard = heard;
    this.opening = this.want = 0;
    this.worker.onmessage = ({ data }) => this.#hear(data);
    this.worker.onerror = (e) => this.#failed({ code: 'FAULT', message: `${worker}: the worker failed (${e.message ?? 'it could not be loaded'}); give the address of worker.js` });
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
    } else if (data.type === 'failed') {
      this.#failed(data.error);
      return;
    }
    this.heard(data.type, data);
  }

  #failed(error) {
    const problem = Object.assign(new Error(error.message), { name: 'EbpoError', code: error.code });
    const waiting = this.opened ?? this.asked;
    this.opened = this.asked = undefined;
    waiting?.fail(problem);
    this.heard('failed', { error: problem });
  }

  /** An address, a File or a Blob. Resolves when its head is there: { info, scene: { center, scale }, size }. */
  open(what) {
    this.opened?.fail(new DOMException('another file was opened', 'AbortError'));
    this.info = this.sent = undefined;
    const url = typeof what === 'string' || what instanceof URL ? new URL(what, document.baseURI).href : what;
    const promise = new Promise((done, fail) => (this.opened = { done, fail }));
    this.worker.postMessage({ type: 'open', opening: ++this.opening, what: url, ahead: AHEAD });
    return promise;
  }

  close() {
    this.opened?.fail(new DOMException('the file was closed', 'AbortError'));
    this.opened = this.info = undefined;
    this.worker.postMessage({ type: 'close', opening: ++this.opening });
  }

  /** What is seen (lookOf() of shade.js) and wanted: { level, mesh, pixels, triangles, black, lines, cells }. Told to the worker if it is new, and not too often. */
  look(view, wanted) {
    const text = JSON.stringify([view, wanted]);
    if (text === this.sent)
      return;
    this.sent = text;
    this.next = { view, wanted };
    this.timer ??= setTimeout(() => {
      this.timer = undefined;
      this.worker.postMessage({ type: 'view', view: this.next.view, want: { number: ++this.want, ...this.next.wanted } });
    }, PATIENCE_MS);
  }

  /** About a point of the model: { where, distance, nearest, lo, hi, exact, depth, ... }. An answer that another question overtakes never comes: AbortError. */
  probe(point) {
    this.asked?.fail(new DOMException('another point was asked about', 'AbortError'));
    const promise = new Promise((done, fail) => (this.asked = { done, fail }));
    this.worker.postMessage({ type: 'probe', opening: this.opening, point });
    return promise;
  }

  retry() {
    this.worker.postMessage({ type: 'retry' });
  }

  end() {
    clearTimeout(this.timer);
    this.worker.terminate();
  }
}
