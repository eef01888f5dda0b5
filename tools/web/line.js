// Shows the state of the connection: progress, waiting time, errors, and a button to retry.
const $ = (id) => document.getElementById(id);
const STALL_MS = 3000; // the page reports a stall after so long without a byte

export const bytes = (n) => (n < 1000 ? `${n} B` : n < 1e6 ? `${(n / 1e3).toFixed(n < 1e4 ? 1 : 0)} kB` : n < 1e9 ? `${(n / 1e6).toFixed(n < 1e7 ? 2 : 1)} MB` : `${(n / 1e9).toFixed(2)} GB`);

/** Shows that data is being fetched or computed, before the amount is known. */
export function busy(on) {
  $('progress').classList.toggle('on', on);
  if (!on)
    showLine({ got: 0, want: 0, quiet: 0 });
}

/** Shows the card before the first picture, which boot.js created; hides the card without a name. */
export function showOpening(name) {
  document.documentElement.classList.toggle('opening', name !== undefined);
  if (name !== undefined)
    $('openingName').textContent = name;
}

/**
 * Shows the progress of all requests. `got`, `want`: received and requested bytes; `quiet`: milliseconds since the last byte; `what`: the purpose of the data;
 * `trouble`: the reason of a stall, if known.
 */
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
    $('stallWhat').textContent = trouble ? `Connection lost: ${trouble}` : `No data for ${Math.floor(quiet / 1000)} s`;
    const kept = trouble ? 'The page repeats the request from time to time; received data is kept.' : 'Received data is kept.';
    $('stallNext').textContent = `Waiting for ${what}, ${bytes(want - got)} of ${bytes(want)}. ${kept}`;
  }
}

/** Shows an error, or hides the last one. `retry`: called by the button Retry; without `retry` the button is hidden. */
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

/** Shows a query's result over the picture while the panel is hidden; hides it without a title. `kind`: the class of the title's colour. */
export function showPointCard(title, note = '', kind = '') {
  const card = $('pointCard'), [strong, span] = card.children;
  card.hidden = !title;
  strong.textContent = title ?? '';
  strong.className = kind;
  span.textContent = note;
}
