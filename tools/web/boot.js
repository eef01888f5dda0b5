// Runs while the rest of the page is still loading: reads the address, requests the model, starts the worker and sends the worker the address.
// Messages from the worker are queued for app.js. A bundle contains this script inside index.html.
(() => {
  const FIRST_BYTES = 1 << 20;    // the first response contains small models completely, and the upper levels of large models
  const COARSE_BYTES = 1 << 17;   // when the address selects few levels
  const COARSE_LEVEL = 5;
  const HEAD_BYTES = 1 << 17;     // the worker can begin with so many bytes, and requests more of a large file if it needs more; as in model_file.js
  const LARGE_FILE = 1 << 21;     // as in worker.js
  const PATIENCE_MS = 1500;       // longest time for which app.js waits for HEAD_BYTES
  const FIELD_OF_VIEW = 38;       // vertical, in degrees
  const WASM = 'ebpo/ebpo-view.wasm';

  const query = new URLSearchParams(location.search), messages = [];
  const number = (name) => (/^\d+$/.test(query.get(name) ?? '') ? Number(query.get(name)) : undefined);
  document.documentElement.dataset.theme = query.get('theme') ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');
  if (location.protocol === 'file:') { // browsers load neither modules nor workers for pages opened from disk
    addEventListener('DOMContentLoaded', () => document.documentElement.classList.add('disk'));
    return;
  }
  const worker = new Worker('worker.js', { type: 'module' });
  worker.onmessage = ({ data }) => messages.push(data);
  // Loads the module for drawing in parallel with the worker's script. If this fails, the worker loads it.
  worker.postMessage({ type: 'module' });
  fetch(WASM).then((response) => (response.ok ? response.arrayBuffer() : undefined)).then((bytes) => bytes && WebAssembly.compile(bytes)).catch(() => {})
    .then((module) => worker.postMessage({ type: 'module', loaded: true, module }));
  const boot = window.ebpoBoot = { worker, messages, query, level: number('level'), detail: number('detail'), fieldOfView: FIELD_OF_VIEW, opening: 0, over() {},
    contextOptions: { antialias: true, powerPreference: 'high-performance', preserveDrawingBuffer: true } };
  // A name may contain a literal %.
  boot.nameOf = (url) => {
    const last = url.split(/[?#]/)[0].split('/').at(-1);
    try {
      return decodeURIComponent(last);
    } catch {
      return last;
    }
  };
  boot.ahead = boot.level <= COARSE_LEVEL ? COARSE_BYTES : FIRST_BYTES;
  // Creating the WebGL context takes long. It is created after the first paint of the page, while the code is loading.
  document.addEventListener('readystatechange', () => requestAnimationFrame(() => setTimeout(() => {
    boot.context ??= document.getElementById('canvas').getContext('webgl2', boot.contextOptions);
  })), { once: true });

  // app.js is fetched in parallel, but run only when the page is parsed, as app.js needs its elements and import map, and when the worker has HEAD_BYTES:
  // the response passes through this thread, and three.js would delay it.
  const parsed = new Promise((done) => addEventListener('DOMContentLoaded', done, { once: true }));
  const begin = () => (boot.app ??= parsed.then(() => import('./app.js')).catch((error) => {
    boot.over();
    if (document.getElementById('error').hidden) { // app.js has not explained the error
      document.documentElement.classList.add('opening');
      document.getElementById('openingText').textContent = `The page's code could not be run (${error.message}); reload the page`;
    }
    reportError(error);
  }));

  try {
    boot.url = query.get('file') ? new URL(query.get('file'), location.href).href : undefined;
  } catch {
    boot.url = undefined; // app.js reports the invalid address
  }
  setTimeout(begin, boot.url ? PATIENCE_MS : 0);
  if (!boot.url || !/^https?:/.test(boot.url))
    return;

  // Makes the worker's first request. first_response.js gives the response to the worker as if the worker had sent the request.
  const post = (part, transfer = []) => worker.postMessage({ type: 'first', url: boot.url, ...part }, transfer), abort = new AbortController();
  boot.forget = () => abort.abort();
  boot.opening = 1;
  post({ range: `bytes=0-${boot.ahead - 1}` });
  // Updates the card that is shown before the first picture, until app.js does so.
  let got = 0, last = performance.now();
  const name = boot.nameOf(boot.url), showProgress = () => {
    const text = document.getElementById('openingText'), quiet = Math.floor((performance.now() - last) / 1000);
    if (!text)
      return;
    document.getElementById('openingName').textContent = name;
    text.textContent = quiet > 2 ? `Nothing has come for ${quiet} s; waiting for ${got >= HEAD_BYTES ? "the page's code" : 'the model'}` : got ? `${Math.round(got / 1000)} kB` : 'Requested';
  };
  const timer = setInterval(showProgress, 200);
  document.documentElement.classList.add('opening');
  boot.over = () => clearInterval(timer);
  (async () => {
    const response = await fetch(boot.url, { cache: 'no-cache', signal: abort.signal, headers: { Range: `bytes=0-${boot.ahead - 1}` } });
    const large = Number(/\d+$/.exec(response.headers.get('content-range') ?? '')) > LARGE_FILE;
    post({ head: { status: response.status, statusText: response.statusText, headers: [...response.headers] } });
    for (const reader = response.body.getReader(); ;) {
      const { done, value } = await reader.read();
      if (done)
        break;
      got += value.length;
      last = performance.now();
      post({ bytes: value }, [value.buffer]);
      if (got < HEAD_BYTES)
        continue;
      begin();
      if (large) {
        abort.abort();
        break;
      }
    }
    post({ end: true });
  })().catch((error) => post({ failed: error.message })).finally(begin);

  // Estimates the view of the camera; the page sends the exact view when it is loaded.
  const requested = (query.get('view') ?? '').split(',').filter(Boolean).map(Number);
  const [azimuth = 26.3, height = 18.65, distance = 0.98 / Math.sin(FIELD_OF_VIEW * Math.PI / 360), ...at] = requested.every(Number.isFinite) ? requested : [];
  const a = azimuth * Math.PI / 180, h = height * Math.PI / 180, away = [Math.sin(a) * Math.cos(h), Math.sin(h), Math.cos(a) * Math.cos(h)];
  worker.postMessage({ type: 'open', opening: 1, what: boot.url, ahead: boot.ahead });
  worker.postMessage({ type: 'view', view: { eye: away.map((x, k) => (at[k] ?? 0) + x * distance), planes: [], pixels: innerHeight / (2 * Math.tan(FIELD_OF_VIEW * Math.PI / 360)) },
    want: { number: 0, level: boot.level ?? 99, mesh: false, surface: boot.level === undefined && !query.has('colour'), pixels: boot.detail ?? 16, triangles: 2_000_000 } });
})();
