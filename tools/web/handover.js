// The first answer, which the page asked for before this code was there (boot.js), as the answer to the worker's own first request.
let first;

/** A part of it, as the page sends them. */
export function takeFirst({ url, range, head, bytes, end, failed }) {
  if (range) {
    first = { url, range, taken: false };
    first.body = new ReadableStream({ start: (controller) => (first.controller = controller) });
    first.answer = new Promise((done, fail) => Object.assign(first, { done, fail }));
    first.answer.catch(() => {}); // told to whom takes it
  } else if (first.ended) {
    return; // nobody wants the rest
  } else if (head) {
    first.done(new Response(first.body, head));
  } else if (bytes) {
    first.controller.enqueue(bytes);
  } else if (end) {
    first.ended = true;
    first.controller.close();
  } else {
    first.ended = true;
    first.fail(new TypeError(failed));
    first.controller.error(new TypeError(failed));
  }
}

/** fetch, but for that one request. `forget()` is called when nobody wants it any more. */
export const fetchAfter = (forget) => (url, init) => {
  if (!first || first.taken || url !== first.url || init.headers.Range !== first.range)
    return fetch(url, init);
  const { answer } = first;
  first.taken = true;
  init.signal.addEventListener('abort', () => {
    if (first.ended)
      return;
    takeFirst({ failed: 'it was ended' });
    forget();
  });
  return answer;
};
