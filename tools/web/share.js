// Synchronizes the page's address with the view. Camera moves add no steps to the browser's history; opening another file does.
import { boxOf, boxText, cameraOf, cameraText, clipOf, clipText, pointsOf, pointsText, withQuery } from './address.js';
import { shownText, themeText, wordsOf } from './shading.js';
import { $, state } from './state.js';

const LATER_MS = 300; // browsers reject changes of the address that are too frequent
const OF_A_VIEW = ['view', 'level', 'clip', 'box', 'point', 'measure', 'colour', 'cell-faces', 'detail', 'show'];

const files = []; // files from disk, by their number in the history's entries
let timer, home, picture;

export function setPicture(scene) {
  picture = scene;
}

/** Takes the current camera as the default, which the address omits. */
export function setHomeView() {
  home = cameraText(picture.place);
}

/** Adds a step to the history: another file, by its address or as a File, or no file. */
export function pushStep(what) {
  clearTimeout(timer);
  timer = undefined;
  const href = withQuery(location.href, [...OF_A_VIEW.map((name) => [name]), ['paint'], ['file', typeof what === 'string' ? what : undefined]]);
  const local = what !== undefined && typeof what !== 'string' ? files.push(what) - 1 : undefined;
  if (href !== location.href || local !== undefined || history.state?.local !== undefined)
    history.pushState({ local }, '', href);
}

/** Returns the file of an entry of the history: an address, a File or undefined. */
export const fileOfEntry = (query, entry) => (entry?.local !== undefined ? files[entry.local] : query.get('file') ?? undefined);

/**
 * Returns the parameters of an address about the open file: { camera, level, clip, box, point, measured, colouring, cellFaces, detail, shown }. `shown` is the argument
 * of applyShown(). Missing parameters are undefined, except for the last four, which have defaults.
 */
export function viewParameters(query) {
  const one = (name) => pointsOf(query.get(name))?.[0], level = query.get('level');
  return { camera: cameraOf(query.get('view')), level: /^\d+$/.test(level ?? '') ? Number(level) : undefined, clip: clipOf(query.get('clip')), box: boxOf(query.get('box')),
    point: one('point'), measured: pointsOf(query.get('measure')), colouring: query.get('colour') ?? 'plain', cellFaces: query.get('cell-faces') !== '0', detail: query.get('detail') ?? 'auto',
    shown: wordsOf(query) };
}

/** Returns the address of the current view. */
export function address() {
  const i = state.info, diagonal = Math.hypot(...i.box_size), view = cameraText(picture.place), chosen = (name) => document.querySelector(`input[name=${name}]:checked`).value;
  const points = (list) => (list?.length ? pointsText(list, diagonal) : undefined), unless = (value, defaultValue) => (value === defaultValue ? undefined : value);
  return withQuery(location.href, [['view', unless(view, home)], ['level', unless($('level').value, $('level').max)], ['clip', clipText(state.clip)], ['box', boxText(state.box)],
    ['point', points(state.probe && [state.probe.point])], ['measure', points(state.measured)], ['colour', unless(chosen('colouring'), 'plain')],
    ['cell-faces', $('cellFaces').checked ? undefined : '0'], ['detail', unless($('detail').value, 'auto')], ['show', shownText()], ['theme', themeText()]]);
}

/** Schedules an update of the address after a change. */
export function changed() {
  if (state.together) // together/page.js keeps its address
    return;
  const { opening } = state;
  timer ??= setTimeout(() => {
    timer = undefined;
    if (state.info && !state.together && opening === state.opening && address() !== location.href)
      history.replaceState(history.state, '', address());
  }, LATER_MS);
}
