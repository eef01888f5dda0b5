// Components of the page's tools: folding sections of the panel, marks over the picture, opening and saving files.
import { $, on, state, tell } from './state.js';

/** A folding section of the panel, before the statistics. `html` is ours; what users write is only ever set as text. */
export function section(title, html, { open = false } = {}) {
  const details = document.createElement('details'), part = document.createElement('section'), summary = document.createElement('summary');
  summary.textContent = title;
  details.open = open;
  details.append(summary, Object.assign(document.createElement('div'), { innerHTML: html }));
  part.append(details);
  $('stats').closest('section').before(part);
  return details;
}

/** An element with text, which may be a user's. */
export function make(name, text, members = {}) {
  const element = Object.assign(document.createElement(name), members);
  element.textContent = text;
  return element;
}

// --- routing of clicks on the model ---

let tool;
/** One tool at a time: { click(point), end() }; `end` is called when another one takes its place, or Escape. Nothing: clicks ask about points again. */
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
/** `scene` computes the positions of points. */
export function markOn(scene) {
  project = (point) => scene.project(point);
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg'), pins = document.createElement('div');
  svg.id = 'lines';
  svg.ariaHidden = 'true';
  pins.id = 'pins';
  $('stage').append(svg, pins);
  on('frame', placeMarks);
}

/** `points`: in the scene; `place(positions, element)` receives their positions on the page; the mark is hidden while one of them is behind the eye. Returns a function that takes the mark away. */
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

/** The open file's name without what EBP-Octree files end with. */
export const modelName = () => (state.shownName ?? 'model').replace(/(\.ebpo)?\.h5$/, '');

// --- what the worker is asked and answers ---

const waiting = new Map();
let asks = 0;
/** The nearest places on the faces to some points of the model: [{ face, weights, place, normal, distance }]. */
export const placesOf = (worker, points) => ask(worker, 'places', points);

/** Returns the faces that points of paint cover, from reachOf() of reach.js. */
export const reachOf = (worker, points) => ask(worker, 'reach', points);

function ask(worker, type, points) {
  const id = ++asks;
  worker.postMessage({ type, opening: state.opening, id, points });
  return new Promise((done, fail) => waiting.set(id, { done, fail, opening: state.opening }));
}
on('places', ({ id, places, error }) => {
  error ? waiting.get(id)?.fail(new Error(error.message)) : waiting.get(id)?.done(places);
  waiting.delete(id);
});
on('closed', () => {
  waiting.forEach(({ fail }) => fail(new Error('the file was closed')));
  waiting.clear();
});

export const complain = (message) => tell('complaint', message);
