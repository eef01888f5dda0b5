/* EBP-Octree in HDF5: proving that a file keeps its promises. */
#ifndef EBPO_VERIFY_H
#define EBPO_VERIFY_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One kind of check: how often it was made and how often it failed. */
typedef struct ebpo_verify_count {
    uint64_t checks, violations;
    char first[240]; /* the first violation in file order, "" if none */
} ebpo_verify_count;

typedef struct ebpo_verify_report {
    size_t struct_size;          /* EBPO_VERIFY_REPORT_INIT sets it */
    ebpo_verify_count structure; /* head, shapes, counts, index arrays, order */
    ebpo_verify_count content;   /* content checksum */
    /* vertices, clipped faces and inside corners against every half-space on their path */
    ebpo_verify_count containment;
    /* a child's envelope lies in its parent's; leaf planes included */
    ebpo_verify_count nesting;
    /* white, black and corner winding numbers against an independent winding number */
    ebpo_verify_count labels;
    /* no face touches a cell that does not list it; no list names a face twice */
    ebpo_verify_count lists;
    ebpo_verify_count source;    /* mesh equal to the source (--against), bit for bit */
    uint64_t checks, violations; /* sums */
} ebpo_verify_report;
#define EBPO_VERIFY_REPORT_INIT EBPO_SIZED(ebpo_verify_report)

typedef struct ebpo_verify_options {
    size_t struct_size; /* EBPO_VERIFY_OPTIONS_INIT sets it */
    /* mesh as read (before mending and arranging), or NULL; mending recorded in the file is done
     * again */
    const ebpo_mesh *source;
    unsigned threads; /* 0: all cores */
    /* cells whose labels are checked by an independent winding number; 0: all of up to 2^22, 2^20
     * of more, but 4096 where that would take more than some seconds (4e8 looks at a point); at
     * least one of each level and type */
    uint64_t label_samples;
    ebpo_progress progress;
    /* what the work keeps to, in memory and temporary files; NULL: as much memory as it takes. */
    ebpo_workspace *workspace;
} ebpo_verify_options;
#define EBPO_VERIFY_OPTIONS_INIT                                      \
    {                                                                 \
        sizeof(ebpo_verify_options), NULL, 0, 0, { NULL, NULL }, NULL \
    }

/* Verifies an open file. EBPO_OK when the work could be done, whatever it found: look at
 * report->violations. A file too damaged to be read counts as a structure violation. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_verify(const ebpo_file *file,
                                               const ebpo_verify_options *options,
                                               ebpo_verify_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
