// Draws a cube with the orientation of the model and a scale bar with a round length. The cube's sides are buttons that select views.
import { $, length, on, state } from './state.js';

const SIDES = [['+X', 'right', 90, 0], ['−X', 'left', -90, 0], ['+Y', 'top', 0, 89.9], ['−Y', 'bottom', 0, -89.9], ['+Z', 'front', 0, 0], ['−Z', 'back', 180, 0]];
const TURNS = ['rotateY(90deg)', 'rotateY(-90deg)', 'rotateX(90deg)', 'rotateX(-90deg)', '', 'rotateY(180deg)'];
const BAR_PIXELS = [60, 160]; // least and greatest length

// Labels for models whose z axis points upwards: the picture's y is the model's z, the picture's z is the model's -y.
const AXES = { '+Y': '+Z', '−Y': '−Z', '+Z': '−Y', '−Z': '+Y' };

/** `up`: 2 if the model's z axis points upwards. */
export function addCompass({ scene, changed, up }) {
  const box = document.createElement('div'), cube = document.createElement('div'), scale = document.createElement('div');
  box.id = 'compass';
  scale.id = 'scale';
  scale.innerHTML = '<i></i><span></span>';
  scale.title = 'A length at the distance of the target';
  SIDES.forEach(([side, from, azimuth, height], i) => {
    const b = document.createElement('button'), text = (up === 2 && AXES[side]) || side;
    b.textContent = text;
    b.ariaLabel = `View from ${text.replace('−', 'minus ').replace('+', 'plus ')} (${from})`;
    b.style.transform = `${TURNS[i]} translateZ(26px)`;
    b.onclick = () => {
      const { eye, target } = scene.place, distance = Math.hypot(...eye.map((x, k) => x - target[k])), [a, h] = [azimuth, height].map((x) => x * Math.PI / 180);
      scene.place = { target, eye: [Math.sin(a) * Math.cos(h), Math.sin(h), Math.cos(a) * Math.cos(h)].map((x, k) => target[k] + x * distance) };
      changed();
    };
    cube.append(b);
  });
  box.append(cube);
  document.body.append(box, scale);
  const follow = () => {
    const show = Boolean(state.info);
    box.hidden = scale.hidden = !show;
    if (!show)
      return;
    const m = scene.camera.matrixWorldInverse.elements; // its rotation; y points downwards on pages
    cube.style.transform = `matrix3d(${[m[0], -m[1], m[2], 0, -m[4], m[5], -m[6], 0, m[8], -m[9], m[10], 0, 0, 0, 0, 1].map((x) => x.toFixed(4)).join(',')})`;
    measure();
  };
  const measure = () => {
    const { eye, target } = scene.place, distance = Math.hypot(...eye.map((x, k) => x - target[k]));
    const pixel = 2 * Math.tan(scene.camera.fov * Math.PI / 360) * distance / $('canvas').clientHeight / state.scene.scale, most = BAR_PIXELS[1] * pixel, ten = 10 ** Math.floor(Math.log10(most));
    const round = [5, 2, 1].find((n) => n * ten <= most) * ten;
    scale.firstElementChild.style.width = `${round / pixel}px`;
    scale.lastElementChild.textContent = length(round, 3);
  };
  on('frame', follow);
  on('closed', follow);
  scene.redraw();
}
