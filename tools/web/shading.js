// The switches for shading by depth and ambient occlusion, and the style of modules that are loaded later.
import { $, on } from './state.js';

/** Resolves when more.css is loaded. */
export const styled = () => new Promise((done) => {
  const link = Object.assign(document.createElement('link'), { rel: 'stylesheet', href: new URL('more.css', import.meta.url).href, onload: done, onerror: done });
  document.head.append(link);
});

/** Adds the switches for shading by depth and ambient occlusion, which `pipeline` draws. */
export function addShading(scene, pipeline) {
  let last = $('cells').closest('label');
  for (const [id, name, key, member] of [['dome', 'Shade by depth', 'E', 'dome'], ['ambient', 'Ambient occlusion', 'A', 'surroundings']]) {
    const label = Object.assign(document.createElement('label'), { className: 'switch', innerHTML: `<input type="checkbox" id="${id}"><span>${name}</span><kbd>${key}</kbd>` });
    last.after(label);
    last = label;
    $(id).onchange = () => {
      pipeline[member] = $(id).checked;
      scene.redraw();
    };
    on('key', (e) => e.key.toUpperCase() === key && $(id).click());
  }
}
