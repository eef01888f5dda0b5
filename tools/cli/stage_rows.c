#include "cli/stage_rows.h"

#include <string.h>

const stage_name stage_names[STAGE_ROWS] = {
    [STAGE_READING] = { "reading", 0, { "reading" } },
    [STAGE_REPAIR] = { "repairing", 0, { "repairing", "trying repairs" } },
    [STAGE_ORDERING] = { "ordering",
                         THESIS_LEAVES,
                         { "checking faces", "measuring the box", "ordering vertices",
                           "ordering faces", "bounds" } },
    [STAGE_CHECKING] = { "checking",
                         0,
                         { "checking coordinates", "counting faces at vertices",
                           "linking faces to vertices", "checking vertices", "measuring faces",
                           "checking edges", "comparing positions" } },
    [STAGE_CUTTING] = { "cutting", THESIS_LEAVES | THESIS_PATHS, { "cutting into pieces" } },
    [STAGE_CORNERS] = { "corners", THESIS_CORNERS, { "winding numbers" } },
    [STAGE_CELLS] = { "cells", THESIS_LEAVES | THESIS_CORNERS | THESIS_PATHS, { "cells" } },
    [STAGE_CHOOSING] = { "choosing",
                         THESIS_LEAF_PLANES | THESIS_CLIPPING | THESIS_STORING,
                         { "choosing planes" } },
    [STAGE_TOP] = { "top", THESIS_STORING, { "top envelopes" } },
    [STAGE_ENVELOPES] = { "envelopes", THESIS_STORING, { "envelopes" } },
    [STAGE_JOINING] = { "joining", THESIS_STORING, { "joining levels" } },
    [STAGE_NUMBERING] = { "numbering", THESIS_STORING, { "numbering vertices" } },
    [STAGE_WRITING] = { "writing", THESIS_STORING, { "writing" } },
    [STAGE_SELECTING] = { "selecting",
                          0,
                          { "reading levels", "measuring envelopes", "bounding envelopes" } },
    [STAGE_OTHER] = { "other", 0, { NULL } },
};

stage_row stages_row(const char *library_stage)
{
    for (int r = 0; r < STAGE_OTHER; r++)
        for (int i = 0; i < 8 && stage_names[r].stages[i]; i++)
            if (strcmp(stage_names[r].stages[i], library_stage) == 0)
                return (stage_row)r;
    return STAGE_OTHER;
}
