/* Counts the verifier's checks and violations, and keeps the first violation of each kind, in file
 * order (ebpo_verify_place). The result does not depend on the number of threads. */
#ifndef EBPO_VERIFY_TALLY_H
#define EBPO_VERIFY_TALLY_H

#include <ebpo/verify.h>

/* Kinds of checks, as in ebpo_verify_report. */
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

/* Position of a violation. In file order, positions are compared by these members, one after the
 * other. The order of octcodes (locational codes) is breadth-first. */
typedef struct ebpo_verify_place {
    uint64_t octcode; /* 0: the violation concerns no node */
    uint64_t face;    /* EBPO_NO_FACE: none */
    uint32_t plane;   /* EBPO_NO_PLANE: none */
} ebpo_verify_place;

/* Counts of one thread. A tally of zeros is empty. */
typedef struct ebpo_tally {
    uint64_t checks[EBPO_VERIFY_KINDS], violations[EBPO_VERIFY_KINDS];
    ebpo_verify_place place[EBPO_VERIFY_KINDS]; /* positions of the violations in `first` */
    char first[EBPO_VERIFY_KINDS][240];         /* texts of the first violations */
    /* number of faces in the lists of leaves that do not touch the leaf; the format allows such
     * faces if they are near the leaf */
    uint64_t spare_entries;
    uint64_t exact_touches, exact_half_spaces; /* numbers of tests in rational arithmetic */
} ebpo_tally;

/* Counts one violation. If it precedes the first violation so far in file order, keeps its text,
 * which begins with the place. */
void ebpo_tally_violation(ebpo_tally *tally, ebpo_verify_kind kind, const ebpo_verify_place *place,
                          const char *format, ...) EBPO_PRINTF(4, 5);

/* Counts one check that concerns no node, and a violation if `holds` is false. Returns `holds`. */
bool ebpo_tally_check(ebpo_tally *tally, ebpo_verify_kind kind, bool holds, const char *format, ...)
    EBPO_PRINTF(4, 5);

/* Adds the counts of `from`. The result does not depend on the order of merging. */
void ebpo_tally_merge(ebpo_tally *into, const ebpo_tally *from);

/* Writes the counts of all kinds, and their sums, to the report. */
void ebpo_tally_report(const ebpo_tally *tally, ebpo_verify_report *report);

#endif
