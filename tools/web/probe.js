// The queried point: its coordinates, result and marker.
import { $, emit, length, state, toScene } from './state.js';

let picture, queries;

/** `scene` shows the marker, `worker` evaluates the query. */
export function probeWith(scene, worker) {
  picture = scene;
  queries = worker;
}

/** Queries a point of the model. Without a point, clears the last query. */
export function probeAt(point) {
  state.probe = point && { point, pending: true };
  if (point)
    queries.postMessage({ type: 'probe', opening: state.opening, point });
  probeShown();
  emit('point');
}

export function probeShown() {
  const p = state.probe;
  $('probe').hidden = !p;
  $('probeHint').hidden = Boolean(p);
  if (!p) {
    picture.showProbe();
    return;
  }
  ['px', 'py', 'pz'].forEach((id, k) => {
    if (document.activeElement !== $(id))
      $(id).value = Number(p.point[k].toPrecision(6));
    $(id).title = p.point[k];
  });
  const tints = { in: '#4cc38a', out: '#ff6b6b', on: '#ffffff', maybe: '#ffb020' };
  picture.showProbe(toScene(p.point), p.nearest && toScene(p.nearest), tints[p.where] ?? '#ffb020');
  if (p.pending)
    return;
  const words = { in: 'Inside', out: 'Outside', on: 'On the surface', maybe: 'Undecided' };
  $('where').textContent = p.solid ? words[p.where] : 'No inside';
  $('where').className = p.solid ? p.where : 'maybe';
  $('whereNote').textContent = !p.solid ? 'the model is a surface, not a solid'
    : p.exact ? 'exact'
    : p.where === 'maybe' ? (p.done ? `not decided by levels 0–${p.depth}; the file has no mesh` : 'querying the leaf …')
    : `certain by levels 0–${p.depth}`;
  if (p.exact) {
    $('distance').textContent = length(p.where === 'on' ? 0 : p.distance, 7);
    $('distanceNote').textContent = `to the nearest face, in doubles; levels 0–${p.depth}: ${length(p.lo, 3)} to ${length(p.hi, 3)}`;
  } else {
    $('distance').textContent = `${length(p.lo, 4)} – ${length(p.hi, 4)}`;
    $('distanceNote').textContent = `certified by the cells of levels 0–${p.depth}`;
  }
}

['px', 'py', 'pz'].forEach((id, k) => {
  $(id).onchange = () => { // the other coordinates keep their digits beyond the displayed ones
    const point = [...state.probe.point], x = Number($(id).value);
    point[k] = x;
    if ($(id).value.trim() && Number.isFinite(x))
      probeAt(point);
  };
});
