// Shows the state of the connection: progress, waiting time, errors, and a button to retry.
const $ = (id) => document.getElementById(id);
const STALL_MS = 3000; // without a byte: it is said

export const bytes = (n) => (n < 1000 ? `${n} B` : n < 1e6 ? `${(n / 1e3).toFixed(n < 1e4 ? 1 : 0)} kB` : n < 1e9 ? `${(n / 1e6).toFixed(n < 1e7 ? 2 : 1)} MB` : `${(n / 1e9).toFixed(2)} GB`);

/** Shows that data is being fetched or computed, before the amount is known. */
export function busy(on) {
  $('progress').classList.toggle('on', on);
  if (!on)
    showLine({ got: 0, want: 0, quiet: 0 });
}

/** The card before the first picture; boot.js began it. */
export function showOpening(name) {
  document.documentElement.classList.toggle('opening', name !== undefined);
  if (name !== undefined)
    $('openingName').textContent = name;
}

/** Of what is under way: bytes that came and that were asked for, ms since the last one, what they are for, and why nothing comes, if that is known. */
export function showLine({ got, want, quiet, what, trouble }) {
  const share = want > 0 ? got / want : undefined, percent = Math.round(100 * (share ?? 0));
  for (const bar of [$('progress'), $('openingProgress')]) {
    bar.classList.toggle('known', share !== undefined);
    bar.firstElementChild.style.width = share === undefined ? '' : `${percent}%`;
    if (share === undefined)
      bar.removeAttribute('aria-valuenow');
    else
      bar.setAttribute('aria-valuenow', percent);
  }
  if (want > 0)
    $('openingText').textContent = `${bytes(got)} of ${bytes(want)}`;
  const stalls = Boolean(trouble) || (want > 0 && quiet >= STALL_MS);
  $('stall').hidden = !stalls;
  if (stalls) {
    $('stallWhat').textContent = trouble ? `The line is dead: ${trouble}` : `Nothing has come for ${Math.floor(quiet / 1000)} s`;
    $('stallNext').textContent = `Waiting for ${what}, ${bytes(want - got)} of ${bytes(want)}. ${trouble ? 'It is asked for again now and then; what has come is kept.' : 'What has come is kept.'}`;
  }
}

/** `retry`: what the button does; without it there is none. */
export function showError(error, retry) {
  $('error').hidden = !error;
  if (!error)
    return;
  const cut = error.message.lastIndexOf('; ');
  const sentence = (s) => s.charAt(0).toUpperCase() + s.slice(1) + (/[.!?]$/.test(s) ? '' : '.');
  $('errorWhat').textContent = cut < 0 ? error.message : error.message.slice(0, cut);
  $('errorNext').textContent = cut < 0 ? '' : sentence(error.message.slice(cut + 2));
  $('errorRetry').hidden = !retry;
  $('errorRetry').onclick = () => {
    showError();
    retry();
  };
}
