#include "core/strict_fp.h"

#include "query/query_node.h"

#include <stdio.h>
#include <string.h>

#include "core/error.h"

/* What the file was cut to, in words. */
static void describe(const ebpo_info *info, char *out, size_t capacity)
{
    const double *b = info->kept_box;
    size_t used = 0;
    out[0] = 0;
    if (info->cut_levels)
        used =
            (size_t)snprintf(out, capacity, "it was cut to levels 0 to %d", info->cut_levels - 1);
    if (info->boxed && used < capacity)
        snprintf(out + used, capacity - used, "%s %.9g,%.9g,%.9g to %.9g,%.9g,%.9g",
                 used ? " and to the box" : "it was cut to the box", b[0], b[1], b[2], b[3], b[4],
                 b[5]);
    used = strlen(out);
    if (info->kept_error > 0 && used < capacity)
        snprintf(out + used, capacity - used, "%s %.9g",
                 used ? " and to an error of" : "it was cut to an error of", info->kept_error);
    if (!out[0])
        snprintf(out, capacity, "it is a part of another file");
}

ebpo_status ebpo_fail_pruned(const ebpo_model *model, ebpo_cell cell, ebpo_error *error)
{
    char cut[200];
    ebpo_box box = ebpo_model_box(model);
    describe(model->info, cut, sizeof cut);
    return ebpo_fail(error, EBPO_E_ABSENT,
                     "%.120s: this needs nodes left out below level %d at %.6g %.6g %.6g (%s); ask "
                     "with a level, or make a larger part of the original with "
                     "`ebpo subset` or `ebpo fetch`",
                     model->file->in.shown, cell.level, ebpo_wall(&box, 0, cell.level, cell.at[0]),
                     ebpo_wall(&box, 1, cell.level, cell.at[1]),
                     ebpo_wall(&box, 2, cell.level, cell.at[2]), cut);
}
