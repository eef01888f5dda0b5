// Components of the page's tools: folding sections of the panel, marks over the picture, opening and saving files.
import { $, emit, on, state } from './state.js';

/** Adds a folding section to the panel, before the octree's structure. `html` must be trusted; texts of users are set only as text content. */
export function section(title, html, { open = false } = {}) {
  const details = document.createElement('details'), part = document.createElement('section'), summary = document.createElement('summary');
  summary.textContent = title;
  details.open = open;
  details.append(summary, Object.assign(document.createElement('div'), { innerHTML: html }));
  part.append(details);
  $('structure').closest('section').before(part);
  return details;
}

/** Creates an element with text, which may come from a user. */
export function make(name, text, members = {}) {
  const element = Object.assign(document.createElement(name), members);
  element.textContent = text;
  return element;
}

// --- routing of clicks on the model ---

let tool;
/**
 * Activates a tool { click(point), end() } and ends the active one; the key Escape ends it, too. Without a tool, clicks query points.
 */
export function take(next) {
  const last = tool;
  tool = undefined;
  last?.end?.();
  tool = next;
  state.clicked = next?.click;
  $('canvas').classList.toggle('pointing', Boolean(next));
}
export const taken = () => tool;
on('escape', () => take());
on('closed', () => take());

// --- marks over the picture ---

const marks = [];
let project;
/** Creates the elements for marks. `scene` projects points to the page. */
export function markOn(scene) {
  project = (point) => scene.project(point);
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg'), pins = document.createElement('div');
  svg.id = 'lines';
  svg.ariaHidden = 'true';
  pins.id = 'pins';
  $('stage').append(svg, pins);
  on('frame', placeMarks);
}

/**
 * Adds a mark at `points` of the scene. `place(positions, element)` receives their positions on the page. The mark is hidden while one of the points is behind the
 * camera. Returns a function that removes the mark.
 */
export function mark(element, points, place) {
  const it = { element, points, place };
  $(element instanceof SVGElement ? 'lines' : 'pins').append(element);
  marks.push(it);
  placeMark(it);
  return () => {
    element.remove();
    marks.splice(marks.indexOf(it), 1);
  };
}

function placeMark({ element, points, place }) {
  const spots = points.map(project);
  element.style.display = spots.every(Boolean) ? '' : 'none';
  if (spots.every(Boolean))
    place(spots, element);
}
function placeMarks() {
  marks.forEach(placeMark);
}

export const svg = (name, attributes) => {
  const element = document.createElementNS('http://www.w3.org/2000/svg', name);
  Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
  return element;
};

// --- files ---

export function save(name, bytes, type) {
  const a = document.createElement('a');
  a.href = URL.createObjectURL(new Blob([bytes], { type }));
  a.download = name;
  a.click();
  setTimeout(() => URL.revokeObjectURL(a.href), 10000);
}

/** Returns the open file's name without the suffixes .ebpo.h5 and .h5. */
export const modelName = () => (state.shownName ?? 'model').replace(/(\.ebpo)?\.h5$/, '');

// --- queries to the worker ---

const waiting = new Map();
let queries = 0;
/** Resolves to the nearest positions on the faces for points of the model: [{ face, weights, place, normal, distance }]. */
export const positionsOf = (worker, points) => query(worker, 'positions', points);

/** Resolves to the faces that points of paint cover: the result of reachOf() of reach.js. */
export const reachOf = (worker, points) => query(worker, 'reach', points);

function query(worker, type, points) {
  const id = ++queries;
  worker.postMessage({ type, opening: state.opening, id, points });
  return new Promise((done, fail) => waiting.set(id, { done, fail, opening: state.opening }));
}
on('positions', ({ id, positions, error }) => {
  error ? waiting.get(id)?.fail(new Error(error.message)) : waiting.get(id)?.done(positions);
  waiting.delete(id);
});
on('closed', () => {
  waiting.forEach(({ fail }) => fail(new Error('the file was closed')));
  waiting.clear();
});

export const complain = (message) => emit('complaint', message);
