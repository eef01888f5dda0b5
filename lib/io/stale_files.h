/* Temporary files of writers that were killed. */
#ifndef EBPO_IO_STALE_FILES_H
#define EBPO_IO_STALE_FILES_H

/* Bytes of a target's name that its temporary files begin with: enough to recognise it, and few
 * enough to keep the sum below the usual limit of 255. */
enum { EBPO_TARGET_NAME_KEPT = 200 };

/* Removes temporary files for `name` in `folder` that nobody writes any more: their process is not
 * there, and nobody, of another machine either, holds their lock (flock). What cannot be looked at
 * or removed stays. */
void ebpo_remove_stale_files(const char *folder, const char *name);

#endif
