// Clips the model to a box, with two sliders for each axis. Positions are shares of the model's box.
import { section } from './parts.js';
import { $, on, state } from './state.js';

const row = (axis, k) => `<div class="row" role="group" aria-label="${axis}"><span>${axis}</span><input type="range" id="box${k}" min="0" max="1" step="0.005" value="0" aria-label="${axis} from"
  ><input type="range" id="box${k + 3}" min="0" max="1" step="0.005" value="1" aria-label="${axis} to"></div>`;
const LEAST = 0.01; // smallest side of the box, as a share of the axis

export function addSectionBox({ cutChanged }) {
  const details = section('Section box', `${['X', 'Y', 'Z'].map(row).join('')}<div class="row"><button id="boxAll" class="small">Show all</button></div>`, { open: Boolean(state.box) });
  const sliders = [0, 1, 2, 3, 4, 5].map((k) => $(`box${k}`)), show = () => sliders.forEach((slider, k) => (slider.value = state.box?.[k] ?? (k < 3 ? 0 : 1)));
  sliders.forEach((slider, k) => (slider.oninput = () => {
    const box = sliders.map((s) => Number(s.value)), other = (k + 3) % 6;
    box[k] = k < 3 ? Math.min(box[k], box[other] - LEAST) : Math.max(box[k], box[other] + LEAST);
    slider.value = box[k];
    state.box = box.every((x, i) => x === (i < 3 ? 0 : 1)) ? undefined : box;
    cutChanged();
  }));
  $('boxAll').onclick = () => {
    state.box = undefined;
    show();
    cutChanged();
  };
  on('opened', () => {
    show();
    details.open ||= Boolean(state.box);
  });
  show();
}
