// The list of samples on the first page.
import { bytes } from './line.js';
import { $, count } from './state.js';

/** Shows the list at an address. Calls `open(url)` for a chosen sample. */
export async function listSamples(address, open) {
  const list = await (await fetch(address)).json();
  $('samples').hidden = list.length === 0;
  $('samples').querySelector('ul').replaceChildren(...list.map(({ name, file, scene, picture, instances, faces, bytes: size }) => {
    const li = document.createElement('li'), a = document.createElement('a'), small = document.createElement('small');
    const url = new URL(scene ?? file, new URL(address, location.href)).href;
    a.href = `?${scene ? 'scene' : 'file'}=${encodeURIComponent(url)}`;
    if (!scene) // a scene opens on a separate page
      a.onclick = (e) => {
        e.preventDefault();
        open(url);
      };
    small.textContent = [instances && `${count(instances)} instances`, faces && `${count(faces)} faces`, size && bytes(size)].filter(Boolean).join(' · ');
    if (picture)
      a.append(Object.assign(document.createElement('img'), { src: new URL(picture, new URL(address, location.href)).href, alt: '', loading: 'lazy' }));
    a.append(name, small);
    li.append(a);
    return li;
  }));
}
