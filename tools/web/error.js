// Errors of files and servers. The message is one sentence: where, what is wrong, and what to do next. Programs use `code`.

export class EbpoError extends Error {
  /**
   * @param {'FORMAT'|'VERSION'|'NETWORK'|'ABSENT'|'ARGUMENT'} code  the C library's status with the same name
   * @param {string} message
   */
  constructor(code, message, options) {
    super(message, options);
    this.name = 'EbpoError';
    this.code = code;
  }
}

/** Makes the error of a file that violates the format. `where` is an object's path, or '' for the whole file. */
export function formatError(where, what, next = 'get a fresh copy of the file') {
  return new EbpoError('FORMAT', `${where ? where + ': ' : ''}${what}; ${next}`);
}

/** Makes the error of an array that another program has rewritten: not damaged, but not in the layout that the format requires. */
export function foreignError(where, what) {
  return new EbpoError('UNSUPPORTED', `${where}: ${what}; rewrite the file with 'ebpo repack --compat'`);
}
