// The switches for shading by depth and ambient occlusion, the address' parameters `show` and `theme`, and the style of modules that are loaded later.
import { $, on } from './state.js';

/** Resolves when more.css is loaded. */
export const styled = () => new Promise((done) => {
  const link = Object.assign(document.createElement('link'), { rel: 'stylesheet', href: new URL('more.css', import.meta.url).href, onload: done, onerror: done });
  document.head.append(link);
});

/** Adds the switches for shading by depth and ambient occlusion, which `pipeline` draws. `changed()`: called after a change. */
export function addShading(scene, pipeline, changed) {
  let last = $('wire').closest('label');
  for (const [id, name, key, member] of [['dome', 'Shade by depth', 'E', 'dome'], ['ambient', 'Ambient occlusion', 'A', 'surroundings']]) {
    const label = Object.assign(document.createElement('label'), { className: 'switch', innerHTML: `<input type="checkbox" id="${id}"><span>${name}</span><kbd>${key}</kbd>` });
    last.after(label);
    last = label;
    $(id).onchange = () => {
      pipeline[member] = $(id).checked;
      scene.redraw();
      changed();
    };
    on('key', (e) => e.key.toUpperCase() === key && $(id).click());
  }
  applyShown(wordsOf(new URLSearchParams(location.search)));
}

// Identifiers of the panel's switches, by their words in the address: show=depth,occlusion,wireframe,cells,caps,orthographic,z-up.
const SWITCHES = { depth: 'dome', occlusion: 'ambient', wireframe: 'wire', cells: 'cells', caps: 'caps', orthographic: 'ortho', 'z-up': 'zUp' };
/** Returns the words of the parameter `show`. */
export const wordsOf = (query) => (query.get('show') ?? '').split(',');

/** Turns the switches of these words on and the others off. The switches for shading do not exist before the first picture. */
export function applyShown(words) {
  Object.entries(SWITCHES).forEach(([word, id]) => $(id) && $(id).checked !== words.includes(word) && $(id).click());
}

/** Returns the words of the switches that are on. For a switch that does not exist yet, the current address decides. */
export function shownText() {
  const words = wordsOf(new URLSearchParams(location.search));
  return Object.entries(SWITCHES).filter(([word, id]) => ($(id) ? $(id).checked : words.includes(word))).map(([word]) => word).join(',');
}

/** Returns the theme for the address; undefined for the browser's preferred theme, unless the address already names a theme. */
export function themeText() {
  const { theme } = document.documentElement.dataset, preferred = matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark';
  return theme === preferred && !new URLSearchParams(location.search).has('theme') ? undefined : theme;
}
