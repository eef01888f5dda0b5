// Passes the response to the page's first request, made by boot.js before this code was loaded, to the worker as its first response.
let first;

/** A part of it, as the page sends them. */
export function takeFirst({ url, range, head, bytes, end, failed }) {
  if (range) {
    first = { url, range, taken: false };
    first.body = new ReadableStream({ start: (controller) => (first.controller = controller) });
    first.answer = new Promise((done, fail) => Object.assign(first, { done, fail }));
    first.answer.catch(() => {}); // the receiver reports the error
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

/** Acts like fetch, except for that one request. `forget()` is called when the response is no longer needed. */
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
