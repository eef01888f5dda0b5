// Shows the paint of a device on the models of a scene (`ebpo haptic --view`). A model's paint is shown on all its instances.
import { placed } from './poses.js';
import { Decals, splitStroke } from '../paint/decals.js';
import { received } from '../paint/document.js';
import { ROWS, linkRows, sendCommands, showRadius } from '../paint/pen_buttons.js';
import { complain, section } from '../parts.js';
import { kit } from '../scene.js';
import { $, state, toScene, upright } from '../state.js';

const FULL_SIZE = 32768, AT_ONCE = 200, NEAR_PIXELS = 24; // NEAR_PIXELS: between a face and an envelope that is drawn for it
const HTML = `${ROWS}<p class="hint" id="paintText" role="status"></p><div class="buttons"><button id="layerAdd" class="small">Add a layer</button></div>`;

/** Returns { begin(command), receive(news), decals } for live.js; draw(), to be called when other instances are visible; and retry(), when models were opened late. */
export function addPainted({ scene, assembly, pipeline }) {
  const decals = pipeline.layers = new Decals(kit), paints = new Map(), reaches = new WeakMap(); // { layers, strokes } by a model's name; { normal, faces } by a point
  const made = new Map(); // WeakMaps for splitStroke() by an instance
  let command, details;
  const isAlone = assembly.instances.length === 1;
  decals.near = () => (assembly.stats.meshTriangles === assembly.stats.triangles ? 0 : NEAR_PIXELS);

  // Returns the decals of a model's layers on an instance.
  function layersOf(instance) {
    const { layers, strokes } = paints.get(assembly.models[instance.model].name), pose = instance.now, at = (p) => toScene(placed(pose, p)), scale = pose.scale * state.scene.scale;
    const turned = (n) => n && upright(placed({ ...pose, scale: 1, translation: [0, 0, 0] }, n), state.scene.up);
    const inPicture = (faces) => faces && Float32Array.from(corners(faces).flatMap(at));
    const decal = (s, points) => ({ erases: s.erases, colour: s.colour, radius: s.radius * scale, points: points.map((p) => ({ centre: at(p.place), normal: turned(reaches.get(p)?.normal),
      faces: inPicture(reaches.get(p)?.faces), share: p.size / FULL_SIZE })) });
    if (!made.has(instance))
      made.set(instance, new WeakMap());
    const own = made.get(instance), decalsOf = (s) => splitStroke(s, own, { isKnown: (p) => reaches.has(p), about: scale, decal });
    return layers.map((l, i) => ({ opacity: l.opacity / 255, strokes: l.visible ? strokes.filter((s) => s.layer === i).flatMap(decalsOf) : [] }));
  }

  function draw() {
    const shown = assembly.instances.filter(({ model, visible, now }) => visible && now && assembly.models[model].visible && paints.has(assembly.models[model].name));
    decals.set(shown.flatMap(layersOf), assembly.models.every((model) => model.info?.solid !== false));
    scene.redraw();
  }

  // Requests the faces that points cover. Another instance may be inside their balls, so all faces are requested.
  async function findReach(model, strokes) {
    const points = strokes.flatMap((s) => s.points.map((p) => ({ p, radius: s.radius * p.size / FULL_SIZE })));
    for (let i = 0; i < points.length; i += AT_ONCE) {
      const some = points.slice(i, i + AT_ONCE), found = await model.client.reach(some.map(({ p: { face, place }, radius }) => ({ face, place, radius, always: !isAlone })));
      found.forEach(({ normal, faces }, k) => reaches.set(some[k].p, { normal, faces }));
    }
  }

  // Matches the points with the faces of their model, and draws them.
  async function match(model, strokes) {
    try {
      if (model?.info)
        await findReach(model, strokes);
      draw();
    } catch (error) {
      if (error.name !== 'AbortError')
        complain(error.message);
    }
  }

  const isUnmatched = (p) => !reaches.has(p), unmatched = (name) => (paints.get(name)?.strokes ?? []).map((s) => ({ ...s, points: s.points.filter(isUnmatched) }));
  const retry = () => Promise.all(assembly.models.map((model) => match(model, unmatched(model.name))));

  async function receive({ model: name, count, layers, strokes: parts }) {
    if (!details)
      addRows();
    const model = assembly.models.find((m) => m.name === name), before = paints.get(name) ?? { layers: [], strokes: [] };
    const { strokes, fresh } = received(before.strokes, { count, strokes: parts });
    paints.set(name, { layers: layers ?? before.layers, strokes });
    $('paintText').textContent = [...paints].filter((one) => one[1].strokes.length).map(([n, one]) => `${n}: ${one.strokes.length} ${one.strokes.length === 1 ? 'stroke' : 'strokes'}`).join(', ');
    draw();
    await match(model, fresh);
  }

  function addRows() {
    details = section('Paint', HTML, { open: true });
    linkRows(details);
    showRadius();
    sendCommands(details, command, () => Math.max(0, ...[...paints.values()].map((one) => one.layers.length)));
    $('penUndo').onclick = () => command('undo');
  }

  function begin(send) {
    command = send;
    window.ebpoViewer.paint = { get files() { return Object.fromEntries(paints); } };
  }
  return { begin, receive, decals, draw, retry };
}

const corners = (faces) => Array.from({ length: faces.length / 3 }, (_, i) => [...faces.subarray(3 * i, 3 * i + 3)]);
