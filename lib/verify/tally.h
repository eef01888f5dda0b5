/* Counts of checks and violations, and the first violation of each kind in file order, independent
 * of threads (tally.c). */
#ifndef EBPO_VERIFY_TALLY_H
#define EBPO_VERIFY_TALLY_H

#include <ebpo/verify.h>

typedef enum ebpo_verify_kind {
    EBPO_VERIFY_STRUCTURE,
    EBPO_VERIFY_CONTENT,
    EBPO_VERIFY_CONTAINMENT,
    EBPO_VERIFY_NESTING,
    EBPO_VERIFY_LABELS,
    EBPO_VERIFY_LISTS,
    EBPO_VERIFY_SOURCE,
    EBPO_VERIFY_KINDS
} ebpo_verify_kind;

#define EBPO_NO_FACE  UINT64_MAX
#define EBPO_NO_PLANE UINT32_MAX

/* Position of a violation. Octcode 0: all of the file. File order is the order of these fields
 * (octcodes order nodes breadth-first). */
typedef struct ebpo_verify_place {
    uint64_t octcode;
    uint64_t face;  /* EBPO_NO_FACE: none */
    uint32_t plane; /* EBPO_NO_PLANE: none */
} ebpo_verify_place;

/* Counts of one thread. A tally of zeros is empty. */
typedef struct ebpo_tally {
    uint64_t checks[EBPO_VERIFY_KINDS], violations[EBPO_VERIFY_KINDS];
    ebpo_verify_place place[EBPO_VERIFY_KINDS]; /* places of `first` */
    char first[EBPO_VERIFY_KINDS][240];
    /* listed faces that do not touch their leaf: allowed, since lists may contain more than
     * necessary */
    uint64_t spare_entries;
    uint64_t exact_touches, exact_half_spaces; /* number of tests in rationals */
} ebpo_tally;

/* Counts one violation. Keeps "place: text" if this violation comes before the first one so far, in
 * file order. */
void ebpo_tally_violation(ebpo_tally *tally, ebpo_verify_kind kind, const ebpo_verify_place *place,
                          const char *format, ...) EBPO_PRINTF(4, 5);

/* Counts one check, and a violation unless `holds`; returns `holds`. For places outside the tree.
 */
bool ebpo_tally_check(ebpo_tally *tally, ebpo_verify_kind kind, bool holds, const char *format, ...)
    EBPO_PRINTF(4, 5);

/* Adds the counts of `from`. The result does not depend on the order of merging. */
void ebpo_tally_merge(ebpo_tally *into, const ebpo_tally *from);

/* Writes all kinds and their sums. */
void ebpo_tally_report(const ebpo_tally *tally, ebpo_verify_report *report);

#endif
