// What goes wrong is said in one sentence: what, where, and what to do next. `code` is for programs.

export class EbpoError extends Error {
  /**
   * @param {'FORMAT'|'VERSION'|'NETWORK'|'ABSENT'|'ARGUMENT'} code  as the C library's status of the same name
   * @param {string} message
   */
  constructor(code, message, options) {
    super(message, options);
    this.name = 'EbpoError';
    this.code = code;
  }
}

/** A file that breaks its format. `where` is an object's path, or '' for the file as a whole. */
export function formatError(where, what, next = 'get a fresh copy of the file') {
  return new EbpoError('FORMAT', `${where ? where + ': ' : ''}${what}; ${next}`);
}

/** An array that another program has stored anew: not damaged, but not in the form that the format fixes. */
export function foreignError(where, what) {
  return new EbpoError('UNSUPPORTED', `${where}: ${what}; write the file anew with 'ebpo repack --compat'`);
}
