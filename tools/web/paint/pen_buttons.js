// The rows of the panel that a pen has, on the page of one model and on that of a scene.
import { $, length, state } from '../state.js';

const SWATCHES = ['#d9483b', '#f08c2e', '#f2cf3b', '#4cae50', '#2e86de', '#7d4fc4', '#ffffff', '#1c1c1c'];
const NARROW = 2e-4, WIDE = 0.1; // radii of the pen, in halves of the box's diagonal
export const ROWS = `
  <div class="row"><div class="buttons"><button id="penOn" class="small" aria-pressed="false" title="Pen (B)">Pen</button>
    <button id="eraserOn" class="small" aria-pressed="false" title="Eraser (R)">Eraser</button></div>
    <div class="buttons"><button id="penUndo" class="small" title="Undo (Ctrl Z)">Undo</button><button id="penRedo" class="small" title="Redo (Ctrl Shift Z)">Redo</button></div></div>
  <p class="hint" id="penHint"></p>
  <div class="swatches" role="group" aria-label="Colour of the pen">
    ${SWATCHES.map((c) => `<button data-colour="${c}" style="background:${c}" aria-label="${c}"></button>`).join('')}
    <input type="color" id="penColour" value="${SWATCHES[0]}" aria-label="Another colour"></div>
  <div class="row"><label for="penSize">Radius</label><input type="range" id="penSize" min="0" max="100" value="55"><output id="penSizeText"></output></div>`;

export const radius = () => NARROW * (WIDE / NARROW) ** ($('penSize').value / 100) / state.scene.scale;
export const showRadius = () => ($('penSizeText').textContent = length(radius(), 2));

/** Lets the colours and the radius of the rows in `details` set each other. */
export function linkRows(details) {
  details.querySelectorAll('[data-colour]').forEach((b) => (b.onclick = () => ($('penColour').value = b.dataset.colour)));
  $('penSize').oninput = showRadius;
}

/** Lets a device do what the buttons in `details` otherwise do on this page. command(text): sends a command, see live.js; layerCount(): the number of layers. */
export function sendCommands(details, command, layerCount) {
  $('penRedo').hidden = true;
  $('penUndo').disabled = false;
  const colourChanged = () => command(`colour ${$('penColour').value.slice(1)}`);
  $('penColour').onchange = colourChanged;
  details.querySelectorAll('[data-colour]').forEach((b) => b.addEventListener('click', colourChanged));
  $('penSize').onchange = () => command(`radius ${radius()}`);
  $('layerAdd').onclick = () => command(`new-layer Layer ${layerCount() + 1}`);
  for (const [id, text] of [['penOn', 'paint'], ['eraserOn', 'erase']])
    $(id).onclick = () => {
      command(text);
      $('penOn').ariaPressed = String(id === 'penOn');
      $('eraserOn').ariaPressed = String(id === 'eraserOn');
    };
}
