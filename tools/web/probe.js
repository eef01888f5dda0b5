// The queried point: its coordinates, result and marker.
import { showPointCard } from './line.js';
import { $, emit, length, state, toScene } from './state.js';

const COORDINATES = ['px', 'py', 'pz'];
const WORDS = { in: 'Inside', out: 'Outside', on: 'On the surface', maybe: 'Undecided' };
const TINTS = { in: '#4cc38a', out: '#ff6b6b', on: '#ffffff', maybe: '#ffb020' };

let picture, queries;

/** `scene` shows the marker, `worker` evaluates the query. */
export function probeWith(scene, worker) {
  picture = scene;
  queries = worker;
}

/**
 * Queries a point of the model. Without a point, clears the last query. For a point that was clicked on the surface, `precision` is the accuracy of the click in
 * the model's units, and `ray` the ray of the click.
 */
export function probeAt(point, precision = 0, ray = undefined) {
  state.probe = point && { point, precision, pending: true };
  if (point)
    queries.postMessage({ type: 'probe', opening: state.opening, point, ray });
  probeShown();
  emit('point');
}

export function probeShown() {
  const p = state.probe;
  $('probeHint').hidden = Boolean(p);
  $('probeResult').hidden = !p || Boolean(p.pending);
  COORDINATES.forEach((id, k) => {
    if (!p || document.activeElement !== $(id))
      $(id).value = p ? Number(p.point[k].toPrecision(6)) : '';
    $(id).title = p ? p.point[k] : '';
  });
  if (!p) {
    picture.showProbe();
    showPointCard();
    return;
  }
  const onSurface = p.where === 'on' || (p.exact && p.distance <= p.precision), where = onSurface ? 'on' : p.where;
  picture.showProbe(toScene(p.point), p.nearest && toScene(p.nearest), TINTS[where] ?? TINTS.maybe);
  if (p.pending)
    return;
  $('where').textContent = p.solid || onSurface ? WORDS[where] : 'No inside';
  $('where').className = p.solid ? where : 'maybe';
  $('whereNote').textContent = onSurface && p.where !== 'on' ? 'within the accuracy of the click'
    : !p.solid ? 'the model is a surface, not a solid'
    : p.exact ? 'exact'
    : p.where === 'maybe' ? (p.done ? `not decided by levels 0–${p.depth}; the file has no mesh` : 'querying the leaf …')
    : `certain by levels 0–${p.depth}`;
  if (onSurface) {
    $('distance').textContent = p.where === 'on' ? length(0) : `< ${length(p.precision, 1)}`;
    $('distanceNote').textContent = 'to the nearest face';
  } else if (p.exact) {
    $('distance').textContent = length(p.distance, 7);
    $('distanceNote').textContent = `to the nearest face, in doubles; levels 0–${p.depth}: ${length(p.lo, 3)} to ${length(p.hi, 3)}`;
  } else {
    $('distance').textContent = `${length(p.lo, 4)} – ${length(p.hi, 4)}`;
    $('distanceNote').textContent = `certified by the cells of levels 0–${p.depth}`;
  }
  showPointCard($('where').textContent, `${$('distance').textContent} to the ${p.exact ? 'nearest face' : 'surface'}`, $('where').className);
}

COORDINATES.forEach((id, k) => {
  $(id).onchange = () => { // the other coordinates of a query keep their digits beyond the displayed ones
    const fields = COORDINATES.map((name) => $(name).value.trim()), point = state.probe ? [...state.probe.point] : fields.map(Number);
    point[k] = Number(fields[k]);
    if (fields.every(Boolean) && point.every(Number.isFinite))
      probeAt(point);
  };
});
