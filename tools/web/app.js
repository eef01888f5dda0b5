// Controls the page: requests, the picture, and messages to and from the worker.
import { cutOf } from './address.js';
import { frameMs, frameTook, isDeeper, makeLevels, showLevel, showLevels, showStats } from './statistics.js';
import { busy, bytes, showError, showLine, showOpening } from './line.js';
import { probeAt, probeShown, probeWith } from './probe.js';
import { listSamples } from './samples.js';
import { applyShown } from './shading.js';
import { Scene } from './scene.js';
import { LEVEL_COLOURS, MESH_COLOUR, TYPE_COLOURS } from './shade.js';
import { address, changed, fileOfEntry, pushStep, setHomeView, setPicture, viewParameters } from './share.js';
import { $, count, emit, on, rayThrough, state, toModel } from './state.js';

const MORE_MS = 5000; // the tools are loaded so long after the first picture, or earlier when all data has arrived
const TRIANGLES_MOST = 2_000_000; // approximate limit

let timer; // until the camera is sent to the worker
let coming; // a promise of more.js, once it has been requested

const boot = window.ebpoBoot, { worker } = boot; // boot.js may already have requested a file
const scene = makeScene();
probeWith(scene, worker);
setPicture(scene);

// Reports a browser without WebGL 2, in which no part of the page can work.
function makeScene() {
  try {
    return new Scene($('canvas'), boot, { changed: cameraMoved, drawn: frameDrawn, lost: contextLost });
  } catch (error) {
    boot.over();
    showOpening();
    $('start').hidden = true;
    showError({ message: 'this page draws with WebGL 2, which this browser does not provide; enable hardware acceleration in its settings, or use another browser' });
    throw error;
  }
}

// The browser takes the graphics context away when memory is short or the driver restarts, and usually restores it soon.
function contextLost(lost) {
  showError(lost ? { message: 'the browser has taken the graphics context away; wait until it is restored, or close other pages and reload this page' } : undefined);
}

// --- opening ---

// `begun`: true when boot.js has already sent the messages to the worker.
function open(what, name, begun) {
  state.opening++;
  Object.assign(state, { info: undefined, depth: -1, idle: false, timeline: [], stats: undefined, probe: undefined, box: undefined, measured: undefined, error: undefined,
    shownAfter: undefined, auto: AUTO.first, frames: [] });
  scene.clear();
  const { camera, level } = viewParameters(new URLSearchParams(location.search));
  Object.assign(state, { levelAsked: level });
  home(camera);
  emit('closed');
  showError();
  busy(true);
  showOpening(name);
  $('start').hidden = true;
  Object.assign(state, { shownName: name, what });
  if (!begun)
    worker.postMessage({ type: 'open', opening: state.opening, what, ahead: boot.ahead });
  requestCut();
}

// `step`: true to add a step to the browser's history; false when the step exists already, or when the page opens with this file.
function openUrl(text, { begun = false, step = true } = {}) {
  let url;
  try {
    url = new URL(text, location.href);
  } catch {
    showError({ message: `${text}: not a valid address; give an address that begins with https://` });
    return;
  }
  if (step)
    pushStep(text);
  $('url').value = text;
  open(url.href, boot.nameOf(url.href), begun);
}

function openFile(file, { step = true } = {}) {
  if (step)
    pushStep(file);
  open(file, file.name);
}

// Shows several models or a scene. The page stays in this mode until it is closed.
async function openTogether(requested) {
  if (state.info || coming || state.together) { // the panel and tools of one model exist already
    showError({ message: 'this page already showed other models; reload the page, and then open these files together' });
    return;
  }
  try {
    const together = await import('./together.js');
    await together.begin({ scene, layout }, await requested(together));
  } catch (error) {
    showOpening();
    showError(error);
  }
}

function openFiles(files) {
  if (files.length > 1)
    openTogether(({ ofFiles }) => ofFiles([...files]));
  else if (files.length)
    openFile(files[0]);
}

function close({ step = true } = {}) {
  if (state.together) {
    location.assign(location.pathname);
    return;
  }
  if (step)
    pushStep();
  state.opening++;
  Object.assign(state, { info: undefined, depth: -1, idle: false });
  emit('closed');
  worker.postMessage({ type: 'close', opening: state.opening });
  scene.clear();
  busy(false);
  showOpening();
  showError();
  for (const id of ['panel', 'bar', 'tools'])
    $(id).hidden = true;
  $('start').hidden = false;
  layout();
  document.title = 'EBP-Octree viewer';
  $('url').focus();
}

// Moves the camera to the view of an address, or to the default view.
function home(camera) {
  scene.home();
  setHomeView();
  if (camera)
    scene.place = camera;
}

// --- from the worker ---

const handlers = {
  located(m) {
    Object.assign(state, { bytesTo: m.bytesTo, traffic: m.traffic });
    makeLevels(chooseLevel);
    levelChanged();
  },
  opened(m) {
    $('ownRow').hidden = !m.coloured;
    $('capsRow').hidden = !m.info.parts.has('border') || m.info.parts.has('pruned');
    Object.assign(state, { info: m.info, scene: m.scene, bytesTo: m.bytesTo, size: m.size, traffic: m.traffic });
    const i = m.info, name = state.shownName ?? m.name;
    $('openingText').textContent = `${count(i.face_count)} faces`;
    document.title = `${name} – EBP-Octree viewer`;
    $('name').textContent = name;
    $('name').title = m.name;
    $('facts').textContent = `${count(i.face_count)} faces · ${i.solid ? 'solid' : 'surface'} · levels 0–${i.level_count - 1} · ${bytes(m.size)}`;
    for (const id of ['panel', 'bar', 'tools'])
      $(id).hidden = id === 'panel' && innerWidth <= 760;
    const stops = i.level_count - 1 + (isDeeper(i) ? 1 : 0);
    $('level').max = stops;
    makeLevels(chooseLevel);
    layout();
    showView(viewParameters(new URLSearchParams(location.search)));
    emit('opened');
  },
  loaded(m) {
    Object.assign(state, { depth: m.depth, timeline: m.timeline, traffic: m.traffic });
    showLevels();
    showStats(scene.cellFaces);
  },
  tiles(m) {
    scene.isClosed = state.info.closed && m.stats?.surface !== undefined;
    scene.setTiles(m.set, m.removed);
    if (m.set.length) {
      if (state.shownAfter === undefined)
        setTimeout(() => more(), MORE_MS);
      state.shownAfter ??= m.ms;
      showOpening();
    }
    Object.assign(state, { stats: m.stats ?? state.stats, traffic: m.traffic });
    showLevels();
    showStats(scene.cellFaces);
  },
  probed(m) {
    state.traffic = m.traffic;
    state.probe = { ...m, precision: state.probe?.precision ?? 0 };
    probeShown();
    showStats(scene.cellFaces);
    emit('probed');
  },
  idle(m) {
    Object.assign(state, { traffic: m.traffic, settled: m.want, idle: m.want === state.want });
    if (state.idle) {
      busy(false);
      refineMore();
      more();
    }
    showStats(scene.cellFaces);
  },
  line(m) {
    state.line = m;
    showLine(m);
  },
  failed(m) {
    showError(m.error, m.error.code === 'NETWORK' ? retry : undefined);
    busy(false);
    showOpening();
    state.error = m.error;
    if (!state.info)
      $('start').hidden = false;
  },
};
worker.onmessage = ({ data }) => {
  if (data.type === 'forget')
    boot.forget();
  else if (data.opening === state.opening)
    (handlers[data.type] ?? ((news) => emit(data.type, news)))(data);
};
worker.onerror = (e) => showError({ message: `The page's worker failed (${e.message ?? 'it could not be loaded'}); run npm ci in tools/web, and reload` });

// --- to the worker ---

// Received data is kept and not requested again. A file that could not be opened is opened again.
function retry() {
  state.error = undefined;
  if (!state.info) {
    open(state.what, state.shownName);
    return;
  }
  worker.postMessage({ type: 'retry' });
  requestCut();
}

function cameraMoved() {
  if (state.together) {
    state.together.moved();
    return;
  }
  timer ??= setTimeout(requestCut, 90);
  changed();
}

function frameDrawn(ms, info) {
  frameTook(ms, info.calls);
  emit('frame');
  if (state.idle && state.frames.length <= AUTO.frames && !state.together)
    refineMore();
}

function requestCut() {
  clearTimeout(timer);
  timer = undefined;
  const top = state.info ? Number($('level').value) === state.info.level_count : state.levelAsked === undefined; // while the file is being opened, the level of the address counts
  const mesh = top && state.info?.parts.has('mesh'), level = top ? 99 : state.info ? Number($('level').value) : state.levelAsked;
  const surface = top && document.querySelector('input[name=colouring]:checked').value === 'plain' && !$('cells').checked;
  state.idle = false;
  if (state.info)
    busy(true);
  worker.postMessage({ type: 'view', view: scene.view(), want: {
    number: ++state.want, level, mesh: Boolean(mesh), surface, pixels: detail(), triangles: detail() === 0 ? Infinity : TRIANGLES_MOST,
    black: scene.cut !== undefined, lines: $('wire').checked, cells: $('cells').checked, caps: $('caps').checked } });
}

// Automatic detail begins with 16 pixels. When this detail is complete, it changes to 32 pixels if frames are slow. If they are fast, envelopes change to 8 pixels; a
// surface, which is similar to the model at 16 pixels, does not: it would need twice the bytes.
const AUTO = { first: 16, fast: 8, fastMs: 30, slow: 32, slowMs: 150, frames: 4 };
const detail = () => ($('detail').value === 'auto' ? state.auto : Number($('detail').value));

function refineMore() {
  if ($('detail').value !== 'auto' || state.auto !== AUTO.first)
    return;
  if (state.frames.length < AUTO.frames) { // draws the same picture again, to measure
    scene.redraw();
    return;
  }
  if (frameMs() >= AUTO.slowMs)
    state.auto = AUTO.slow;
  else if (frameMs() <= AUTO.fastMs && !state.stats?.surface)
    state.auto = AUTO.fast;
  else
    return;
  requestCut();
}

function levelChanged() {
  showLevel();
  changed();
  requestCut();
}

function chooseLevel(level) {
  $('level').value = level;
  levelChanged();
}

// --- view ---

function colouringChanged() {
  const mode = document.querySelector('input[name=colouring]:checked').value;
  scene.setColouring(mode);
  if (state.info?.parts.has('surface')) // other colours are those of envelopes
    requestCut();
  changed();
  const key = (c, text) => {
    const span = document.createElement('span'), i = document.createElement('i');
    i.style.background = c;
    span.append(i, text);
    return span;
  };
  $('legend').replaceChildren(...(mode === 'type' ? [key(TYPE_COLOURS[3], 'gray: has children'), key(TYPE_COLOURS[2], 'leaf'), key(TYPE_COLOURS[1], 'black: inside'), key(MESH_COLOUR, 'mesh')]
    : mode === 'level' ? LEVEL_COLOURS.slice(0, state.info?.level_count ?? 9).map((c, l) => key(c, String(l))) : []));
}

// Applies the clipping plane and the section box together. The box is given by shares of the model's box on each axis, from and to.
function cutChanged() {
  const value = document.querySelector('input[name=clip]:checked').value, { clip } = state, was = scene.cut;
  Object.assign(clip, { axis: value === '' ? undefined : Number(value), at: Number($('clipAt').value) / 1000 });
  $('clipRow').hidden = clip.axis === undefined;
  if (!state.info)
    return;
  const cut = cutOf(state.info.box_size, state.scene.scale, clip, state.box);
  scene.setCut(cut?.low, cut?.high);
  if ((was === undefined) !== (cut === undefined))
    requestCut();
  changed();
  emit('cut');
}

// Applies all parameters of a view in an address.
function showView({ camera, level, clip, box, point, measured, colouring, cellFaces, detail: pixels, shown }) {
  home(camera);
  $('level').value = level ?? $('level').max;
  $('detail').value = pixels;
  $('detail').value ||= 'auto';
  const check = (name, value) => ([...document.querySelectorAll(`input[name=${name}]`)].find((i) => i.value === value) ?? document.querySelector(`input[name=${name}]`)).click();
  Object.assign(state, { box, measured });
  $('clipAt').value = 1000 * (clip?.at ?? 0.5);
  state.clip.flip = clip?.flip ?? false;
  check('clip', clip ? String(clip.axis) : '');
  check('colouring', colouring);
  cutChanged();
  colouringChanged();
  $('cellFaces').checked = cellFaces;
  scene.setCellFaces(cellFaces);
  applyShown(shown);
  levelChanged();
  if (point || state.probe)
    probeAt(point);
  else
    probeShown();
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  scene.setTheme(theme === 'dark');
  emit('theme');
  (state.together ?? { changed }).changed();
}

function layout() {
  const narrow = innerWidth <= 760, shown = !$('panel').hidden;
  scene.setInsets(shown && !narrow ? 310 : 0, shown && narrow ? $('panel').offsetHeight + 60 : 0);
}

// --- wiring ---

$('openForm').onsubmit = (e) => {
  e.preventDefault();
  if ($('url').value.trim())
    openUrl($('url').value.trim());
};
$('file').onchange = () => openFiles($('file').files);
$('close').onclick = close;
$('stallRetry').onclick = () => (state.together ? state.together.retry() : worker.postMessage({ type: 'retry' }));
$('errorClose').onclick = () => showError();
$('level').oninput = levelChanged;
$('detail').onchange = () => {
  requestCut();
  changed();
};
$('cellFaces').onchange = () => {
  scene.setCellFaces($('cellFaces').checked);
  showStats(scene.cellFaces);
  changed();
};
$('own').onchange = () => scene.setOwnColours($('own').checked);
$('wire').onchange = $('cells').onchange = $('caps').onchange = () => {
  requestCut();
  changed();
};
$('colouring').onchange = colouringChanged;
$('clipAxis').onchange = cutChanged;
$('clipAt').oninput = cutChanged;
$('clipFlip').onclick = () => {
  state.clip.flip = !state.clip.flip;
  cutChanged();
};
$('toolHome').onclick = () => {
  home();
  (state.together ?? { changed }).changed();
};
$('toolTheme').onclick = () => setTheme(document.documentElement.dataset.theme === 'light' ? 'dark' : 'light');
$('toolPanel').onclick = () => {
  $('panel').hidden = !$('panel').hidden;
  layout();
};
$('ortho').onchange = () => scene.setOrthographic($('ortho').checked);
$('zUp').onchange = () => {
  scene.setUp($('zUp').checked);
  setHomeView();
};
$('turn').onchange = () => scene.setTurntable($('turn').checked);
$('toolFull').onclick = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen())
  .catch((e) => showError({ message: `no full screen: ${e.message}` }));
const tool = (id) => () => more().then(() => $(id)?.click());
$('toolMeasure').onclick = tool('measureOn');
$('toolNote').onclick = tool('noteAdd');
$('toolSection').onclick = () => choose('clip', 1);
$('toolHelp').onclick = () => $('help').showModal();
let down;
$('canvas').addEventListener('pointerdown', (e) => (down = e.button === 0 ? [e.clientX, e.clientY] : undefined));
$('canvas').addEventListener('pointerup', (e) => {
  if (!down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 4 || !state.info)
    return;
  const point = scene.pick(e.clientX, e.clientY);
  if (!point)
    return;
  const eye = scene.pickedFrom, ray = (p) => eye && rayThrough(toModel(eye), p);
  const query = (p) => (state.together ? state.together.clicked(p) : probeAt(p, scene.pickPrecision(point) / state.scene.scale, ray(p)));
  (state.clicked ?? query)(toModel(point)); // an active tool receives the point
});

addEventListener('dragover', (e) => {
  e.preventDefault();
  $('dropHint').hidden = false;
});
addEventListener('dragleave', (e) => {
  if (!e.relatedTarget)
    $('dropHint').hidden = true;
});
addEventListener('drop', (e) => {
  e.preventDefault();
  $('dropHint').hidden = true;
  const { files } = e.dataTransfer, text = e.dataTransfer.getData('text/uri-list');
  if (state.together)
    showError({ message: 'several models are shown; return to the first page to open others' });
  else if (files.length)
    openFiles(files);
  else if (text)
    openUrl(text);
});
addEventListener('resize', layout);

const click = (id) => () => $(id).click();
const choose = (name, step) => {
  const all = [...document.querySelectorAll(`input[name=${name}]`)], at = all.findIndex((i) => i.checked);
  all[(at + step) % all.length].click();
};
const slide = (id, step, then) => () => {
  $(id).value = Number($(id).value) + step;
  then();
};
const KEYS = {
  arrowleft: slide('level', -1, levelChanged), arrowright: slide('level', 1, levelChanged), g: click('cellFaces'), w: click('wire'), c: click('cells'), m: click('own'), h: click('caps'),
  k: () => choose('colouring', 1), x: () => choose('clip', 1), '[': slide('clipAt', -15, cutChanged), ']': slide('clipAt', 15, cutChanged), '/': click('clipFlip'),
  v: click('ortho'), z: click('zUp'), s: click('turn'), f: click('toolHome'), t: click('toolTheme'), p: click('toolPanel'), '?': click('toolHelp'), o: close,
  ',': slide('level', -1, levelChanged), '.': slide('level', 1, levelChanged),
  escape: () => {
    emit('escape');
    probeAt();
    showError();
  },
};
// In the picture, arrow keys turn the model, or with Shift move it; + and - zoom.
const STEER = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, 1], arrowdown: [0, -1], '+': 0.8, '=': 0.8, '-': 1.25 };

// With several models there is neither a level to choose nor a clipping plane.
const TOGETHER_KEYS = ['g', 'm', 'k', 'f', 't', 'p', '?', 'o'];

addEventListener('keydown', (e) => {
  const writes = e.target.matches('input:not([type=range]):not([type=radio]):not([type=checkbox]), select, textarea');
  if (e.ctrlKey || e.metaKey || e.altKey || document.querySelector('dialog[open]') || (writes && e.key !== 'Escape'))
    return;
  const key = e.key.toLowerCase();
  if (!state.info && !['t', '?'].includes(key))
    return;
  const steer = e.target === $('canvas') ? STEER[key] : undefined;
  if (state.together && key === 'escape') {
    emit('escape');
    showError();
    return;
  }
  if (!steer && (!KEYS[key] || (state.together && !TOGETHER_KEYS.includes(key)))) {
    emit('key', e);
    return;
  }
  e.preventDefault();
  if (steer)
    scene.steer(steer, e.shiftKey);
  else
    KEYS[key]();
});

// --- the history ---

addEventListener('popstate', (e) => {
  if (state.together) {
    location.reload();
    return;
  }
  const query = new URLSearchParams(location.search), what = fileOfEntry(query, e.state);
  if (what === undefined)
    close({ step: false });
  else if (typeof what !== 'string')
    openFile(what, { step: false });
  else if (state.info && typeof state.what === 'string' && new URL(what, location.href).href === state.what)
    showView(viewParameters(query));
  else
    openUrl(what, { step: false });
});

on('complaint', (message) => showError({ message }));

// --- tools that are loaded later: measuring, notes, the pen, sharing ---

// Browsers do not request a module again whose loading failed. A retry therefore uses another address of the same file.
function more(attempt = 0) {
  coming ??= import(new URL(attempt ? `more.js?attempt=${attempt}` : 'more.js', import.meta.url).href).then(
    (m) => m.begin({ scene, worker, requestCut, cutChanged, changed, address, shownAs: (query) => showView(viewParameters(query)), layout, query: boot.query }),
    () => {
      coming = undefined;
      showError({ message: "the page's tools could not be loaded; check the connection" }, () => more(attempt + 1));
    });
  return coming;
}

// --- begin: docs/guide/viewer.md describes the parameters of an address ---

const { query } = boot;
setTheme(document.documentElement.dataset.theme);
$('detail').value = query.get('detail') ?? 'auto';
if (!$('detail').value)
  $('detail').value = 'auto';
if (query.has('samples'))
  listSamples(query.get('samples'), openUrl).catch((e) => showError({ message: `${query.get('samples')}: the list of samples cannot be read (${e.message}); check the address` }));
if (query.has('scene') || query.has('model'))
  openTogether(({ wanted }) => wanted(query, location.href));
else if (query.has('file'))
  openUrl(query.get('file'), { begun: boot.opening === 1, step: false });
boot.over();
boot.messages.splice(0).forEach((data) => worker.onmessage({ data }));

/** The current state, for tests and debugging. */
window.ebpoViewer = {
  get state() {
    return { idle: state.idle, depth: state.depth, stats: state.stats, traffic: state.traffic, timeline: state.timeline, shownAfter: state.shownAfter, probe: state.probe,
      error: state.error, line: state.line,
      levels: state.info?.levels.length, cellFaces: scene.cellFaces, calls: state.calls, detail: detail(), box: state.box, measured: state.measured };
  },
  get place() {
    return state.scene;
  },
  get together() {
    return state.together;
  },
  scene, probeAt, address,
};

// more.js is bundled separately and must not include these modules a second time.
export { kit } from './scene.js';
export * from './shade.js';
export * from './state.js';
