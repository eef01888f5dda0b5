// Measures distances between points and the section's area and outline, and clips the model to a box.
import { complain, make, mark, modelName, positionsOf, save, section, svg, take, taken } from './parts.js';
import { $, length, on, state, toScene } from './state.js';

const SECTIONS = `
  <div class="row"><button id="sectionOn" class="small">Area and outline of the section</button></div>
  <div id="sectionResult" hidden><div class="result"><strong id="sectionArea"></strong><span id="sectionNote"></span></div><canvas id="sectionPicture" width="528" height="360"></canvas>
    <div class="row"><button id="sectionSvg" class="small">Save as SVG</button><button id="sectionCsv" class="small">Save as CSV</button></div></div>`;

const between = (a, b) => Math.hypot(...a.map((x, k) => x - b[k]));

const DISTANCES = `
  <div class="row"><button id="measureOn" class="small" aria-pressed="false" title="Click points one after the other (D)">Distance</button>
    <button id="measureClear" class="small" hidden>Clear</button></div>
  <p class="hint" id="measureHint">Points are put on the nearest faces; on a section they stay where they are clicked.</p>
  <ol id="measures" class="list"></ol>`;

/** Adds the measurement of distances, but no sections, for pages with several models. `page.placeOf(point)` resolves to the position on a face for a clicked point. */
export function addDistances(page) {
  distances(page, section('Measure', DISTANCES));
}

export function addMeasuring(page) {
  const { worker, scene } = page, details = section('Measure', DISTANCES + SECTIONS);
  const placeOf = async (point) => (state.info.parts.has('mesh') && !scene.pickedCut ? (await positionsOf(worker, [point]))[0].place : point);
  distances({ ...page, placeOf }, details);
  sections(page);
  on('theme', () => $('sectionResult').hidden || drawOutline());
}

// --- distances ---

function distances({ placeOf, changed }, details) {
  let shown = [];
  const show = () => {
    shown.forEach((remove) => remove());
    shown = [];
    const points = state.measured ?? [], rows = points.slice(1).map((p, i) => between(points[i], p));
    details.open ||= points.length > 0;
    $('measureClear').hidden = !points.length;
    $('measures').replaceChildren(...rows.map((d) => make('li', length(d, 6))), ...(rows.length > 1 ? [make('li', `${length(rows.reduce((a, b) => a + b), 6)} in all`, { className: 'sum' })] : []));
    points.forEach((p) => shown.push(mark(svg('circle', { r: 4 }), [toScene(p)], ([[x, y]], element) => {
      element.setAttribute('cx', x);
      element.setAttribute('cy', y);
    })));
    rows.forEach((d, i) => {
      const ends = [toScene(points[i]), toScene(points[i + 1])];
      shown.push(mark(svg('line', {}), ends, ([a, b], element) => {
        Object.entries({ x1: a[0], y1: a[1], x2: b[0], y2: b[1] }).forEach(([name, value]) => element.setAttribute(name, value));
      }), mark(make('span', length(d, 6), { className: 'label' }), ends, ([a, b], element) => {
        element.style.translate = `calc(${(a[0] + b[0]) / 2}px - 50%) calc(${(a[1] + b[1]) / 2}px - 50%)`;
      }));
    });
    changed();
  };
  const click = async (point) => {
    const { opening } = state;
    try {
      const place = await placeOf(point);
      if (opening === state.opening) {
        state.measured = [...(state.measured ?? []), place];
        show();
      }
    } catch (error) {
      complain(error.message);
    }
  };
  const button = $('measureOn'), tool = { click, end: () => (button.ariaPressed = 'false') };
  button.onclick = () => {
    const begin = taken() !== tool;
    take(begin ? tool : undefined);
    button.ariaPressed = String(begin);
  };
  $('measureClear').onclick = () => {
    state.measured = undefined;
    show();
  };
  on('opened', show);
  on('closed', () => {
    state.measured = undefined;
    shown.forEach((remove) => remove());
    shown = [];
  });
  on('key', (e) => e.key.toLowerCase() === 'd' && button.click());
  if (state.info)
    show();
}

// --- the section ---

let outline; // { axis, at, segments, area, length, faces, partial }

function sections({ worker }) {
  const requestSection = () => {
    const { axis, at } = state.clip;
    if (axis === undefined) {
      complain('no clipping plane is active; choose an axis of the clipping plane first');
      return;
    }
    const place = state.info.box_origin[axis] + at * state.info.box_size[axis];
    $('sectionOn').disabled = true;
    worker.postMessage({ type: 'section', opening: state.opening, axis, at: place });
  };
  const forget = () => {
    outline = undefined;
    $('sectionResult').hidden = true;
    $('sectionOn').disabled = false;
    $('sectionOn').textContent = 'Area and outline of the section';
  };
  $('sectionOn').onclick = requestSection;
  on('closed', forget);
  on('cut', () => outline && (outline.axis !== state.clip.axis || Math.abs(outline.share - state.clip.at) > 1e-9) && forget());
  on('section', (news) => {
    if (news.fault) {
      forget();
      complain(news.fault);
    } else if (!news.segments) {
      $('sectionOn').textContent = `Computing: ${Math.round(100 * news.looked / news.of)} %`;
    } else {
      forget();
      outline = { ...news, share: state.clip.at };
      showOutline();
    }
  });
  $('sectionSvg').onclick = () => save(`${modelName()}_section.svg`, outlineSvg(), 'image/svg+xml');
  $('sectionCsv').onclick = () => save(`${modelName()}_section.csv`, outlineCsv(), 'text/csv');
}

function showOutline() {
  const { area, length: long, faces, partial, axis, at } = outline;
  $('sectionResult').hidden = false;
  $('sectionArea').textContent = area === undefined ? length(long, 6) : length(area, 6, 2);
  $('sectionNote').textContent = `${area === undefined ? 'outline; a surface has no area inside' : `area; outline ${length(long,
    6)}`}; ${faces} faces at ${'xyz'[axis]} = ${length(at, 6)}${partial ? '; part of it is not in this subset' : ''}`;
  drawOutline();
}

/** Returns the drawn position of a section's [u, v]: seen from the axis' upper end, with y upwards, or with -z upwards for a section across y. */
export const turned = ([u, v], axis) => [[-v, u], [v, -u], [u, v]][axis];

function bounds() {
  const { segments, axis } = outline, box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < segments.length; i += 2) {
    const [x, y] = turned([segments[i], segments[i + 1]], axis);
    box[0] = Math.min(box[0], x);
    box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x);
    box[3] = Math.max(box[3], y);
  }
  return box;
}

function drawOutline() {
  const canvas = $('sectionPicture'), context = canvas.getContext('2d'), { segments, axis } = outline, [u0, v0, u1, v1] = bounds(), pad = 12;
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (!segments.length)
    return;
  const scale = Math.min((canvas.width - 2 * pad) / (u1 - u0 || 1), (canvas.height - 2 * pad) / (v1 - v0 || 1));
  const place = (i) => {
    const [u, v] = turned([segments[i], segments[i + 1]], axis);
    return [canvas.width / 2 + (u - (u0 + u1) / 2) * scale, canvas.height / 2 - (v - (v0 + v1) / 2) * scale];
  };
  context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue('--text');
  context.lineWidth = 1.5;
  context.beginPath();
  for (let i = 0; i < segments.length; i += 4) {
    context.moveTo(...place(i));
    context.lineTo(...place(i + 2));
  }
  context.stroke();
}

/** Joins segments whose end is another segment's beginning. Returns polylines: lists of [u, v]. */
export function chains(segments) {
  const next = new Map(), key = (i) => `${segments[i]},${segments[i + 1]}`, used = new Set(), out = [], begins = new Set();
  for (let i = 0; i < segments.length; i += 4)
    next.set(key(i), [...(next.get(key(i)) ?? []), i]);
  const ends = new Set(Array.from({ length: segments.length / 4 }, (_, i) => key(4 * i + 2)));
  for (let i = 0; i < segments.length; i += 4)
    if (!ends.has(key(i)))
      begins.add(i);
  for (const first of [...begins, ...Array.from({ length: segments.length / 4 }, (_, i) => 4 * i)]) { // open polylines first, from their beginnings, then loops
    if (used.has(first))
      continue;
    const line = [[segments[first], segments[first + 1]]];
    for (let i = first; i !== undefined; i = next.get(key(i + 2))?.find((n) => !used.has(n))) {
      used.add(i);
      line.push([segments[i + 2], segments[i + 3]]);
    }
    out.push(line);
  }
  return out;
}

function outlineSvg() {
  const [u0, v0, u1, v1] = bounds(), size = Math.max(u1 - u0, v1 - v0), unit = state.info.unit ?? '';
  const path = chains(outline.segments).map((line) => `M${line.map((p) => turned(p, outline.axis)).map(([x, y]) => `${x} ${-y}`).join('L')}`).join('');
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${u0} ${-v1} ${u1 - u0} ${v1 - v0}"><title>${'xyz'[outline.axis]} = ${outline.at} ${unit.replace(/[<>&]/g, '')}</title>` +
    `<path fill="none" stroke="#000" stroke-width="${size / 500}" d="${path}"/></svg>\n`;
}

function outlineCsv() {
  const { axis, at } = outline, place = ([u, v]) => {
    const p = [0, 0, 0];
    p[axis] = at;
    p[(axis + 1) % 3] = u;
    p[(axis + 2) % 3] = v;
    return p.join(',');
  };
  return `line,x,y,z\n${chains(outline.segments).flatMap((line, i) => line.map((p) => `${i},${place(p)}\n`)).join('')}`;
}
