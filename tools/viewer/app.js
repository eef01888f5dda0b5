// The page: what is asked for, what is shown, and the worker in between.
import { busy, bytes, showError, showLine, showOpening } from './line.js';
import { LEVEL_COLOURS, MESH_COLOUR, Scene, TYPE_COLOURS } from './scene.js';

const $ = (id) => document.getElementById(id);
const TRIANGLES_MOST = 2_000_000; // about; a tile more does no harm

const state = {
  opening: 0, want: 0, settled: 0, idle: false, info: undefined, scene: undefined, depth: -1, bytesTo: [], timeline: [], stats: undefined, traffic: undefined,
  clip: { axis: undefined, flip: false }, probe: undefined, frames: [],
};

let timer; // until the worker hears of the camera

const boot = window.ebpoBoot, { worker } = boot; // boot.js has begun, perhaps with a file
const scene = new Scene($('canvas'), boot, { changed: cameraMoved, drawn: frameDrawn });

// --- numbers for people ---

const count = (n) => n.toLocaleString('en');
const time = (ms) => (ms < 1000 ? `${Math.round(ms)} ms` : `${(ms / 1000).toFixed(2)} s`);
const length = (x, digits = 5) => `${Number(x.toPrecision(digits))}${state.info?.unit ? ' ' + state.info.unit : ''}`;

// --- opening ---

// `begun`: boot.js has told the worker already.
function open(what, name, begun) {
  state.opening++;
  Object.assign(state, { info: undefined, depth: -1, idle: false, timeline: [], stats: undefined, probe: undefined, error: undefined, shownAfter: undefined, auto: AUTO.first, frames: [] });
  scene.clear();
  scene.home();
  showError();
  busy(true);
  showOpening(name);
  $('start').hidden = true;
  Object.assign(state, { shownName: name, what });
  if (!begun)
    worker.postMessage({ type: 'open', opening: state.opening, what, ahead: boot.ahead });
  ask();
}

function openUrl(text, begun) {
  let url;
  try {
    url = new URL(text, location.href);
  } catch {
    showError({ message: `${text}: this is no address; give one that begins with https://` });
    return;
  }
  const address = new URL(location.href);
  address.searchParams.set('file', text);
  history.replaceState(null, '', address);
  $('url').value = text;
  open(url.href, boot.nameOf(url.href), begun);
}

function openFile(file) {
  const address = new URL(location.href);
  address.searchParams.delete('file');
  history.replaceState(null, '', address);
  open(file, file.name);
}

function close() {
  state.opening++;
  Object.assign(state, { info: undefined, depth: -1 });
  worker.postMessage({ type: 'close', opening: state.opening });
  scene.clear();
  busy(false);
  showOpening();
  showError();
  for (const id of ['panel', 'bar', 'tools'])
    $(id).hidden = true;
  $('start').hidden = false;
  layout();
  $('url').focus();
}

// --- from the worker ---

const handlers = {
  located(m) {
    Object.assign(state, { bytesTo: m.bytesTo, traffic: m.traffic });
    makeLevels();
    levelChanged();
  },
  opened(m) {
    $('ownRow').hidden = !m.coloured;
    Object.assign(state, { info: m.info, scene: m.scene, bytesTo: m.bytesTo, size: m.size, traffic: m.traffic });
    const i = m.info, name = state.shownName ?? m.name;
    $('openingText').textContent = `${count(i.face_count)} faces`;
    document.title = `${name} – EBP-Octree viewer`;
    $('name').textContent = name;
    $('name').title = m.name;
    $('facts').textContent = `${count(i.face_count)} faces · ${i.solid ? 'solid' : 'surface'} · levels 0–${i.level_count - 1} · ${bytes(m.size)}`;
    for (const id of ['panel', 'bar', 'tools'])
      $(id).hidden = id === 'panel' && innerWidth <= 760;
    const stops = i.level_count - 1 + (i.parts.has('mesh') ? 1 : 0);
    $('level').max = stops;
    $('level').value = boot.level ?? stops;
    makeLevels();
    layout();
    scene.home();
    levelChanged();
    clipChanged();
    probeShown();
  },
  loaded(m) {
    Object.assign(state, { depth: m.depth, timeline: m.timeline, traffic: m.traffic });
    showLevels();
    showStats();
  },
  tiles(m) {
    scene.setTiles(m.set, m.removed);
    if (m.set.length) {
      state.shownAfter ??= m.ms;
      showOpening();
    }
    Object.assign(state, { stats: m.stats, traffic: m.traffic });
    showLevels();
    showStats();
  },
  probed(m) {
    state.traffic = m.traffic;
    state.probe = m;
    probeShown();
    showStats();
  },
  idle(m) {
    Object.assign(state, { traffic: m.traffic, settled: m.want, idle: m.want === state.want });
    if (state.idle) {
      busy(false);
      refineMore();
    }
    showStats();
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
    handlers[data.type](data);
};
worker.onerror = (e) => showError({ message: `The page's worker failed (${e.message ?? 'it could not be loaded'}); run npm ci in tools/viewer, and reload` });

// --- to the worker ---

// What came before is kept, and not asked for again; a file that could not be opened is opened anew.
function retry() {
  state.error = undefined;
  if (!state.info) {
    open(state.what, state.shownName);
    return;
  }
  worker.postMessage({ type: 'retry' });
  ask();
}

function cameraMoved() {
  timer ??= setTimeout(ask, 90);
}

function ask() {
  clearTimeout(timer);
  timer = undefined;
  const mesh = state.info?.parts.has('mesh') && Number($('level').value) === state.info.level_count;
  const level = mesh ? 99 : state.info ? Number($('level').value) : boot.level ?? 99; // already right while the file is being opened
  state.idle = false;
  if (state.info)
    busy(true);
  worker.postMessage({ type: 'view', view: scene.view(), want: {
    number: ++state.want, level, mesh: Boolean(mesh), pixels: detail(), triangles: detail() === 0 ? Infinity : TRIANGLES_MOST,
    black: state.clip.axis !== undefined, lines: $('wire').checked, cells: $('cells').checked } });
}

// Automatic detail: 16 pixels, and when all of that is there 8 if the frames are fast, 32 if they are slow.
const AUTO = { first: 16, fast: 8, fastMs: 30, slow: 32, slowMs: 150 };
const detail = () => ($('detail').value === 'auto' ? state.auto : Number($('detail').value));

function refineMore() {
  if ($('detail').value !== 'auto' || state.auto !== AUTO.first || !state.frames.length || (frameMs() > AUTO.fastMs && frameMs() < AUTO.slowMs))
    return;
  state.auto = frameMs() <= AUTO.fastMs ? AUTO.fast : AUTO.slow;
  ask();
}

// --- level strip ---

const bytesOf = (size) => (size >= 0 ? bytes(size) : 'not yet known how much');

function makeLevels() {
  const i = state.info, sizes = i.levels.map((_, l) => state.bytesTo[l] - (l ? state.bytesTo[l - 1] : 0)), stops = [...sizes]; // NaN: not known yet
  if (i.parts.has('mesh'))
    stops.push(state.size - state.bytesTo.at(-1));
  const most = Math.max(...stops.filter((size) => size >= 0), 1);
  $('levels').replaceChildren(...stops.map((size, l) => {
    const b = document.createElement('button'), bar = document.createElement('i'), isMesh = l === i.level_count;
    bar.style.height = `${4 + 24 * Math.sqrt((size || 0) / most)}px`;
    b.append(bar, isMesh ? '▲' : String(l));
    b.title = isMesh ? `The mesh: ${bytesOf(size)}, fetched where it is seen` : `Level ${l}: ${bytesOf(size)}; file up to here ${bytesOf(state.bytesTo[l])}`;
    b.onclick = () => {
      $('level').value = l;
      levelChanged();
    };
    return b;
  }));
}

function showLevels() {
  const at = Number($('level').value), drawn = state.stats?.levels ?? [];
  [...$('levels').children].forEach((b, l) => {
    const isMesh = l === state.info.level_count;
    b.classList.toggle('here', isMesh ? (state.stats?.meshTriangles ?? 0) > 0 : l <= state.depth);
    b.classList.toggle('shown', isMesh ? (state.stats?.meshTriangles ?? 0) > 0 : (drawn[l] ?? 0) > 0);
    b.classList.toggle('now', l === at);
  });
}

function levelChanged() {
  const at = Number($('level').value), i = state.info, mesh = at === i.level_count;
  $('levelText').textContent = mesh ? 'all, and the mesh' : `0 to ${at}`;
  $('levelHint').textContent = mesh ? 'Refined where it is seen; leaves show the real faces.' : `Envelopes of level ${at} and of leaves above it: ${bytesOf(state.bytesTo[at])} of the file.`;
  const excess = volumeExcess(Math.min(at, i.level_count - 1));
  $('sExcess').textContent = excess === undefined || mesh ? '–' : `+${excess < 10 ? excess.toFixed(2) : excess.toFixed(0)} %`;
  showLevels();
  ask();
}

// The stated volumes: envelopes of the level's gray nodes, leaves and black cells so far, against the model.
function volumeExcess(level) {
  const i = state.info;
  if (!i.solid || !(i.mesh_volume > 0) || i.winding_rule !== 'nonzero')
    return undefined;
  let sum = i.levels[level].gray_volume;
  for (let l = 0; l <= level; l++)
    sum += i.levels[l].leaf_volume + i.levels[l].black * i.box_size.reduce((v, s) => v * (s / 2 ** l), 1);
  return Math.max(0, 100 * (sum / i.mesh_volume - 1));
}

// --- statistics ---

function frameDrawn(ms, info) {
  state.frames.push(ms);
  if (state.frames.length > 30)
    state.frames.shift();
  state.calls = info.calls;
  $('sFrame').textContent = `${frameMs().toFixed(1)} ms`;
  $('sFrame').title = `${info.calls} draw calls`;
}

const frameMs = () => state.frames.reduce((a, b) => a + b, 0) / Math.max(state.frames.length, 1);

function showStats() {
  if (!state.info)
    return;
  const s = state.stats, t = state.traffic;
  $('sRequests').textContent = count(t.requests);
  $('sBytes').textContent = `${bytes(t.bytes)} of ${bytes(state.size)}`;
  $('sFirst').textContent = state.shownAfter === undefined ? '' : time(state.shownAfter);
  $('sLevels').textContent = state.depth < 0 ? '' : `0–${state.depth} of 0–${state.info.level_count - 1}`;
  if (s) {
    const drawn = s.triangles - (scene.walls ? 0 : s.wallTriangles);
    $('sNodes').textContent = count(s.nodes);
    $('sTriangles').textContent = count(drawn);
    $('sMesh').textContent = state.info.parts.has('mesh') ? count(s.meshTriangles) : 'not in the file';
  }
}

// --- view ---

function colouringChanged() {
  const mode = document.querySelector('input[name=colouring]:checked').value;
  scene.setColouring(mode);
  const key = (c, text) => {
    const span = document.createElement('span'), i = document.createElement('i');
    i.style.background = c;
    span.append(i, text);
    return span;
  };
  $('legend').replaceChildren(...(mode === 'type' ? [key(TYPE_COLOURS[3], 'gray: goes on'), key(TYPE_COLOURS[2], 'leaf'), key(TYPE_COLOURS[1], 'black: full'), key(MESH_COLOUR, 'mesh')]
    : mode === 'level' ? LEVEL_COLOURS.slice(0, state.info?.level_count ?? 9).map((c, l) => key(c, String(l))) : []));
}

function clipChanged() {
  const value = document.querySelector('input[name=clip]:checked').value, was = state.clip.axis;
  state.clip.axis = value === '' ? undefined : Number(value);
  $('clipRow').hidden = state.clip.axis === undefined;
  if (state.clip.axis === undefined) {
    scene.setClip();
  } else {
    const k = state.clip.axis, half = state.info ? state.info.box_size[k] / 2 * state.scene.scale : 1, sign = state.clip.flip ? -1 : 1;
    const normal = [0, 0, 0];
    normal[k] = sign;
    scene.setClip(normal, sign * half * (Number($('clipAt').value) / 500 - 1));
  }
  if (state.info && (was === undefined) !== (state.clip.axis === undefined))
    ask();
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  scene.setTheme(theme === 'dark');
}

function layout() {
  const narrow = innerWidth <= 760, shown = !$('panel').hidden;
  scene.setInsets(shown && !narrow ? 310 : 0, shown && narrow ? $('panel').offsetHeight + 60 : 0);
}

// --- the probe ---

const toModel = (p) => p.map((x, k) => x / state.scene.scale + state.scene.center[k]);
const toScene = (p) => p.map((x, k) => (x - state.scene.center[k]) * state.scene.scale);

function probeAt(point) {
  state.probe = { point, pending: true };
  worker.postMessage({ type: 'probe', opening: state.opening, point });
  probeShown();
}

function probeShown() {
  const p = state.probe;
  $('probe').hidden = !p;
  $('probeHint').hidden = Boolean(p);
  if (!p) {
    scene.showProbe();
    return;
  }
  ['px', 'py', 'pz'].forEach((id, k) => {
    if (document.activeElement !== $(id))
      $(id).value = Number(p.point[k].toPrecision(6));
    $(id).title = p.point[k];
  });
  const tints = { in: '#4cc38a', out: '#ff6b6b', on: '#ffffff', maybe: '#ffb020' };
  scene.showProbe(toScene(p.point), p.nearest && toScene(p.nearest), tints[p.where] ?? '#ffb020');
  if (p.pending)
    return;
  const words = { in: 'Inside', out: 'Outside', on: 'On the surface', maybe: 'Undecided' };
  $('where').textContent = p.solid ? words[p.where] : 'No inside';
  $('where').className = p.solid ? p.where : 'maybe';
  $('whereNote').textContent = !p.solid ? 'the model is a surface, not a solid'
    : p.exact ? 'exact'
    : p.where === 'maybe' ? (p.done ? `levels 0–${p.depth} do not say; the file has no mesh` : 'asking the leaf …')
    : `certain by levels 0–${p.depth}`;
  if (p.exact) {
    $('distance').textContent = length(p.where === 'on' ? 0 : p.distance, 7);
    $('distanceNote').textContent = `to the nearest face, in doubles; levels 0–${p.depth}: ${length(p.lo, 3)} to ${length(p.hi, 3)}`;
  } else {
    $('distance').textContent = `${length(p.lo, 4)} – ${length(p.hi, 4)}`;
    $('distanceNote').textContent = `certified by the cells of levels 0–${p.depth}`;
  }
}

// --- wiring ---

$('openForm').onsubmit = (e) => {
  e.preventDefault();
  if ($('url').value.trim())
    openUrl($('url').value.trim());
};
$('file').onchange = () => $('file').files[0] && openFile($('file').files[0]);
$('close').onclick = close;
$('stallRetry').onclick = () => worker.postMessage({ type: 'retry' });
$('errorClose').onclick = () => showError();
$('level').oninput = levelChanged;
$('detail').onchange = ask;
$('walls').onchange = () => {
  scene.setWalls($('walls').checked);
  showStats();
};
$('own').onchange = () => scene.setOwnColours($('own').checked);
$('wire').onchange = ask;
$('cells').onchange = ask;
$('colouring').onchange = colouringChanged;
$('clipAxis').onchange = clipChanged;
$('clipAt').oninput = clipChanged;
$('clipFlip').onclick = () => {
  state.clip.flip = !state.clip.flip;
  clipChanged();
};
$('toolHome').onclick = () => scene.home();
$('toolTheme').onclick = () => setTheme(document.documentElement.dataset.theme === 'light' ? 'dark' : 'light');
$('toolPanel').onclick = () => {
  $('panel').hidden = !$('panel').hidden;
  layout();
};
$('toolHelp').onclick = () => $('help').showModal();
['px', 'py', 'pz'].forEach((id, k) => {
  $(id).onchange = () => { // the other coordinates keep the digits that are not shown
    const point = [...state.probe.point], x = Number($(id).value);
    point[k] = x;
    if ($(id).value.trim() && Number.isFinite(x))
      probeAt(point);
  };
});

let down;
$('canvas').addEventListener('pointerdown', (e) => (down = e.button === 0 ? [e.clientX, e.clientY] : undefined));
$('canvas').addEventListener('pointerup', (e) => {
  if (!down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 4 || !state.info)
    return;
  const point = scene.pick(e.clientX, e.clientY);
  if (point)
    probeAt(toModel(point));
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
  const file = e.dataTransfer.files[0], text = e.dataTransfer.getData('text/uri-list');
  if (file)
    openFile(file);
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
  arrowleft: slide('level', -1, levelChanged), arrowright: slide('level', 1, levelChanged), g: click('walls'), w: click('wire'), c: click('cells'), m: click('own'),
  k: () => choose('colouring', 1), x: () => choose('clip', 1), '[': slide('clipAt', -15, clipChanged), ']': slide('clipAt', 15, clipChanged), '/': click('clipFlip'),
  f: click('toolHome'), t: click('toolTheme'), p: click('toolPanel'), '?': click('toolHelp'), o: close,
  escape: () => {
    state.probe = undefined;
    probeShown();
    showError();
  },
};
addEventListener('keydown', (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || $('help').open || (e.target.matches('input:not([type=range]):not([type=radio]):not([type=checkbox]), select') && e.key !== 'Escape'))
    return;
  const key = e.key.toLowerCase();
  if (!state.info && !['t', '?'].includes(key))
    return;
  if (KEYS[key]) {
    e.preventDefault();
    KEYS[key]();
  }
});

async function listSamples(address) {
  const list = await (await fetch(address)).json();
  $('samples').hidden = list.length === 0;
  $('samples').querySelector('ul').replaceChildren(...list.map(({ name, file, faces, bytes: size }) => {
    const li = document.createElement('li'), a = document.createElement('a'), small = document.createElement('small');
    const url = new URL(file, new URL(address, location.href)).href;
    a.href = `?file=${encodeURIComponent(url)}`;
    a.onclick = (e) => {
      e.preventDefault();
      openUrl(url);
    };
    small.textContent = [faces && `${count(faces)} faces`, size && bytes(size)].filter(Boolean).join(' · ');
    a.append(name, small);
    li.append(a);
    return li;
  }));
}

// --- begin: ?file= address, &level= number or mesh, &detail= pixels, &theme=, &samples= list ---

const { query } = boot;
setTheme(document.documentElement.dataset.theme);
$('detail').value = query.get('detail') ?? 'auto';
if (!$('detail').value)
  $('detail').value = 'auto';
if (query.has('samples'))
  listSamples(query.get('samples')).catch((e) => showError({ message: `${query.get('samples')}: the list of samples cannot be read (${e.message}); check the address` }));
if (query.has('file'))
  openUrl(query.get('file'), boot.opening === 1);
boot.over();
boot.said.splice(0).forEach((data) => worker.onmessage({ data }));

/** For tests and for the curious: what is shown. */
window.ebpoViewer = {
  get state() {
    return { idle: state.idle, depth: state.depth, stats: state.stats, traffic: state.traffic, timeline: state.timeline, shownAfter: state.shownAfter, probe: state.probe,
      error: state.error, line: state.line,
      levels: state.info?.levels.length, walls: scene.walls, calls: state.calls };
  },
  get place() {
    return state.scene;
  },
  scene, probeAt,
};
