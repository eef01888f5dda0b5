/* What `ebpo convert` says of the mesh that it read and of the file that it wrote. */
#ifndef EBPO_TOOLS_CONVERT_TELL_H
#define EBPO_TOOLS_CONVERT_TELL_H

#include <ebpo/file.h>

#include "cli/mesh_input.h"
#include "cli/stages.h"

/* What is told, and how. */
typedef struct convert_told {
    const char *in, *out; /* `in` as it is told of */
    bool piped;           /* it came from standard input */
    bool json, quiet, timings;
    bool repaired, chosen; /* --repair was given; the parts were chosen by size */
    bool by_groups;        /* warnings are told of each group, not here */
} convert_told;

/* Before building: what the mesh is, and warnings. */
void convert_tell_mesh(const convert_told *t, const mesh_input *p);

/* Afterwards: what is on the disk, as a reader sees it. */
EBPO_MUST_USE ebpo_status convert_tell_file(const convert_told *t, const mesh_input *p,
                                            const progress_line *line, const stage_facts *stages,
                                            double seconds, ebpo_error *error);

#endif
