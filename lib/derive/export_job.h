/* Inside lib/derive: what a writer is asked for, and what all of them do with it. */
#ifndef EBPO_DERIVE_EXPORT_JOB_H
#define EBPO_DERIVE_EXPORT_JOB_H

#include "derive/block.h"

/* `path` and `second` are the names that the files get. */
typedef struct ebpo_export_job {
    const ebpo_file *file;
    const char *path, *second;
    ebpo_export_format format;
    const ebpo_export_options *options;
    ebpo_export_report *report;
} ebpo_export_job;

/* Reads block i and enters it in the report. Freed by ebpo_block_free, on failure too;
 * EBPO_E_CANCELLED when the caller wants to stop. */
EBPO_MUST_USE ebpo_status ebpo_export_read_block(const ebpo_export_job *job, int i,
                                                 ebpo_block_order order, ebpo_block *out,
                                                 ebpo_error *error);

/* EBPO_E_LIMIT for what a format cannot count. GLB, of that many bytes of text and of numbers: its
 * sizes have 32 bits. OBJ and STL: assimp numbers corners in 32 bits. */
enum { EBPO_GLB_HEADS = 28 };
EBPO_MUST_USE ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin,
                                                ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_check_scene(const char *path, uint64_t vertices,
                                                  uint64_t faces, ebpo_error *error);

#endif
