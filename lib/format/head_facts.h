/* The attributes of the root and of the levels' groups: ebpo_info but for what the reader measures.
 */
#ifndef EBPO_FORMAT_HEAD_FACTS_H
#define EBPO_FORMAT_HEAD_FACTS_H

#include <stddef.h>

#include <ebpo/file.h>

#include "hdf5_read/head.h"
#include "hdf5_write/h5.h"

/* Writes the root's attributes; checksums and chunk_index_* as they stand (put them again
 * later). */
EBPO_MUST_USE ebpo_status ebpo_facts_put(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                const uint8_t digest[32], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_colours_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                        const uint8_t digest[32],
                                                        ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_index(ebpo_h5_out *out, ebpo_h5_id root, uint64_t offset,
                                               uint64_t bytes, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_top(ebpo_h5_out *out, ebpo_h5_id root, uint64_t bytes,
                                             ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_level(ebpo_h5_out *out, ebpo_h5_id group,
                                               const ebpo_level_summary *level, ebpo_error *error);

/* Reads the root's attributes: version and required parts first, so that a newer file is refused by
 * name and not for its details. */
EBPO_MUST_USE ebpo_status ebpo_facts_get(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_get_level(ebpo_head *in, ebpo_head_object group,
                                               const char *path, ebpo_level_summary *level,
                                               ebpo_error *error);

/* One digest, of any object. */
EBPO_MUST_USE ebpo_status ebpo_facts_get_digest(ebpo_head *in, ebpo_head_object id,
                                                const char *object, const char *name,
                                                uint8_t digest[32], ebpo_error *error);

/* Checks that the facts agree with each other: ranges, and sums over the levels. For files
 * (EBPO_E_FORMAT) and for callers' trees (EBPO_E_ARGUMENT). */
EBPO_MUST_USE ebpo_status ebpo_facts_check(const ebpo_info *info, const char *shown, ebpo_status as,
                                           ebpo_error *error);

/* The attributes of the root and of the levels' groups, one by one: what head_facts_put.c
 * writes and head_facts_get.c reads. */

#define EBPO_FORMAT_NAME "EBP-Octree in HDF5"

/* How a field of ebpo_info becomes an attribute. */
typedef enum ebpo_fact_kind {
    EBPO_FACT_TEXT,    /* char[size], required */
    EBPO_FACT_NOTE,    /* char[size], left out when empty */
    EBPO_FACT_DIGEST,  /* uint8_t[32] as hexadecimal text */
    EBPO_FACT_NUMBER,  /* int as i64 */
    EBPO_FACT_INTEGER, /* int64_t as i64 */
    EBPO_FACT_COUNT32, /* uint32_t as u64 */
    EBPO_FACT_COUNT,   /* uint64_t as u64 */
    EBPO_FACT_HINT,    /* the same, may be absent */
    EBPO_FACT_YES_NO,  /* bool as u64 0 or 1 */
    EBPO_FACT_REAL,    /* double */
    EBPO_FACT_REAL3,   /* double[3] */
    EBPO_FACT_WORD     /* enumeration in a word, see `words` */
} ebpo_fact_kind;

typedef struct ebpo_fact {
    const char *name;
    ebpo_fact_kind kind;
    size_t offset, size;
    const char *const *words;
} ebpo_fact;

#define EBPO_FACT_AT(field) offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), NULL

/* Of ebpo_info, in every file. */
extern const ebpo_fact ebpo_facts[];
extern const int ebpo_fact_count;

/* Of ebpo_level_summary. */
extern const ebpo_fact ebpo_level_facts[];
extern const int ebpo_level_fact_count;
extern const ebpo_fact ebpo_pruned_fact; /* left out when 0 */

/* Of ebpo_info, left out when 0. */
extern const ebpo_fact ebpo_dropped_faces_fact;
/* where vertices were welded within a distance, which comes first */
enum { EBPO_WELD_FACTS = 3 };
extern const ebpo_fact ebpo_weld_facts[EBPO_WELD_FACTS];

/* How planes were chosen, where that was not the usual way: told, and needed by no reader. */
extern const ebpo_fact ebpo_selection_facts[];
extern const int ebpo_selection_fact_count;
extern const char *const ebpo_normals_words[]; /* ends with NULL */

/* Of files with subtrees; with colours. */
extern const ebpo_fact ebpo_subtree_level_fact, ebpo_top_bytes_fact, ebpo_colours_fact;

/* A reader that does not know an optional part is none the wiser, but right; without a required one
 * it would be wrong. */
typedef struct ebpo_part_word {
    const char *word;
    unsigned part; /* an ebpo_part, or: */
    bool required;
} ebpo_part_word;

/* info.pruned, subtree_level and gates: words in the list of parts, but nothing that one could
 * leave out.
 */
enum { EBPO_WORD_PRUNED = 1 << 30, EBPO_WORD_SUBTREES = 1 << 29, EBPO_WORD_GATES = 1 << 28 };
extern const ebpo_part_word ebpo_part_words[];
extern const int ebpo_part_word_count;

#endif
