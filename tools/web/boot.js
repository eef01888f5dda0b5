// Runs before the rest of the page, which is still loading: reads the address, requests the model, starts the worker and sends it what to
// open. What the worker has to say meanwhile waits for app.js. In a bundle this stands in index.html itself.
(() => {
  const FIRST_BYTES = 1 << 20;    // small models come whole with the first answer; of large ones the levels that any view begins with
  const COARSE_BYTES = 1 << 17;   // where the address asks for few levels
  const COARSE_LEVEL = 5;
  const HEAD_BYTES = 1 << 17;     // what the worker can begin with
  const PATIENCE_MS = 1500;       // that the page's code waits for them
  const FIELD_OF_VIEW = 38;       // degrees, upwards

  const query = new URLSearchParams(location.search), said = [];
  const number = (name) => (/^\d+$/.test(query.get(name) ?? '') ? Number(query.get(name)) : undefined);
  document.documentElement.dataset.theme = query.get('theme') ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');
  if (location.protocol === 'file:') { // browsers give pages from disk neither modules nor workers
    addEventListener('DOMContentLoaded', () => document.documentElement.classList.add('disk'));
    return;
  }
  const worker = new Worker('worker.js', { type: 'module' });
  worker.onmessage = ({ data }) => said.push(data);
  const boot = window.ebpoBoot = { worker, said, query, level: number('level'), detail: number('detail'), fieldOfView: FIELD_OF_VIEW, opening: 0, over() {},
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
  // The picture's context takes long to make: between the page's first paint and its code there is time for it.
  document.addEventListener('readystatechange', () => requestAnimationFrame(() => setTimeout(() => {
    boot.context ??= document.getElementById('canvas').getContext('webgl2', boot.contextOptions);
  })), { once: true });

  // app.js comes at the same time, but begins when the worker has what it needs: the answer goes through this thread, and three.js would be in its way.
  const begin = () => (boot.app ??= import('./app.js').catch((error) => boot.onerror?.(error)));

  try {
    boot.url = query.get('file') ? new URL(query.get('file'), location.href).href : undefined;
  } catch {
    boot.url = undefined; // app.js says so
  }
  setTimeout(begin, boot.url ? PATIENCE_MS : 0);
  if (!boot.url || !/^https?:/.test(boot.url))
    return;

  // The worker's first request, made here. It gets the answer as if it had asked itself.
  const post = (part, transfer = []) => worker.postMessage({ type: 'first', url: boot.url, ...part }, transfer), abort = new AbortController();
  boot.forget = () => abort.abort();
  boot.opening = 1;
  post({ range: `bytes=0-${boot.ahead - 1}` });
  // The card before the first picture, until app.js takes over.
  let got = 0, last = performance.now();
  const name = boot.nameOf(boot.url), say = () => {
    const text = document.getElementById('openingText'), quiet = Math.floor((performance.now() - last) / 1000);
    if (!text)
      return;
    document.getElementById('openingName').textContent = name;
    text.textContent = quiet > 2 ? `Nothing has come for ${quiet} s; waiting for ${got >= HEAD_BYTES ? "the page's code" : 'the model'}` : got ? `${Math.round(got / 1000)} kB` : 'Asked for';
  };
  const telling = setInterval(say, 200);
  document.documentElement.classList.add('opening');
  boot.over = () => clearInterval(telling);
  (async () => {
    const response = await fetch(boot.url, { cache: 'no-cache', signal: abort.signal, headers: { Range: `bytes=0-${boot.ahead - 1}` } });
    post({ head: { status: response.status, statusText: response.statusText, headers: [...response.headers] } });
    for (const reader = response.body.getReader(); ;) {
      const { done, value } = await reader.read();
      if (done)
        break;
      got += value.length;
      last = performance.now();
      post({ bytes: value }, [value.buffer]);
      if (got >= HEAD_BYTES)
        begin();
    }
    post({ end: true });
  })().catch((error) => post({ failed: error.message })).finally(begin);

  // Estimates the view of the camera; the page sends the exact view when it is loaded.
  const asked = (query.get('view') ?? '').split(',').filter(Boolean).map(Number);
  const [azimuth = 26.3, height = 18.65, distance = 0.98 / Math.sin(FIELD_OF_VIEW * Math.PI / 360), ...at] = asked.every(Number.isFinite) ? asked : [];
  const a = azimuth * Math.PI / 180, h = height * Math.PI / 180, away = [Math.sin(a) * Math.cos(h), Math.sin(h), Math.cos(a) * Math.cos(h)];
  worker.postMessage({ type: 'open', opening: 1, what: boot.url, ahead: boot.ahead });
  worker.postMessage({ type: 'view', view: { eye: away.map((x, k) => (at[k] ?? 0) + x * distance), planes: [], pixels: innerHeight / (2 * Math.tan(FIELD_OF_VIEW * Math.PI / 360)) },
    want: { number: 0, level: boot.level ?? 99, mesh: false, pixels: boot.detail ?? 16, triangles: 2_000_000 } });
})();
