/* Catalogues, as `ebpo catalogue` and the package for Python write them: models that are asked as
 * one, or the parts of one. docs/guide/clusters.md has the format. */
#ifndef EBPO_TOOLS_CATALOGUE_H
#define EBPO_TOOLS_CATALOGUE_H

#include <ebpo/ebpo.h>

enum { CATALOGUE_DIGEST = 64 };

typedef struct catalogue_entry {
    char *path;    /* or URL: asked for winding numbers */
    char *surface; /* what distances and rays see; NULL: the same model */
    char *numbers; /* a .npy with the numbers in the whole of the surface's faces; or NULL */
    bool solid;
    bool unseen; /* there is no surface: it is made of caps alone */
    char digest[CATALOGUE_DIGEST + 1], surface_digest[CATALOGUE_DIGEST + 1]; /* lower-case hex */
    double min[3], max[3];
} catalogue_entry;

typedef struct catalogue {
    char *path;
    uint64_t count; /* at least 1, less than 2^32 */
    catalogue_entry *entry;
    bool parts; /* of one model, for which `rule` says what is inside of the sum */
    ebpo_rule rule;
    uint64_t bytes, hash; /* of the file: its length, and FNV-1a of all of it */
} catalogue;

/* Whether a MODEL is taken for a catalogue: by its name, that of a file that ends in .json. */
bool catalogue_is(const char *name);

/* Reads and checks what the file says; opens no model. EBPO_E_IO, EBPO_E_FORMAT (where and what),
 * EBPO_E_VERSION, EBPO_E_LIMIT: more than 1 GiB; EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status catalogue_read(const char *path, catalogue **out, ebpo_error *error);
void catalogue_free(catalogue *c);

/* Fills in the error, as libebpo does; `file` NULL: none. Returns the status. */
ebpo_status catalogue_fail(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...) EBPO_PRINTF(4, 5);

#endif
