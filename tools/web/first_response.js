// boot.js sends the page's first request before this code is loaded. This module gives the response to the worker as the response to the worker's first request.
let first;

/** Takes a message from boot.js with a part of the response. */
export function takeFirst({ url, range, head, bytes, end, failed }) {
  if (range) {
    first = { url, range, taken: false };
    first.body = new ReadableStream({ start: (controller) => (first.controller = controller) });
    first.response = new Promise((done, fail) => Object.assign(first, { done, fail }));
    first.response.catch(() => {}); // the receiver reports the error
  } else if (first.ended) {
    return; // the request was aborted or is complete
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

/** Returns a function like fetch() that uses the response of boot.js for the first request. Calls `forget()` when this response is no longer needed. */
export const fetchAfter = (forget) => (url, init) => {
  if (!first || first.taken || url !== first.url || init.headers.Range !== first.range)
    return fetch(url, init);
  const { response } = first;
  first.taken = true;
  init.signal.addEventListener('abort', () => {
    if (first.ended)
      return;
    takeFirst({ failed: 'the request was aborted' });
    forget();
  });
  return response;
};
