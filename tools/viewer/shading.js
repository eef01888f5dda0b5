// The switch of shading by depth, and the style of all that the page loads later.
import { $, on } from './state.js';

/** When the style of what comes later is there. */
export const styled = () => new Promise((done) => {
  const link = Object.assign(document.createElement('link'), { rel: 'stylesheet', href: new URL('more.css', import.meta.url).href, onload: done, onerror: done });
  document.head.append(link);
});

/** The switch of shading by depth; `pipeline` draws it. */
export function addShading(scene, pipeline) {
  const label = document.createElement('label');
  label.className = 'switch';
  label.innerHTML = '<input type="checkbox" id="dome"><span>Shade by depth</span><kbd>E</kbd>';
  $('cells').closest('label').after(label);
  $('dome').onchange = () => {
    pipeline.dome = $('dome').checked;
    scene.redraw();
  };
  on('key', (e) => e.key.toLowerCase() === 'e' && $('dome').click());
}
