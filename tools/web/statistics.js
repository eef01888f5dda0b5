// The strip of levels and the statistics.
import { bytes } from './line.js';
import { $, count, length, state, time } from './state.js';

const bytesOf = (size) => (size >= 0 ? bytes(size) : 'size not yet known');

/** Returns true when there is more to draw than the envelopes of the last level. */
export const isDeeper = ({ parts }) => parts.has('mesh') || parts.has('surface');

/** Makes a button for each level and one for the mesh; a pressed button calls `choose(level)`. */
export function makeLevels(choose) {
  const i = state.info, sizes = i.levels.map((_, l) => state.bytesTo[l] - (l ? state.bytesTo[l - 1] : 0)), stops = [...sizes]; // NaN: not known yet
  if (isDeeper(i))
    stops.push(state.size - state.bytesTo.at(-1));
  const most = Math.max(...stops.filter((size) => size >= 0), 1);
  $('levels').replaceChildren(...stops.map((size, l) => {
    const b = document.createElement('button'), bar = document.createElement('i'), isMesh = l === i.level_count;
    bar.style.height = `${4 + 24 * Math.sqrt((size || 0) / most)}px`;
    b.append(bar, isMesh ? '▲' : String(l));
    b.title = isMesh ? `The surface: ${bytesOf(size)}, fetched where it is visible` : `Level ${l}: ${bytesOf(size)}; file up to here ${bytesOf(state.bytesTo[l])}`;
    b.ariaLabel = isMesh ? 'The surface' : `Level ${l}`;
    b.onclick = () => choose(l);
    return b;
  }));
}

/** Shows which levels are loaded, drawn and chosen. */
export function showLevels() {
  const at = Number($('level').value), drawn = state.stats?.levels ?? [];
  [...$('levels').children].forEach((b, l) => {
    const isMesh = l === state.info.level_count;
    b.classList.toggle('here', isMesh ? (state.stats?.meshTriangles ?? 0) > 0 : l <= state.depth);
    b.classList.toggle('shown', isMesh ? (state.stats?.meshTriangles ?? 0) > 0 : (drawn[l] ?? 0) > 0);
    b.classList.toggle('now', l === at);
    b.ariaPressed = l === at;
  });
}

/** Shows the chosen level, its size in the file and its volume excess. */
export function showLevel() {
  const at = Number($('level').value), i = state.info, mesh = at === i.level_count;
  $('levelText').textContent = mesh ? 'the surface' : `0 to ${at}`;
  $('level').ariaValueText = mesh ? 'the surface' : `levels 0 to ${at} of ${i.level_count - 1}`;
  $('levelHint').textContent = mesh ? 'Refined where it is visible, up to the faces of the model.' : `Envelopes of level ${at} and of leaves above it: ${bytesOf(state.bytesTo[at])} of the file.`;
  const excess = volumeExcess(Math.min(at, i.level_count - 1));
  $('sExcess').textContent = excess === undefined || mesh ? '–' : `+${excess < 10 ? excess.toFixed(2) : excess.toFixed(0)} %`;
  showLevels();
}

// Returns the excess of the volume at a level over the model's volume, in percent. The volume at a level is that of the envelopes of its gray nodes, and of
// the leaves and black cells down to this level. The file stores the integral of the winding number, which is the model's volume only for a single shell.
function volumeExcess(level) {
  const i = state.info;
  if (!i.solid || !i.closed)
    return undefined;
  let sum = i.levels[level].gray_volume;
  for (let l = 0; l <= level; l++)
    sum += i.levels[l].leaf_volume + i.levels[l].black * i.box_size.reduce((v, s) => v * (s / 2 ** l), 1);
  return Math.max(0, 100 * (sum / i.mesh_volume - 1));
}

/** Records the interval between two frames; undefined after a pause. */
export function frameTook(ms, calls) {
  if (ms !== undefined)
    state.frames.push(ms);
  if (state.frames.length > 30)
    state.frames.shift();
  state.calls = calls;
  $('sFrame').textContent = state.frames.length ? `${frameMs().toFixed(1)} ms` : '';
  $('sFrame').title = `interval between frames; ${calls} draw calls`;
}

export const frameMs = () => state.frames.reduce((a, b) => a + b, 0) / Math.max(state.frames.length, 1);

// Returns a number with two digits, rounded up, because it is a bound.
const above = (x) => {
  const unit = 10 ** Math.floor(Math.log10(x) - 1);
  return Number((Math.ceil(x / unit - 1e-9) * unit).toPrecision(2));
};

// Returns what is drawn, and how far it is at most from the model.
function shownText({ surface, triangles, meshTriangles }) {
  if (meshTriangles > 0 && meshTriangles === triangles)
    return 'The faces of the model';
  if (!surface)
    return meshTriangles > 0 ? 'Envelopes, and faces of the model' : 'Envelopes, which contain the model';
  const pixels = surface.pixels > 0 ? `${above(surface.pixels)} px` : '0 px';
  return `Surface within ${pixels} (${length(above(surface.error), 2)})${meshTriangles > 0 ? ', and faces of the model' : ''}`;
}

/** `cellFaces`: true when cell faces are drawn. */
export function showStats(cellFaces) {
  if (!state.info)
    return;
  const s = state.stats, t = state.traffic;
  $('sRequests').textContent = count(t.requests);
  $('sBytes').textContent = `${bytes(t.bytes)} of ${bytes(state.size)}`;
  $('sFirst').textContent = state.shownAfter === undefined ? '' : time(state.shownAfter);
  $('sLevels').textContent = state.depth < 0 ? '' : `0–${state.depth} of 0–${state.info.level_count - 1}`;
  $('shown').textContent = s ? shownText(s) : '';
  if (s) {
    $('sNodes').textContent = count(s.nodes);
    $('sTriangles').textContent = count(s.triangles - (cellFaces ? 0 : s.cellFaceTriangles));
    $('sMesh').textContent = state.info.parts.has('mesh') ? count(s.meshTriangles) : 'not in the file';
  }
}
