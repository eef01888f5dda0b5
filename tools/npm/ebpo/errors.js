// Errors of the package. Each class corresponds to one status of the library (ebpo/base.h).

/** Base class. `status` is the name in the library; `path` and `offset` locate damage in the file. */
export class EbpoError extends Error {
  constructor(message, { status = 'EBPO_E_IO', path = '', offset = -1, cause } = {}) {
    super(message, cause === undefined ? undefined : { cause });
    this.name = new.target.name;
    this.status = status;
    this.path = path;
    this.offset = offset;
  }
}

/** A file or a server could not be read, or the file has changed. */
export class EbpoReadError extends EbpoError {}
/** The file is damaged or has another format. */
export class EbpoFormatError extends EbpoError {}
/** The file needs a newer version of this package. */
export class EbpoVersionError extends EbpoError {}
/** A memory budget, the heap or another limit does not suffice. */
export class EbpoLimitError extends EbpoError {}
/** An argument is not valid. */
export class EbpoArgumentError extends EbpoError {}
/** The file does not contain the data, or the package does not support it. */
export class EbpoAbsentError extends EbpoError {}
/** A synchronous call needs bytes that are not in memory; the asynchronous method gets them. */
export class EbpoPendingError extends EbpoError {}

export const STATUS = {
  [-1]: ['EBPO_E_MEMORY', EbpoLimitError],
  [-2]: ['EBPO_E_ARGUMENT', EbpoArgumentError],
  [-3]: ['EBPO_E_IO', EbpoReadError],
  [-4]: ['EBPO_E_FORMAT', EbpoFormatError],
  [-5]: ['EBPO_E_VERSION', EbpoVersionError],
  [-6]: ['EBPO_E_UNSUPPORTED', EbpoAbsentError],
  [-7]: ['EBPO_E_NOT_SOLID', EbpoArgumentError],
  [-8]: ['EBPO_E_LIMIT', EbpoLimitError],
  [-9]: ['EBPO_E_CANCELLED', EbpoError],
  [-10]: ['EBPO_E_ABSENT', EbpoAbsentError],
  [-11]: ['EBPO_E_PENDING', EbpoPendingError],
};

/** Returns an error for a status of the library. */
export const errorOf = (code, message, path, offset) => {
  const [status, Class] = STATUS[code] ?? [`status ${code}`, EbpoError];
  return new Class(message || status, { status, path, offset });
};
